#include "web/server.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <optional>
#include <set>
#include <string_view>
#include <utility>  // Asio needs it, and does not include it.

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/log_level.h"
#include "base/printable.h"
#include "base/thread.h"
#include "inspect/client.h"
#include "web/access.h"
#include "web/foxglove.h"
#include "web/hub.h"
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
constexpr int kNice = 10;
constexpr auto kHeaderPatience = 5s;  // For a whole HTTP request.
constexpr auto kIdlePatience = 30s;   // For a sign of life of a WebSocket.
constexpr auto kLookPeriod = 50ms;
constexpr auto kAcceptPause = 100ms;  // While no connection can be accepted.
constexpr auto kFarewell = 200ms;
constexpr std::size_t kMaxFrameBytes = std::size_t{1} << 20U;
constexpr std::size_t kMaxPublishBytes = std::size_t{15} << 20U;  // Less than a request may have.
constexpr int kSendBuffer = 1 << 20;

std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

}  // namespace

class Server::Net {
 public:
  Net(host::Application& application, config::LiveDescription description, Connect connect)
      : application_(application),
        description_(std::move(description)),
        connect_(std::move(connect)) {}
  ~Net() { end(); }

  void open(config::Problems& problems);
  void start(std::vector<base::Refusal>& refusals);
  void end();

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] const std::string& token() const { return access_.token; }
  [[nodiscard]] std::string authority() const {
    const bool is_v6 = description_.address.find(':') != std::string::npos;
    return is_v6 ? fmt::format("[{}]:{}", description_.address, port_)
                 : fmt::format("{}:{}", description_.address, port_);
  }

 private:
  class Connection;

  void serve();
  void accept();
  void wait_for_news();
  void wait_to_look();
  /// The application has ended, or the run.
  void close_all();
  void complain(const std::string& text);

  host::Application& application_;
  const config::LiveDescription description_;
  const Connect connect_;
  Access access_;
  std::uint16_t port_ = 0;

  asio::io_context io_{1};
  tcp::acceptor acceptor_{io_};
  asio::steady_timer look_timer_{io_};
  asio::steady_timer accept_timer_{io_};
  asio::posix::stream_descriptor news_{io_};  ///< A copy of the hub's.
  std::unique_ptr<Hub> hub_;
  std::set<std::shared_ptr<Connection>> connections_;
  Clock::time_point next_complaint_{};
  bool is_over_ = false;
  base::Thread thread_;
  bool is_running_ = false;
};

