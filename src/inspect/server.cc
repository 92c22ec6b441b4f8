#include "inspect/server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log_level.h"
#include "base/priority.h"
#include "inspect/frame.h"
#include "inspect/refusal.h"
#include "report/graph.h"

namespace fastcycle::inspect {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kLookNs = 20 * kMs;
constexpr std::int64_t kReplyNs = 5 * kMs;         // How often replies are polled.
constexpr std::int64_t kComplaintNs = 1000 * kMs;  // At most one line of log in this time.
constexpr std::int64_t kGreetingNs = 5000 * kMs;   // Time a new client has to send its greeting.
constexpr std::int64_t kWatchNs = 500 * kMs;       // How often these limits are checked.
constexpr std::int64_t kBehindNs = 100 * kMs;      // A client may be behind this long in any case.
constexpr std::int64_t kAcceptNs = 100 * kMs;      // Between two attempts while accept() fails.
constexpr std::size_t kMaxGreetingBytes = 4096;
constexpr std::size_t kMaxPlainBytes = std::size_t{64} << 10U;  // If publishing is forbidden.
constexpr std::size_t kMaxLogLines = 1024;
constexpr const char* kName = "inspect";

}  // namespace

std::vector<std::string> allowed_words(const config::InspectDescription& description) {
  std::vector<std::string> words;
  if (description.allows_params) {
    words.emplace_back("params");
  }
  if (description.allows_publish) {
    words.emplace_back("publish");
  }
  if (description.allows_lifecycle) {
    words.emplace_back("lifecycle");
  }
  if (description.allows_reload) {
    words.emplace_back("reload");
  }
  return words;
}

Server::Server(host::Application& application, config::InspectDescription description,
               std::filesystem::path folder, std::chrono::nanoseconds patience)
    : application_(application),
      description_(std::move(description)),
      folder_(std::move(folder)),
      patience_ns_(patience.count()),
      taps_(application) {}

Server::~Server() {
  waiting_.stop();
  if (is_running_) {
    is_stopping_.store(true);
    wake();
    thread_.join();
  }
  clients_.clear();
  for (const int descriptor : joining_) {
    ::close(descriptor);
  }
  for (const int descriptor : {wake_, reserve_}) {
    if (descriptor >= 0) {
      ::close(descriptor);
    }
  }
}

void Server::offer(std::string name, std::function<std::string()> make) {
  const std::lock_guard lock(mutex_);
  documents_[std::move(name)] = std::move(make);
}

std::filesystem::path Server::file() const {
  return socket_ == nullptr ? std::filesystem::path() : socket_->file();
}

std::string Server::name() const {
  return socket_ == nullptr ? application_.description().name : socket_->name();
}

void Server::tap(detail::Topics&) {
  services_ = find_services(application_);
  graph_ = host::to_dot(application_);
  if (description_.allows_publish) {
    voice_ = std::make_unique<Voice>(application_);
    voice_->declare();
  }
}

void Server::open(config::Problems& problems) {
  try {
    wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wake_ < 0) {
      throw std::runtime_error("no event descriptor can be made");
    }
    if (!folder_.empty()) {
      socket_ = std::make_unique<SocketFile>(folder_, application_.description().name);
    }
    reserve_ = ::eventfd(0, EFD_CLOEXEC);
  } catch (const std::exception& error) {
    problems.add(config::make_error(description_.place, error.what()));
    return;
  }
  taps_.provide();
}

void Server::start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) {
  explanation_ = view.application.explanation();
  {
    const std::lock_guard lock(mutex_);
    for (const auto& component : view.application.components()) {
      news_.push_back(host::news_of(*component));
    }
  }
  application_.log_queue().set_listener(this, [this](const detail::LogLine& line) {
    if (!is_log_wanted_.load(std::memory_order_relaxed)) {
      return;
    }
    {
      const std::lock_guard lock(mutex_);
      if (log_.size() == kMaxLogLines) {
        log_.pop_front();
        ++lost_log_;
      }
      log_.push_back({base::to_ns(line.time), line.level, std::string(line.component),
                      std::string(line.text)});
    }
    wake();
  });
  if (voice_ != nullptr) {
    voice_->open();
  }
  if (socket_ != nullptr) {
    application_.log(LogLevel::kInfo, kName,
                     fmt::format("tools may look at this run: {}", socket_->file().string()));
  }
  thread_ =
      base::Thread(base::ThreadOptions{.name = kName, .cpus = {}}, [this] { serve(); }, refusals);
  is_running_ = true;
}

