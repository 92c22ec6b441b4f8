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

/// Serves a running application, or the playback of a recording, to browsers, to Foxglove over
/// WebSockets, and to Prometheus.
///
///     web::Server server(application, description, [&] { return inspection.connect(); });
///     application.add(inspection);
///     application.add(server);   // behind the inspection, which it asks
///
/// One low-priority thread does all of it. Clients have the permissions of the inspection.
///
/// @threads  As `Observer`. Must outlive the application.
class Server final : public host::Observer {
 public:
  static constexpr std::size_t kMaxConnections = 64;
  static constexpr std::size_t kMaxHeaderBytes = 8192;  ///< Of an HTTP request.
  static constexpr std::size_t kMaxBodyBytes = std::size_t{1} << 20U;

  /// Returns a descriptor of a connection to the inspection, as `inspect::Server::connect`.
  using Connect = std::function<int()>;

  using Log = std::function<void(LogLevel level, const std::string& text)>;

  /// For the application at the other end of `connect`. `page`: HTML for browsers; empty: a line of
  /// text. `log` is called on the server's thread.
  Server(config::LiveDescription description, Connect connect, std::string_view page, Log log);
  /// For an application; errors go to its log.
  Server(host::Application& application, config::LiveDescription description, Connect connect,
         std::string_view page = {});
  ~Server() override;

  void open(config::Problems& problems) override;
  void start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void stop(const host::Application& application) override;

  // Without an application: `open`, and then these.

  void start(std::vector<base::Refusal>& refusals);
  void stop();

  /// URL for a browser, including the token; empty before `open`.
  [[nodiscard]] std::string url() const;
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] const std::string& token() const;
  /// The SHA-256 of the certificate created by this run; empty if there is none.
  [[nodiscard]] const std::string& fingerprint() const;

 private:
  class Net;  ///< Everything that depends on the network library.
  const std::unique_ptr<Net> net_;
};

}  // namespace fastcycle::web
