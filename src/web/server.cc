#include "web/server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <exception>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>  // Asio requires it without including it.

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log_level.h"
#include "base/printable.h"
#include "base/priority.h"
#include "base/thread.h"
#include "inspect/client.h"
#include "web/access.h"
#include "web/certificate.h"
#include "web/foxglove.h"
#include "web/hub.h"
#include "web/pages.h"
#include "web/session.h"

namespace fastcycle::web {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using boost::system::error_code;
using tcp = asio::ip::tcp;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr const char* kName = "live";
constexpr auto kHeaderPatience = 5s;       // For the first HTTP request of a connection.
constexpr auto kNextPatience = 75s;        // For the next one of a client that has had an answer.
constexpr auto kKeepAlive = "timeout=60";  // What clients are told: they close before the server.
constexpr auto kAnswerPatience = 30s;      // For the reader of an answer.
constexpr auto kIdlePatience = 30s;        // For any frame from a WebSocket.
constexpr auto kLookPeriod = 50ms;
constexpr auto kAcceptPause = 100ms;  // While accept() fails.
constexpr auto kFarewell = 200ms;
constexpr std::size_t kMaxFrameBytes = std::size_t{1} << 20U;
constexpr std::size_t kMaxPublishBytes = std::size_t{15} << 20U;  // Below the maximum request size.
constexpr int kSendBuffer = 1 << 20;
// Limit per client and system call: as many as fit its buffer list (two per message), and not more
// large ones than a client should wait for before urgent data.
constexpr std::size_t kFramesAtOnce = 32;
constexpr std::size_t kBytesAtOnce = std::size_t{64} << 10U;
// Between two system calls for messages of one client. Each takes a CPU from the components for a
// moment that the kernel does not preempt; the eye sees no difference.
constexpr auto kWritePause = 10ms;

std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

/// @errors  `std::runtime_error` that names the file.
std::string read_file(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    throw std::runtime_error(path + ": cannot be read: " + std::generic_category().message(errno));
  }
  return std::move(text).str();
}

/// Reads the token from the first line of a file.
///
/// @errors  `std::runtime_error` that describes the error in the file.
std::string read_token(const std::string& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) == 0 && (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    throw std::runtime_error(path + ": others may read it: chmod 600 " + path);
  }
  const std::string text = read_file(path);
  std::string token = text.substr(0, text.find_first_of("\r\n"));
  if (!is_token(token)) {
    throw std::runtime_error(path + ": its first line has to be 32 to 256 letters, digits, - and " +
                             "_, as `openssl rand -hex 16` prints them");
  }
  return token;
}

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : std::string();
}

/// A copy of a handler that std::function may hold: a handler may be move-only.
template <typename... Results, typename Handler>
std::function<void(Results...)> copyable(Handler handler) {
  const auto kept = std::make_shared<Handler>(std::move(handler));
  return [kept](Results... results) { std::move (*kept)(results...); };
}

/// A connection, with or without TLS. It is one type, so that HTTP and WebSocket above it are
/// compiled once.
class Stream {
 public:
  using executor_type = beast::tcp_stream::executor_type;
  using Ended = std::function<void(error_code)>;
  using Transferred = std::function<void(error_code, std::size_t)>;

  /// `tls` may be null, and has to outlive the stream.
  Stream(tcp::socket socket, asio::ssl::context* tls) {
    if (tls != nullptr) {
      tls_ = std::make_unique<beast::ssl_stream<beast::tcp_stream>>(std::move(socket), *tls);
    } else {
      plain_ = std::make_unique<beast::tcp_stream>(std::move(socket));
    }
  }

  [[nodiscard]] executor_type get_executor() { return next_layer().get_executor(); }
  [[nodiscard]] beast::tcp_stream& next_layer() { return tls_ ? tls_->next_layer() : *plain_; }
  [[nodiscard]] const beast::tcp_stream& next_layer() const {
    return tls_ ? tls_->next_layer() : *plain_;
  }

  /// Without TLS there is no handshake, and it ends at once.
  void shake_hands(Ended ended) {
    if (tls_) {
      tls_->async_handshake(asio::ssl::stream_base::server, std::move(ended));
    } else {
      ended({});
    }
  }