void Server::changed(const host::ComponentNews& news) noexcept {
  const std::lock_guard lock(mutex_);
  if (news.component < news_.size()) {
    news_[news.component] = news;
  }
}

void Server::stop(const host::Application&) {
  if (is_running_) {
    application_.log_queue().set_listener(this, {});
    is_stopping_.store(true);
    wake();
    waiting_.stop();
    thread_.join();
    is_running_ = false;
  }
  clients_.clear();
  taps_.cut();
  if (voice_ != nullptr) {
    voice_->close();
  }
  socket_.reset();
}

void Server::wake() noexcept {
  const std::uint64_t one = 1;
  static_cast<void>(!::write(wake_, &one, sizeof(one)));
}

// ------------------------------------------------------------------------------------ the thread

void Server::serve() {
  base::give_way();
  while (!is_stopping_.load()) {
    wait();
    accept_joining();
    give_made();
    give_log();
    if (voice_ != nullptr) {
      voice_->look();
    }
    if (base::monotonic_ns() >= next_look_ns_ && taps_.is_used()) {
      look();
    }
    forget_gone();
  }
  send_farewell();
}

void Server::wait() {
  std::vector<pollfd> polled;
  polled.push_back({.fd = wake_, .events = POLLIN, .revents = 0});
  const short accepting = may_accept() ? POLLIN : 0;
  polled.push_back(
      {.fd = socket_ == nullptr ? -1 : socket_->descriptor(), .events = accepting, .revents = 0});
  bool is_watching_time = false;
  bool is_busy = false;
  for (const auto& client : clients_) {
    const Connection& connection = *client->connection;
    short events = 0;
    // Requests of a client that does not read its output are not read.
    if (connection.waiting() < Connection::kEnoughWaiting && !is_asking(*client)) {
      events |= POLLIN;
    }
    is_busy |= is_asking(*client);
    if (connection.waiting() > 0) {
      events |= POLLOUT;
    }
    is_watching_time |= connection.waiting() > 0 || !connection.is_greeted;
    polled.push_back({.fd = connection.descriptor(), .events = events, .revents = 0});
  }
  std::int64_t wait_ns = is_watching_time ? std::min(kWatchNs, patience_ns_) : -1;
  if (taps_.is_used()) {
    wait_ns = std::max<std::int64_t>(next_look_ns_ - base::monotonic_ns(), 0);
  }
  if (voice_ != nullptr && voice_->is_waiting()) {
    wait_ns = wait_ns < 0 ? kReplyNs : std::min(wait_ns, kReplyNs);
  }
  if (accepting == 0) {
    const std::int64_t until_ns = std::max<std::int64_t>(next_accept_ns_ - base::monotonic_ns(), 0);
    wait_ns = wait_ns < 0 ? until_ns : std::min(wait_ns, until_ns);
  }
  wait_ns = is_busy ? 0 : wait_ns;
  const int timeout = wait_ns < 0 ? -1 : static_cast<int>((wait_ns + kMs - 1) / kMs);
  if (::poll(polled.data(), polled.size(), timeout) < 0) {
    return;
  }
  if (polled[0].revents != 0) {
    std::uint64_t count = 0;
    static_cast<void>(!::read(wake_, &count, sizeof(count)));
  }
  const std::int64_t now_ns = base::monotonic_ns();
  for (std::size_t i = 0; i + 2 < polled.size(); ++i) {
    Client& client = *clients_[i];
    const short events = polled[i + 2].revents;
    if ((events & POLLIN) != 0) {
      client.is_over = !client.connection->receive();
    } else if ((events & (POLLHUP | POLLERR)) != 0) {
      client.is_over = true;
    }
    serve(client);
    write(client, now_ns);
  }
  bound_requests();
  if (polled[1].revents != 0 && accepting != 0) {
    accept_all();
  }
}