/// One socket: an HTTP request, and then, if that asks for it, a WebSocket.
class Server::Net::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Net& net, tcp::socket socket) : net_(net), stream_(std::move(socket)) {}

  void begin() {
    parser_.header_limit(kMaxHeaderBytes);
    parser_.body_limit(0);
    stream_.expires_after(kHeaderPatience);
    http::async_read_header(stream_, buffer_, parser_,
                            [self = this->shared_from_this()](error_code error, std::size_t) {
                              self->guarded([&] { self->take_request(error); });
                            });
  }

  /// The network's thread is over.
  void abandon() {
    is_closed_ = true;
    session_.reset();
    error_code ignored;
    socket().close(ignored);
  }

  /// Says goodbye; nothing more is read.
  void close() {
    if (is_closed_) {
      return;
    }
    is_closed_ = true;
    if (session_ == nullptr) {
      leave();
      return;
    }
    ws_->async_close(websocket::close_code::going_away,
                     [self = this->shared_from_this()](error_code) { self->leave(); });
  }

 private:
  /// What the hub throws is the end of the application.
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

  /// The connection is forgotten.
  void leave() {
    abandon();
    net_.connections_.erase(this->shared_from_this());
  }
  tcp::socket& socket() { return ws_ ? beast::get_lowest_layer(*ws_).socket() : stream_.socket(); }

  void take_request(error_code error) {
    if (error) {
      if (error == http::error::header_limit) {
        answer(http::status::request_header_fields_too_large,
               "the request's header is too large\n");
        net_.complain("a request with a header that is too large was refused");
      } else {
        leave();
      }
      return;
    }
    const auto& request = parser_.get();
    const auto header = [&](http::field field) { return view_of(request[field]); };
    const std::string refusal =
        find_refusal(net_.access_, {.target = view_of(request.target()),
                                    .host = header(http::field::host),
                                    .origin = header(http::field::origin),
                                    .authorization = header(http::field::authorization)});
    if (!refusal.empty()) {
      net_.complain("a connection was refused: " + base::printable(refusal));
      answer(http::status::forbidden, refusal + "\n");
      return;
    }
    if (!websocket::is_upgrade(request)) {
      const bool is_root =
          view_of(request.target()).substr(0, 2) == "/?" || view_of(request.target()) == "/";
      answer(is_root ? http::status::ok : http::status::not_found,
             is_root ? fmt::format("FastCycle: Foxglove connects to ws://{}/?token={}\n",
                                   net_.authority(), net_.access_.token)
                     : std::string("there is no such page\n"));
      return;
    }
    const std::string_view subprotocol =
        foxglove::choose_subprotocol(header(http::field::sec_websocket_protocol));
    if (subprotocol.empty()) {
      answer(http::status::bad_request,
             fmt::format("a WebSocket is offered for the subprotocols {} and {}\n",
                         foxglove::kNewSubprotocol, foxglove::kOldSubprotocol));
      return;
    }
    upgrade(subprotocol);
  }

  void answer(http::status status, std::string text) {
    response_ = {status, 11};
    response_.set(http::field::server, "FastCycle");
    response_.set(http::field::content_type, "text/plain; charset=utf-8");
    response_.set(http::field::cache_control, "no-store");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.keep_alive(false);
    response_.body() = std::move(text);
    response_.prepare_payload();
    http::async_write(stream_, response_,
                      [self = this->shared_from_this()](error_code, std::size_t) {
                        error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                        self->leave();
                      });
  }

  void upgrade(std::string_view subprotocol) {
    stream_.expires_never();  // The WebSocket has its own.
    ws_.emplace(std::move(stream_));
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
    ws_->async_accept(parser_.get(), [self = this->shared_from_this()](error_code error) {
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
    ws_->async_read(buffer_, [self = this->shared_from_this()](error_code error, std::size_t) {
      self->guarded([&] { self->take_frame(error); });
    });
  }

  void take_frame(error_code error) {
    if (error || is_closed_) {
      leave();
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

  /// Something waits. Written a little later: the session may be in the middle of it.
  void want_write() {
    if (is_writing_ || is_closed_) {
      return;
    }
    is_writing_ = true;
    asio::post(net_.io_, [self = this->shared_from_this()] { self->write(); });
  }

  void write() {
    std::optional<Frame> frame;
    if (!is_closed_ && session_ != nullptr) {
      frame = session_->outbox().take();
    }
    if (!frame) {
      is_writing_ = false;
      return;
    }
    frame_ = std::move(*frame);
    ws_->text(frame_.is_text);
    const std::array<asio::const_buffer, 2> parts = {
        asio::buffer(frame_.head),
        frame_.message == nullptr ? asio::const_buffer() : asio::buffer(frame_.message->payload)};
    ws_->async_write(parts, [self = this->shared_from_this()](error_code error, std::size_t) {
      self->frame_ = {};
      if (error) {
        self->leave();
        return;
      }
      self->write();
    });
  }

  Net& net_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  http::request_parser<http::empty_body> parser_;
  http::response<http::string_body> response_;
  std::optional<websocket::stream<beast::tcp_stream>> ws_;
  std::unique_ptr<Session> session_;
  Frame frame_;  ///< Is being written.
  bool is_writing_ = false;
  bool is_closed_ = false;
};

void Server::Net::open(config::Problems& problems) {
  const auto wrong = [&](const std::string& text) {
    problems.add(config::mistake(description_.place, "live: " + text));
  };
  error_code error;
  const auto address = asio::ip::make_address(description_.address, error);
  if (error) {
    wrong(fmt::format("\"{}\" is no IP address", description_.address));
    return;
  }
  if (!address.is_loopback()) {
    wrong(
        fmt::format("{} can be reached from other machines, which want TLS: use 127.0.0.1, and a "
                    "tunnel such as ssh -L",
                    description_.address));
    return;
  }
  access_ = {.token = make_token(), .origins = description_.origins, .hosts = {}};
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
    wrong(fmt::format("nothing can listen at {}:{}: {}", description_.address, description_.port,
                      error.message()));
    return;
  }
  port_ = acceptor_.local_endpoint().port();
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
    // Who does not say goodbye in this time is left.
    look_timer_.expires_after(kFarewell);
    look_timer_.async_wait([this](error_code) { io_.stop(); });
  });
  thread_.join();
  is_running_ = false;
}

void Server::Net::serve() {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), kNice);
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
    application_.log(LogLevel::kError, kName, std::string("nothing is shown: ") + error.what());
    is_over_ = true;
  }
  io_.run();
  // Of those that have not said goodbye, unfinished work may keep more than the set does.
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
      const auto connection = std::make_shared<Connection>(*this, std::move(socket));
      connections_.insert(connection);
      connection->begin();
    } else {
      complain(fmt::format("a connection was refused: there are {} already", kMaxConnections));
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
      hub_->read();  // An answer may have come while a request was being sent.
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
    application_.log(LogLevel::kWarning, kName, text);
  }
}

Server::Server(host::Application& application, config::LiveDescription description, Connect connect)
    : net_(std::make_unique<Net>(application, std::move(description), std::move(connect))) {}

Server::~Server() = default;

void Server::open(config::Problems& problems) {
  net_->open(problems);
}

void Server::start(const host::ObserverView&, std::vector<base::Refusal>& refusals) {
  net_->start(refusals);
}

void Server::stop(const host::Application&) {
  net_->end();
}

std::string Server::url() const {
  return net_->port() == 0 ? std::string()
                           : fmt::format("http://{}/?token={}", net_->authority(), net_->token());
}

std::uint16_t Server::port() const {
  return net_->port();
}
const std::string& Server::token() const {
  return net_->token();
}

}  // namespace fastcycle::web
