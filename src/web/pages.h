#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "web/hub.h"
#include "web/metrics.h"

namespace fastcycle::web {

/// An answer to an HTTP request.
struct Page {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

/// Serves HTTP requests: the application's answers as JSON, and metrics. Answers are asynchronous.
///
/// @threads  Confined to the server's thread.
class Pages final : public Asker {
 public:
  using Give = std::function<void(Page)>;

  /// `give` is called once per request, unless this is destroyed before.
  Pages(Hub& hub, Give give) : hub_(hub), give_(std::move(give)) {}
  ~Pages() override { hub_.forget(*this); }

  /// `body`: a `fastcycle.inspect.protocol.Request` as JSON, except streams. The page is the
  /// Answer.
  void ask(std::string_view body);
  void ask_metrics(MetricsFormat format, ServedCounts served);

 private:
  Hub& hub_;
  const Give give_;
};

}  // namespace fastcycle::web