void Server::accept_all() {
  constexpr int kAtOnce = 64;
  for (int i = 0; i < kAtOnce; ++i) {
    const int descriptor =
        ::accept4(socket_->descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (descriptor >= 0) {
      accept_one(descriptor, false);
      continue;
    }
    if (errno == EMFILE || errno == ENFILE) {
      refuse_without_descriptor();
    } else if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
      next_accept_ns_ = base::monotonic_ns() + kAcceptNs;  // Out of memory; retry later.
    }
    return;
  }
}

int Server::connect() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()) != 0) {
    return -1;
  }
  {
    const std::lock_guard lock(mutex_);
    joining_.push_back(ends[0]);
  }
  wake();
  return ends[1];
}

void Server::accept_joining() {
  std::vector<int> joining;
  {
    const std::lock_guard lock(mutex_);
    joining.swap(joining_);
  }
  for (const int descriptor : joining) {
    accept_one(descriptor, true);
  }
}

bool Server::may_accept() const {
  return next_accept_ns_ == 0 || base::monotonic_ns() >= next_accept_ns_;
}

/// Reports the reason to the client, and removes it from the accept queue, where it would keep
/// `poll` from blocking. The next attempt follows only after a while.
void Server::refuse_without_descriptor() {
  if (reserve_ >= 0) {
    ::close(reserve_);
    const int descriptor =
        ::accept4(socket_->descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (descriptor >= 0) {
      refuse(descriptor, protocol::Error::KIND_TOO_MANY,
             "the application has no file descriptor left (ulimit -n)");
    }
  }
  reserve_ = ::eventfd(0, EFD_CLOEXEC);
  next_accept_ns_ = base::monotonic_ns() + kAcceptNs;
}

void Server::accept_one(int descriptor, bool is_within) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0 ||
      peer.uid != ::geteuid()) {
    refuse(descriptor, protocol::Error::KIND_NOT_ALLOWED,
           fmt::format("user {} may not look at an application of user {}", peer.uid, ::geteuid()));
    return;
  }
  forget_gone();
  if (clients_.size() >= kMaxConnections) {
    refuse(descriptor, protocol::Error::KIND_TOO_MANY,
           fmt::format("{} tools look at this application already", clients_.size()));
    return;
  }
  clients_.push_back(std::make_unique<Client>(
      std::make_unique<Connection>(descriptor, ++numbers_, peer.uid, peer.pid)));
  clients_.back()->connection->came_ns = base::monotonic_ns();
  clients_.back()->connection->is_within = is_within;
}

void Server::refuse(int descriptor, protocol::Error::Kind kind, const std::string& text) {
  Connection connection(descriptor, 0, 0, 0);
  connection.put(error_answer(0, {kind, text}));
  static_cast<void>(connection.write(0));
  const std::int64_t now_ns = base::monotonic_ns();
  if (now_ns >= next_complaint_ns_) {
    next_complaint_ns_ = now_ns + kComplaintNs;
    application_.log(LogLevel::kWarning, kName, "a connection was refused: " + text);
  }
}

std::size_t Server::max_frame_of(const Client& client) const {
  if (!client.connection->is_greeted) {
    return kMaxGreetingBytes;
  }
  return description_.allows_publish ? kMaxRequestBytes : kMaxPlainBytes;
}

bool Server::is_asking(const Client& client) const {
  return !client.is_over && client.connection->waiting() < Connection::kEnoughWaiting &&
         client.connection->has_next(max_frame_of(client));
}

void Server::serve(Client& client) {
  constexpr int kAtOnce = 64;  // Then other connections are served.
  for (int i = 0; i < kAtOnce && is_asking(client); ++i) {
    std::string wrong;
    const auto frame = client.connection->next(max_frame_of(client), wrong);
    if (!frame) {
      client.connection->put(error_answer(0, {protocol::Error::KIND_MALFORMED, wrong}));
    }
    if (!frame || !take_frame(client, *frame)) {
      static_cast<void>(client.connection->write(base::monotonic_ns()));
      client.is_over = true;
    }
  }
}