  template <typename Buffers, typename Handler>
  auto async_read_some(const Buffers& buffers, Handler&& handler) {
    asio::mutable_buffer first;
    for (auto at = asio::buffer_sequence_begin(buffers);
         first.size() == 0 && at != asio::buffer_sequence_end(buffers); ++at) {
      first = *at;
    }
    return asio::async_initiate<Handler, void(error_code, std::size_t)>(
        [this](auto its_handler, asio::mutable_buffer to) {
          read(to, copyable<error_code, std::size_t>(std::move(its_handler)));
        },
        handler, first);
  }

  template <typename Buffers, typename Handler>
  auto async_write_some(const Buffers& buffers, Handler&& handler) {
    return asio::async_initiate<Handler, void(error_code, std::size_t)>(
        [this](auto its_handler, std::vector<asio::const_buffer> parts) {
          write(parts, copyable<error_code, std::size_t>(std::move(its_handler)));
        },
        handler,
        std::vector<asio::const_buffer>(asio::buffer_sequence_begin(buffers),
                                        asio::buffer_sequence_end(buffers)));
  }

  template <typename Handler>
  friend void async_teardown(beast::role_type role, Stream& stream, Handler&& handler) {
    stream.tear_down(role, copyable<error_code>(std::forward<Handler>(handler)));
  }

 private:
  void read(asio::mutable_buffer to, Transferred transferred) {
    if (tls_) {
      tls_->async_read_some(to, std::move(transferred));
    } else {
      plain_->async_read_some(to, std::move(transferred));
    }
  }
  void write(const std::vector<asio::const_buffer>& parts, Transferred transferred) {
    if (tls_) {
      tls_->async_write_some(parts, std::move(transferred));
    } else {
      plain_->async_write_some(parts, std::move(transferred));
    }
  }
  void tear_down(beast::role_type role, Ended ended) {
    using websocket::async_teardown;
    if (tls_) {
      async_teardown(role, *tls_, std::move(ended));
    } else {
      async_teardown(role, *plain_, std::move(ended));
    }
  }

  std::unique_ptr<beast::tcp_stream> plain_;  // One of the two.
  std::unique_ptr<beast::ssl_stream<beast::tcp_stream>> tls_;
};

/// The layer below a WebSocket. The library's own frames (handshake, pings, close) wait here until
/// the connection sends them with its own data: so all output of a client is sent at once, and not
/// frame by frame.
class Below {
 public:
  using executor_type = Stream::executor_type;

  /// Output of the library, and its completion handler.
  struct Waiting {
    std::string bytes;
    std::function<void(error_code)> sent;
  };

  Below(Stream next, std::function<void()> want_write)
      : next_(std::move(next)), want_write_(std::move(want_write)) {}

  [[nodiscard]] executor_type get_executor() { return next_.get_executor(); }
  [[nodiscard]] Stream& next_layer() { return next_; }
  [[nodiscard]] const Stream& next_layer() const { return next_; }
  Waiting take_waiting() { return std::exchange(waiting_, {}); }
  [[nodiscard]] bool has_waiting() const { return !waiting_.bytes.empty(); }

  template <typename Buffers, typename Handler>
  auto async_read_some(const Buffers& buffers, Handler&& handler) {
    return next_.async_read_some(buffers, std::forward<Handler>(handler));
  }

  /// One at a time, as the library calls it.
  template <typename Buffers, typename Handler>
  auto async_write_some(const Buffers& buffers, Handler&& handler) {
    return asio::async_initiate<Handler, void(error_code, std::size_t)>(
        [this](auto its_handler, std::string bytes) {
          const std::size_t size = bytes.size();
          // A handler may be move-only, but std::function requires a copy.
          const auto kept = std::make_shared<decltype(its_handler)>(std::move(its_handler));
          waiting_ = {.bytes = std::move(bytes), .sent = [kept, size](error_code error) {
                        asio::post(beast::bind_front_handler(std::move(*kept), error,
                                                             error ? std::size_t{0} : size));
                      }};
          want_write_();
        },
        handler, beast::buffers_to_string(buffers));
  }

  template <typename Handler>
  friend void async_teardown(beast::role_type role, Below& below, Handler&& handler) {
    async_teardown(role, below.next_, std::forward<Handler>(handler));
  }

 private:
  Stream next_;
  const std::function<void()> want_write_;
  Waiting waiting_;
};

}  // namespace

