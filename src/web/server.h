#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/description.h"
#include "host/application.h"
#include "host/observer.h"

namespace fastcycle::web {

/// Shows a running application, or a recording that is played, to browsers, to Foxglove over
/// WebSockets, and to Prometheus.
///
///     web::Server server(application, description, [&] { return inspection.connect(); });
///     application.add(inspection);
///     application.add(server);   // behind the inspection, which it asks
///
/// One thread of low priority does all of it. What a client may do is what the inspection allows.
///
/// @threads  As `Observer`. It has to live longer than the application.
class Server final : public host::Observer {
 public:
  static constexpr std::size_t kMaxConnections = 64;
  static constexpr std::size_t kMaxHeaderBytes = 8192;  ///< Of an HTTP request.
  static constexpr std::size_t kMaxBodyBytes = std::size_t{1} << 20U;

  /// Gives a descriptor of a connection to the inspection, as `inspect::Server::connect`.
  using Connect = std::function<int()>;

  using Log = std::function<void(LogLevel level, const std::string& text)>;

  /// Of whatever answers at the other end of `connect`. `page`: HTML that browsers are given;
  /// empty: a line of text. `log` is called on the server's thread.
  Server(config::LiveDescription description, Connect connect, std::string_view page, Log log);
  /// Of an application; what goes wrong is in its log.
  Server(host::Application& application, config::LiveDescription description, Connect connect,
         std::string_view page = {});
  ~Server() override;

  void open(config::Problems& problems) override;
  void start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void stop(const host::Application& application) override;

  // Where there is no application: `open`, and then these.

  void start(std::vector<base::Refusal>& refusals);
  void stop();

  /// Where a browser finds it, the token included; empty before `open`.
  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] const std::string& token() const;
  /// The SHA-256 of the certificate that this run has made; empty if it has made none.
  [[nodiscard]] const std::string& fingerprint() const;

 private:
  class Net;  ///< All that is of the network's library.
  const std::unique_ptr<Net> net_;
};

}  // namespace fastcycle::web