bool Server::take_frame(Client& client, std::string_view frame) {
  protocol::Request request;
  const bool is_right = request.ParseFromArray(frame.data(), static_cast<int>(frame.size()));
  if (!is_right || request.what_case() == protocol::Request::WHAT_NOT_SET || request.id() == 0) {
    client.connection->put(error_answer(
        request.id(), {protocol::Error::KIND_MALFORMED, "this is no request of a FastCycle tool"}));
    return false;
  }
  try {
    answer(client, request);
  } catch (const Refusal& refusal) {
    client.connection->put(error_answer(request.id(), refusal));
    return refusal.goes_on();
  } catch (const std::exception& error) {
    client.connection->put(
        error_answer(request.id(), {protocol::Error::KIND_REFUSED, error.what()}));
  }
  return true;
}

void Server::look() {
  Room all{.left = kMaxWaitingOfAll};
  for (const auto& client : clients_) {
    const std::size_t waiting = client->connection->waiting();
    all.left -= std::min(all.left, waiting);
    const std::size_t enough =
        client->connection->is_within ? Connection::kEnoughWithin : Connection::kEnoughWaiting;
    // A slow reader receives fewer messages, not later ones.
    client->room.left = waiting < enough ? Connection::kMaxWaiting - waiting : 0;
    for (const auto& stream : client->streams) {
      stream->allow(client->room, all);
    }
  }
  taps_.look();
  const std::int64_t now_ns = base::monotonic_ns();
  for (const auto& client : clients_) {
    for (const auto& stream : client->streams) {
      protocol::Answer answer;
      if (stream->collect(answer)) {
        client->connection->put(answer);
      }
    }
    write(*client, now_ns);
  }
  if (all.was_too_small) {
    make_room(now_ns);
  }
  next_look_ns_ =
      now_ns +
      taps_.wait_for_pause(application_.clock().now(), std::chrono::nanoseconds(kLookNs)).count();
}

/// The clients together exceed the limit of queued output: drops the slowest one, so that the
/// others lose nothing more.
void Server::make_room(std::int64_t now_ns) {
  Client* slowest = nullptr;
  for (const auto& client : clients_) {
    const bool is_slower = slowest == nullptr || client->behind_since_ns < slowest->behind_since_ns;
    if (!client->is_over && client->behind_since_ns != 0 && is_slower) {
      slowest = client.get();
    }
  }
  if (slowest != nullptr && now_ns - slowest->behind_since_ns > kBehindNs) {
    drop(*slowest, fmt::format("it reads too slowly, and {} MiB wait for all tools together",
                               kMaxWaitingOfAll >> 20U));
    ++dropped_clients_;
  }
}

void Server::bound_requests() {
  std::size_t total = 0;
  for (const auto& client : clients_) {
    total += client->is_over ? 0 : client->connection->received();
  }
  while (total > kMaxRequestsOfAll) {
    const auto largest = std::ranges::max_element(clients_, {}, [](const auto& client) {
      return client->is_over ? 0 : client->connection->received();
    });
    total -= (*largest)->connection->received();
    drop(**largest, "too much came of requests that are not whole");
    ++dropped_clients_;
  }
}

void Server::give_log() {
  std::deque<LogLine> lines;
  std::uint64_t lost = 0;
  {
    const std::lock_guard lock(mutex_);
    lines.swap(log_);
    lost = std::exchange(lost_log_, 0);
  }
  if (lines.empty() && lost == 0) {
    return;
  }
  for (const auto& client : clients_) {
    for (Client::LogStream& stream : client->log_streams) {
      const bool has_room = client->connection->waiting() < Connection::kEnoughWaiting;
      protocol::Answer answer;
      answer.set_id(stream.id);
      stream.lost += lost;
      for (const LogLine& line : lines) {
        if (line.level < stream.level ||
            (!stream.component.empty() && line.component != stream.component)) {
          continue;
        }
        if (!has_room) {
          ++stream.lost;
          continue;
        }
        protocol::LogLine& said = *answer.mutable_log()->add_lines();
        said.set_time_ns(line.time_ns);
        said.set_level(detail::to_word(line.level));
        said.set_component(line.component);
        said.set_text(to_utf8(line.text));
      }
      if (has_room && (answer.has_log() || stream.lost > 0)) {
        answer.mutable_log()->set_lost(std::exchange(stream.lost, 0));
        client->connection->put(answer);
      }
    }
  }
}