class Server::Net {
 public:
  Net(config::LiveDescription description, Connect connect, std::string_view page, Log log)
      : log_(std::move(log)),
        description_(std::move(description)),
        connect_(std::move(connect)),
        page_(page) {}
  ~Net() { end(); }

  void open(config::Problems& problems);
  void start(std::vector<base::Refusal>& refusals);
  void end();

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] const std::string& token() const { return access_.token; }
  [[nodiscard]] const std::string& fingerprint() const { return fingerprint_; }
  /// "http" or "ws"; with TLS "https" or "wss".
  [[nodiscard]] std::string scheme(std::string name) const {
    return tls_ ? std::move(name) + "s" : name;
  }
  [[nodiscard]] std::string authority() const {
    const bool is_v6 = name_.find(':') != std::string::npos;
    return is_v6 ? fmt::format("[{}]:{}", name_, port_) : fmt::format("{}:{}", name_, port_);
  }

 private:
  class Connection;

  /// @errors  `std::exception` that describes the error.
  void prepare_tls();

  void serve();
  void accept();
  void wait_for_news();
  void wait_to_look();
  /// The application has ended, or the run.
  void close_all();
  void complain(const std::string& text);
  /// `complain`, for a refused connection.
  void refuse(const std::string& text);

  const Log log_;
  const config::LiveDescription description_;
  const Connect connect_;
  const std::string_view page_;
  Access access_;
  std::string name_;  ///< The address, or the host name.
  std::uint16_t port_ = 0;
  std::optional<asio::ssl::context> tls_;
  std::string fingerprint_;

  asio::io_context io_{1};
  tcp::acceptor acceptor_{io_};
  asio::steady_timer look_timer_{io_};
  asio::steady_timer accept_timer_{io_};
  asio::posix::stream_descriptor news_{io_};  ///< A duplicate of the hub's.
  std::unique_ptr<Hub> hub_;
  std::set<std::shared_ptr<Connection>> connections_;
  std::uint64_t refused_ = 0;
  Clock::time_point next_complaint_{};
  bool is_over_ = false;
  base::Thread thread_;
  bool is_running_ = false;
};