void Server::give_made() {
  std::vector<Made> made;
  {
    const std::lock_guard lock(mutex_);
    made.swap(made_);
  }
  for (const Made& one : made) {
    give(one.connection, one.answer);
  }
}

void Server::give(std::uint64_t connection, const protocol::Answer& answer) {
  const auto found = std::ranges::find_if(
      clients_, [&](const auto& client) { return client->connection->number == connection; });
  if (found != clients_.end()) {
    (*found)->connection->put(answer);
  }
}

void Server::give_later(std::uint64_t connection, protocol::Answer answer) {
  {
    const std::lock_guard lock(mutex_);
    made_.push_back({connection, std::move(answer)});
  }
  wake();
}

void Server::write(Client& client, std::int64_t now_ns) {
  Connection& connection = *client.connection;
  const bool is_there = connection.write(now_ns);
  if (connection.waiting() < Connection::kEnoughWaiting) {
    client.behind_since_ns = 0;
  } else if (client.behind_since_ns == 0) {
    client.behind_since_ns = now_ns;
  }
  if (!is_there) {
    client.is_over = true;
  } else if (connection.is_within) {
    // It is slow only if the machine is; its queue is bounded all the same.
  } else if (connection.waiting() > 2 * Connection::kMaxWaiting ||
             (connection.stuck_since_ns() != 0 &&
              now_ns - connection.stuck_since_ns() > patience_ns_)) {
    drop(client, "it does not read");
    ++dropped_clients_;
  } else if (!connection.is_greeted && now_ns - connection.came_ns > kGreetingNs) {
    drop(client, "it says nothing");
  }
}

void Server::drop(Client& client, const std::string& why) {
  if (client.is_over) {
    return;
  }
  client.is_over = true;
  const std::int64_t now_ns = base::monotonic_ns();
  if (now_ns >= next_complaint_ns_) {
    next_complaint_ns_ = now_ns + kComplaintNs;
    application_.log(
        LogLevel::kWarning, kName,
        fmt::format("the connection of process {}{}{} was ended: {}", client.connection->pid,
                    client.connection->client.empty() ? "" : " ", client.connection->client, why));
  }
}

void Server::forget_gone() {
  std::erase_if(clients_, [](const auto& client) { return client->is_over; });
  is_log_wanted_.store(std::ranges::any_of(
      clients_, [](const auto& client) { return !client->log_streams.empty(); }));
}

void Server::send_farewell() {
  constexpr std::int64_t kFarewellNs = 200 * kMs;
  give_log();
  for (const auto& client : clients_) {
    const auto send_end = [&](std::uint32_t id) {
      protocol::Answer answer;
      answer.set_id(id);
      answer.mutable_ended()->set_why("the application stops");
      client->connection->put(answer);
    };
    for (const auto& stream : client->streams) {
      send_end(stream->id);
    }
    for (const Client::LogStream& stream : client->log_streams) {
      send_end(stream.id);
    }
  }
  const std::int64_t end_ns = base::monotonic_ns() + kFarewellNs;
  const auto is_waiting = [](const auto& client) {
    return !client->is_over && client->connection->waiting() > 0;
  };
  for (;;) {
    for (const auto& client : clients_) {
      client->is_over = client->is_over || !client->connection->write(1);
    }
    if (std::ranges::none_of(clients_, is_waiting) || base::monotonic_ns() > end_ns) {
      return;
    }
    ::poll(nullptr, 0, 1);
  }
}

}  // namespace fastcycle::inspect