/// One socket: HTTP requests, and after an upgrade a WebSocket.
class Server::Net::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Net& net, Stream stream) : net_(net), stream_(std::move(stream)) {}

  void begin() {
    lowest().expires_after(kHeaderPatience);
    stream_.shake_hands([self = self()](error_code error) {
      if (error) {
        self->net_.refuse("a connection without TLS was refused");
        self->leave();
        return;
      }
      self->read_request(kHeaderPatience);
    });
  }

  /// The network thread has ended.
  void abandon() {
    is_closed_ = true;
    session_.reset();
    pages_.reset();
    if (ws_) {
      // Their handlers hold a reference to this connection.
      ws_->next_layer().take_waiting();
      of_library_.sent = nullptr;
    }
    error_code ignored;
    lowest().socket().close(ignored);
  }

  /// Sends a close frame; reads nothing more.
  void close() {
    if (is_closed_) {
      return;
    }
    if (session_ == nullptr) {
      is_closed_ = true;
      leave();
      return;
    }
    if (!std::exchange(is_ending_, true)) {
      session_->report_losses();
      want_write();  // Pending output is written first.
    }
  }

 private:
  std::shared_ptr<Connection> self() { return shared_from_this(); }
  beast::tcp_stream& lowest() {
    return ws_ ? beast::get_lowest_layer(*ws_) : beast::get_lowest_layer(stream_);
  }

  /// An exception of the hub means the end of the application.
  template <typename Body>
  void guarded(const Body& body) {
    try {
      body();
    } catch (const inspect::ClientError&) {
      net_.close_all();
    } catch (const std::exception& error) {
      net_.complain(error.what());
      leave();
    }
  }

  /// Removes the connection.
  void leave() {
    abandon();
    net_.connections_.erase(self());
  }

  void read_request(std::chrono::seconds patience) {
    parser_.emplace();
    parser_->header_limit(kMaxHeaderBytes);
    parser_->body_limit(kMaxBodyBytes);
    lowest().expires_after(patience);
    http::async_read_header(stream_, buffer_, *parser_,
                            [self = self()](error_code error, std::size_t) {
                              self->guarded([&] { self->take_header(error); });
                            });
  }

  void take_header(error_code error) {
    if (error == http::error::header_limit) {
      net_.refuse("a request with a header that is too large was refused");
      answer(http::status::request_header_fields_too_large,
             {.body = "the request's header is too large\n"});
      return;
    }
    if (error == http::error::body_limit) {
      answer(http::status::payload_too_large,
             {.body = fmt::format("a request may have {} bytes\n", kMaxBodyBytes)});
      return;
    }
    if (error) {
      leave();
      return;
    }
    const auto& request = parser_->get();
    const auto header = [&](http::field field) { return view_of(request[field]); };
    const std::string_view target = view_of(request.target());
    const std::string refusal =
        find_refusal(net_.access_, {.target = target,
                                    .host = header(http::field::host),
                                    .origin = header(http::field::origin),
                                    .authorization = header(http::field::authorization)});
    if (!refusal.empty()) {
      net_.refuse("a connection was refused: " + base::printable(refusal));
      answer(http::status::forbidden, {.body = refusal + "\n"});
      return;
    }
    if (websocket::is_upgrade(request)) {
      const std::string_view subprotocol =
          foxglove::choose_subprotocol(header(http::field::sec_websocket_protocol));
      if (subprotocol.empty()) {
        answer(http::status::bad_request,
               {.body = fmt::format("a WebSocket is offered for the subprotocols {} and {}\n",
                                    foxglove::kNewSubprotocol, foxglove::kOldSubprotocol)});
        return;
      }
      upgrade(subprotocol);
      return;
    }
    http::async_read(stream_, buffer_, *parser_, [self = self()](error_code failed, std::size_t) {
      self->guarded([&] { self->take_request(failed); });
    });
  }

  /// Handles an HTTP request that may be answered.
  void take_request(error_code error) {
    if (error || is_closed_) {
      leave();
      return;
    }
    const auto& request = parser_->get();
    is_kept_ = request.keep_alive();
    const std::string_view target = view_of(request.target());
    const std::string_view path = target.substr(0, target.find('?'));
    const std::string_view method = view_of(request.method_string());
    const std::string_view expected = path == "/ask" ? "POST" : "GET";
    if (path != "/" && path != "/ask" && path != "/metrics") {
      answer(http::status::not_found, {.body = "there is /, /metrics and, by POST, /ask\n"});
    } else if (method != expected) {
      answer(http::status::method_not_allowed,
             {.body = fmt::format("{} takes {}\n", path, expected)});
    } else if (path == "/ask") {
      pages().ask(request.body());
    } else if (path == "/metrics") {
      pages().ask_metrics(
          choose_format(view_of(request[http::field::accept])),
          {.connections = net_.connections_.size(), .connections_refused = net_.refused_});
    } else if (net_.page_.empty()) {
      answer(http::status::ok,
             {.body = fmt::format("FastCycle: Foxglove connects to {}://{}/?token={}\n",
                                  net_.scheme("ws"), net_.authority(), net_.access_.token)});
    } else {
      answer(http::status::ok,
             {.type = "text/html; charset=utf-8", .body = std::string(net_.page_)});
    }
  }

  Pages& pages() {
    lowest().expires_never();  // The application's answer has no deadline here.
    return pages_.emplace(*net_.hub_, [this](Page page) {
      answer(static_cast<http::status>(page.status), std::move(page));
    });
  }

  void answer(http::status status, Page page) {
    response_ = {status, 11};
    response_.set(http::field::server, "FastCycle");
    response_.set(http::field::content_type, page.type);
    response_.set(http::field::cache_control, "no-store");
    response_.set("Referrer-Policy", "no-referrer");  // The URL contains the token.
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("X-Frame-Options", "DENY");
    response_.keep_alive(is_kept_);
    if (is_kept_) {
      response_.set(http::field::keep_alive, kKeepAlive);
    }
    response_.body() = std::move(page.body);
    response_.prepare_payload();
    lowest().expires_after(kAnswerPatience);
    http::async_write(stream_, response_, [self = self()](error_code error, std::size_t) {
      self->response_.body().clear();
      if (!error && self->is_kept_ && !self->is_closed_) {
        self->is_kept_ = false;
        self->read_request(kNextPatience);
        return;
      }
      error_code ignored;
      self->lowest().socket().shutdown(tcp::socket::shutdown_send, ignored);
      self->leave();
    });
  }

  void upgrade(std::string_view subprotocol) {
    lowest().expires_never();  // The WebSocket has its own timeout.
    ws_.emplace(std::move(stream_), [this] { begin_writing(); });
    ws_->set_option(websocket::stream_base::timeout{.handshake_timeout = kHeaderPatience,
                                                    .idle_timeout = kIdlePatience,
                                                    .keep_alive_pings = true});
    ws_->set_option(websocket::stream_base::decorator(
        [name = std::string(subprotocol)](websocket::response_type& response) {
          response.set(http::field::sec_websocket_protocol, name);
          response.set(http::field::server, "FastCycle");
        }));
    ws_->read_message_max(net_.hub_->may("publish") ? kMaxPublishBytes : kMaxFrameBytes);
    ws_->auto_fragment(false);
    ws_->async_accept(parser_->get(), [self = self()](error_code error) {
      if (error) {
        self->leave();
        return;
      }
      self->guarded([&] {
        self->session_ =
            std::make_unique<Session>(*self->net_.hub_, [it = self.get()] { it->want_write(); });
        self->read();
      });
    });
  }

  void read() {
    ws_->async_read(buffer_, [self = self()](error_code error, std::size_t) {
      self->guarded([&] { self->take_frame(error); });
    });
  }

  void take_frame(error_code error) {
    if (error || is_closed_) {
      leave();
      return;
    }
    if (is_ending_) {
      return;
    }
    const std::string_view frame(static_cast<const char*>(buffer_.data().data()), buffer_.size());
    if (ws_->got_text()) {
      session_->take_text(frame);
    } else {
      session_->take_binary(frame);
    }
    buffer_.consume(buffer_.size());
    if (session_->outbox().is_overrun()) {
      net_.complain("a client was dropped: it asks, and does not read");
      leave();
      return;
    }
    read();
  }

  /// The session has output.
  void want_write() {
    if (!is_closed_) {
      begin_writing();
    }
  }

  /// Deferred: the session may be in the middle of a call.
  void begin_writing() {
    if (!std::exchange(is_writing_, true)) {
      if (is_urgent() || Clock::now() >= next_write_) {
        asio::post(net_.io_, [self = self()] { self->write(); });
      } else {
        pause();
      }
    } else if (is_pausing_ && is_urgent()) {
      write_timer_.cancel();  // This ends the pause.
    }
  }

  void pause() {
    is_pausing_ = true;
    write_timer_.expires_at(next_write_);
    write_timer_.async_wait([self = self()](error_code) {
      self->is_pausing_ = false;
      self->write();
    });
  }

  /// Whether anything waits except messages, which may be delayed.
  [[nodiscard]] bool is_urgent() {
    return session_ == nullptr || is_closed_ || is_ending_ || ws_->next_layer().has_waiting() ||
           session_->outbox().has_control() || session_->outbox().waiting() >= kBytesAtOnce;
  }

  void write() {
    frames_.clear();
    parts_.clear();
    std::size_t bytes = 0;
    // Nothing may follow a close frame.
    const bool may_send = !is_closed_ && session_ != nullptr && ws_->is_open();
    while (may_send && frames_.size() < kFramesAtOnce && bytes < kBytesAtOnce) {
      std::optional<Frame> frame = session_->outbox().take();
      if (!frame) {
        break;
      }
      frame->head.insert(0, frame->wire_head());
      bytes += frame->size();
      frames_.push_back(std::move(*frame));
    }
    for (const Frame& frame : frames_) {
      parts_.push_back(asio::buffer(frame.head));
      if (frame.message != nullptr) {
        parts_.push_back(asio::buffer(frame.message->payload));
      }
    }
    of_library_ = ws_->next_layer().take_waiting();
    if (!of_library_.bytes.empty()) {
      parts_.push_back(asio::buffer(of_library_.bytes));
    }
    if (parts_.empty()) {
      is_writing_ = false;
      if (is_ending_ && !std::exchange(is_closed_, true)) {
        ws_->async_close(websocket::close_code::going_away,
                         [self = self()](error_code) { self->leave(); });
      }
      return;
    }
    next_write_ = Clock::now() + kWritePause;
    asio::async_write(
        ws_->next_layer().next_layer(), parts_,
        [self = self()](error_code error, std::size_t) { self->take_written(error); });
  }

  void take_written(error_code error) {
    frames_.clear();
    if (const auto sent = std::exchange(of_library_, {}).sent) {
      sent(error);
    }
    if (error) {
      is_writing_ = false;
      leave();
      return;
    }
    if (is_urgent()) {
      write();
    } else if (session_->outbox().waiting() > 0) {
      pause();
    } else {
      is_writing_ = false;
    }
  }

  Net& net_;
  Stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
  bool is_kept_ = false;  ///< Keep-alive: another request may follow.
  std::optional<Pages> pages_;
  std::optional<websocket::stream<Below>> ws_;
  std::unique_ptr<Session> session_;
  // Being written.
  std::vector<Frame> frames_;
  Below::Waiting of_library_;
  std::vector<asio::const_buffer> parts_;
  bool is_writing_ = false;
  asio::steady_timer write_timer_{net_.io_};
  Clock::time_point next_write_{};
  bool is_pausing_ = false;  ///< Until `next_write_`, in the middle of writing.
  bool is_ending_ =
      false;  ///< Nothing is read any more; what waits is written, and then it closes.
  bool is_closed_ = false;
};

void Server::Net::open(config::Problems& problems) {
  const auto wrong = [&](const std::string& text) {
    problems.add(config::make_error(description_.place, text));
  };
  error_code error;
  const auto address = asio::ip::make_address(description_.address, error);
  if (error) {
    wrong(fmt::format("\"{}\" is no IP address", description_.address));
    return;
  }
  name_ = description_.address;
  access_ = {.token = {}, .origins = description_.origins, .hosts = {}};
  const bool is_reached = !address.is_loopback();
  if (const std::string host = host_name(); is_reached && !host.empty()) {
    access_.hosts = {host, host + ".local"};
    name_ = address.is_unspecified() ? host : name_;
  }
  try {
    access_.token =
        description_.token_file.empty() ? make_token() : read_token(description_.token_file);
    if (is_reached || description_.tls || !description_.certificate.empty()) {
      prepare_tls();
    }
  } catch (const std::exception& failure) {
    wrong(failure.what());
    return;
  }
  const tcp::endpoint endpoint(address, description_.port);
  acceptor_.open(endpoint.protocol(), error);
  if (!error) {
    acceptor_.set_option(asio::socket_base::reuse_address(true), error);
  }
  if (!error) {
    acceptor_.bind(endpoint, error);
  }
  if (!error) {
    acceptor_.listen(128, error);
  }
  if (error) {
    wrong(fmt::format(
        "nothing can listen at {}:{}: {}{}", description_.address, description_.port,
        error.message(),
        error == boost::system::errc::address_in_use ? "; port 0 takes one that is free" : ""));
    return;
  }
  port_ = acceptor_.local_endpoint().port();
}

void Server::Net::prepare_tls() {
  if (description_.certificate.empty() != description_.key.empty()) {
    throw std::runtime_error("\"certificate\" and \"key\" belong together");
  }
  Certificate certificate;
  if (description_.certificate.empty()) {
    std::vector<std::string> names = {"localhost", "127.0.0.1"};
    names.insert(names.end(), access_.hosts.begin(), access_.hosts.end());
    if (std::ranges::find(names, description_.address) == names.end()) {
      names.push_back(description_.address);
    }
    certificate = make_certificate(names);
    fingerprint_ = fingerprint_of(certificate.chain);
  } else {
    certificate = {.chain = read_file(description_.certificate),
                   .key = read_file(description_.key)};
  }
  tls_.emplace(asio::ssl::context::tls_server);
  tls_->set_options(asio::ssl::context::no_tlsv1 | asio::ssl::context::no_tlsv1_1);
  const auto need = [&](const error_code& error, const std::string& file, const char* expected) {
    if (error) {
      throw std::runtime_error(
          fmt::format("{}: expected {} in PEM; OpenSSL says: {}", file, expected, error.message()));
    }
  };
  error_code error;
  tls_->use_certificate_chain(asio::buffer(certificate.chain), error);
  need(error, description_.certificate, "a certificate");
  tls_->use_private_key(asio::buffer(certificate.key), asio::ssl::context::pem, error);
  need(error, description_.key, "the private key of the certificate");
}

void Server::Net::start(std::vector<base::Refusal>& refusals) {
  thread_ =
      base::Thread(base::ThreadOptions{.name = kName, .cpus = {}}, [this] { serve(); }, refusals);
  is_running_ = true;
}

void Server::Net::end() {
  if (!is_running_) {
    return;
  }
  asio::post(io_, [this] {
    close_all();
    // Connections that have not closed by then are abandoned.
    look_timer_.expires_after(kFarewell);
    look_timer_.async_wait([this](error_code) { io_.stop(); });
  });
  thread_.join();
  is_running_ = false;
}

void Server::Net::serve() {
  base::give_way();
  try {
    const int descriptor = connect_();
    if (descriptor < 0) {
      throw std::runtime_error("no descriptor is left for its connection to the application");
    }
    hub_ = std::make_unique<Hub>(std::make_unique<inspect::Client>(descriptor, kName),
                                 Hub::Options{.publish = description_.publish, .outbox = {}});
    news_.assign(::dup(hub_->descriptor()));
    accept();
    wait_for_news();
    wait_to_look();
  } catch (const std::exception& error) {
    log_(LogLevel::kError, std::string("nothing is shown: ") + error.what());
    is_over_ = true;
  }
  io_.run();
  // Unfinished work may keep connections alive beyond this set.
  for (const auto& connection : connections_) {
    connection->abandon();
  }
  connections_.clear();
  hub_.reset();
}

void Server::Net::accept() {
  acceptor_.async_accept([this](error_code error, tcp::socket socket) {
    if (is_over_) {
      return;
    }
    if (error) {
      accept_timer_.expires_after(kAcceptPause);
      accept_timer_.async_wait([this](error_code stopped) {
        if (!stopped && !is_over_) {
          accept();
        }
      });
      return;
    }
    if (connections_.size() < kMaxConnections) {
      error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
      const auto connection =
          std::make_shared<Connection>(*this, Stream(std::move(socket), tls_ ? &*tls_ : nullptr));
      connections_.insert(connection);
      connection->begin();
    } else {
      refuse(fmt::format("a connection was refused: there are {} already", kMaxConnections));
    }
    accept();
  });
}

void Server::Net::wait_for_news() {
  news_.async_wait(asio::posix::stream_descriptor::wait_read, [this](error_code error) {
    if (error || is_over_) {
      return;
    }
    try {
      hub_->read();
      wait_for_news();
    } catch (const std::exception&) {
      close_all();
    }
  });
}

void Server::Net::wait_to_look() {
  look_timer_.expires_after(kLookPeriod);
  look_timer_.async_wait([this](error_code error) {
    if (error || is_over_) {
      return;
    }
    try {
      hub_->look(Clock::now());
      hub_->read();  // An answer may have arrived while a request was being sent.
      wait_to_look();
    } catch (const std::exception&) {
      close_all();
    }
  });
}

void Server::Net::close_all() {
  if (std::exchange(is_over_, true)) {
    return;
  }
  error_code ignored;
  acceptor_.close(ignored);
  news_.close(ignored);
  const auto all = connections_;
  for (const auto& connection : all) {
    connection->close();
  }
}

void Server::Net::complain(const std::string& text) {
  const auto now = Clock::now();
  if (now >= next_complaint_) {
    next_complaint_ = now + 1s;
    log_(LogLevel::kWarning, text);
  }
}

void Server::Net::refuse(const std::string& text) {
  ++refused_;
  complain(text);
}

Server::Server(config::LiveDescription description, Connect connect, std::string_view page, Log log)
    : net_(std::make_unique<Net>(std::move(description), std::move(connect), page,
                                 std::move(log))) {}

Server::Server(host::Application& application, config::LiveDescription description, Connect connect,
               std::string_view page)
    : Server(std::move(description), std::move(connect), page,
             [&application](LogLevel level, const std::string& text) {
               application.log(level, kName, text);
             }) {}

Server::~Server() = default;

void Server::open(config::Problems& problems) {
  net_->open(problems);
}

void Server::start(const host::ObserverView&, std::vector<base::Refusal>& refusals) {
  start(refusals);
}

void Server::stop(const host::Application&) {
  stop();
}

void Server::start(std::vector<base::Refusal>& refusals) {
  net_->start(refusals);
}

void Server::stop() {
  net_->end();
}

std::string Server::url() const {
  return net_->port() == 0 ? std::string()
                           : fmt::format("{}://{}/?token={}", net_->scheme("http"),
                                         net_->authority(), net_->token());
}

std::uint16_t Server::port() const {
  return net_->port();
}
const std::string& Server::token() const {
  return net_->token();
}
const std::string& Server::fingerprint() const {
  return net_->fingerprint();
}

}  // namespace fastcycle::web
