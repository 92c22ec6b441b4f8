#include "inspect/client.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "inspect/address.h"
#include "inspect/frame.h"
#include "inspect/socket_file.h"

namespace fastcycle::inspect {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

ClientError failure(std::string text, std::string hint = {},
                    protocol::Error::Kind kind = protocol::Error::KIND_UNKNOWN) {
  protocol::Error error;
  error.set_kind(kind);
  error.set_text(std::move(text));
  error.set_hint(std::move(hint));
  return ClientError(std::move(error));
}

int connect_to(const std::filesystem::path& file) {
  sockaddr_un address{};
  try {
    address = address_of(file);
  } catch (const std::runtime_error& error) {
    throw failure(error.what());
  }
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0 ||
      ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    const std::string why = std::strerror(errno);
    if (descriptor >= 0) {
      ::close(descriptor);
    }
    throw failure(fmt::format("no application answers at {}: {}", file.string(), why),
                  "fastcycle list shows those that run with --inspect");
  }
  return descriptor;
}

int to_poll(milliseconds patience) {
  return static_cast<int>(std::clamp<std::int64_t>(patience.count(), 0, 3'600'000));
}

milliseconds until(Clock::time_point end) {
  return std::max(milliseconds(0), std::chrono::ceil<milliseconds>(end - Clock::now()));
}

}  // namespace

std::vector<RunningApplication> list_applications() {
  std::vector<RunningApplication> running;
  for (FoundSocket& found : find_sockets(socket_folder())) {
    running.push_back({std::move(found.name), found.pid, std::move(found.file)});
  }
  return running;
}

RunningApplication find_application(std::string_view name) {
  const std::filesystem::path folder = socket_folder();
  if (const std::string wrong = find_wrong(folder); !wrong.empty()) {
    throw failure(wrong);
  }
  std::vector<RunningApplication> running = list_applications();
  if (running.empty()) {
    throw failure("no application runs that may be looked at",
                  "start one with: fastcycle run app.json --inspect",
                  protocol::Error::KIND_NOT_FOUND);
  }
  std::string names;
  for (const RunningApplication& application : running) {
    names += (names.empty() ? "" : ", ") + application.name;
  }
  if (name.empty()) {
    if (running.size() == 1) {
      return running.front();
    }
    throw failure(fmt::format("{} applications run: {}", running.size(), names),
                  "say which one is meant: --app " + running.front().name,
                  protocol::Error::KIND_NOT_FOUND);
  }
  const auto found = std::ranges::find(running, name, &RunningApplication::name);
  if (found == running.end()) {
    throw failure(fmt::format("no application \"{}\" runs that may be looked at", name),
                  "there is: " + names, protocol::Error::KIND_NOT_FOUND);
  }
  return *found;
}

Client::Client(const std::filesystem::path& socket, std::string_view who, milliseconds patience)
    : Client(connect_to(socket), who, patience) {}

Client::Client(int descriptor, std::string_view who, milliseconds patience) : socket_(descriptor) {
  try {
    greet(who, patience);
  } catch (...) {
    ::close(socket_);
    throw;
  }
}

void Client::greet(std::string_view who, milliseconds patience) {
  protocol::Request request;
  request.mutable_hello()->set_version(kProtocolVersion);
  request.mutable_hello()->set_client(std::string(who));
  protocol::Answer answer = ask(std::move(request), patience);
  if (!answer.has_welcome()) {
    throw failure("what listens there is no FastCycle application");
  }
  welcome_ = std::move(*answer.mutable_welcome());
}

Client::~Client() {
  ::close(socket_);
}

std::uint32_t Client::send(protocol::Request& request) {
  request.set_id(++ids_);
  const std::size_t size = request.ByteSizeLong();
  if (size > kMaxRequestBytes) {
    throw failure(
        fmt::format("a request of {} bytes is too large: {} may be sent", size, kMaxRequestBytes));
  }
  std::string bytes;
  bytes.reserve(kFrameHead + size);
  append_size(bytes, size);
  request.AppendToString(&bytes);
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count =
        ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno == EAGAIN) {
      // The server reads no more while too much output waits for us.
      pollfd poll_socket{.fd = socket_, .events = POLLIN | POLLOUT, .revents = 0};
      ::poll(&poll_socket, 1, -1);
      if ((poll_socket.revents & POLLIN) != 0) {
        receive();
      }
      continue;
    }
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      // Its last answer holds the reason why it closed the connection.
      while (const auto last = read(milliseconds(0))) {
        if (last->has_error()) {
          throw ClientError(last->error());
        }
      }
      throw failure(std::string("the application has ended the connection: ") +
                    std::strerror(errno));
    }
    sent += static_cast<std::size_t>(count);
  }
  return request.id();
}

std::optional<protocol::Answer> Client::read(milliseconds patience) {
  const auto end = Clock::now() + patience;
  for (;;) {
    const std::string_view rest = std::string_view(buffer_).substr(begin_);
    if (rest.size() >= kFrameHead) {
      const std::size_t size = read_size(rest);
      if (size > kMaxAnswerBytes) {
        throw failure("the application says what is no answer");
      }
      if (rest.size() >= kFrameHead + size) {
        protocol::Answer answer;
        const bool is_right =
            answer.ParseFromArray(rest.data() + kFrameHead, static_cast<int>(size));
        begin_ += kFrameHead + size;
        if (begin_ == buffer_.size()) {
          buffer_.clear();
          begin_ = 0;
        }
        if (!is_right) {
          throw failure("the application says what is no answer");
        }
        return answer;
      }
    }
    pollfd poll_socket{.fd = socket_, .events = POLLIN, .revents = 0};
    const int ready = ::poll(&poll_socket, 1, to_poll(until(end)));
    if (ready < 0 && errno == EINTR) {
      return std::nullopt;  // The caller handles the signal.
    }
    if (ready <= 0) {
      return std::nullopt;
    }
    receive();
  }
}

bool Client::receive() {
  constexpr std::size_t kPiece = std::size_t{256} << 10U;
  buffer_.erase(0, std::exchange(begin_, 0));
  const std::size_t before = buffer_.size();
  buffer_.resize(before + kPiece);
  const ssize_t count = ::recv(socket_, buffer_.data() + before, kPiece, MSG_DONTWAIT);
  const int error = errno;
  buffer_.resize(before + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  if (count == 0 || (count < 0 && error != EAGAIN && error != EINTR)) {
    throw failure("the application has ended the connection");
  }
  return count > 0;
}

protocol::Answer Client::await(std::uint32_t id, milliseconds patience) {
  const auto end = Clock::now() + patience;
  for (;;) {
    auto answer = read(until(end));
    if (answer && (answer->id() == id || answer->id() == 0)) {
      if (answer->has_error()) {
        throw ClientError(answer->error());
      }
      if (answer->id() == id) {
        return std::move(*answer);
      }
    } else if (answer) {
      streamed_.push_back(std::move(*answer));
    } else if (Clock::now() >= end) {
      throw failure(fmt::format("the application has not answered for {} ms", patience.count()), {},
                    protocol::Error::KIND_LATE);
    }
  }
}

protocol::Answer Client::ask(protocol::Request request, milliseconds patience) {
  return await(send(request), patience);
}

protocol::Answer Client::begin(protocol::Request request, milliseconds patience) {
  return await(send(request), patience);
}

std::optional<protocol::Answer> Client::next(milliseconds patience) {
  std::optional<protocol::Answer> answer;
  if (!streamed_.empty()) {
    answer = std::move(streamed_.front());
    streamed_.pop_front();
  } else {
    answer = read(patience);
  }
  if (answer && answer->has_error()) {
    throw ClientError(answer->error());
  }
  return answer;
}

std::optional<protocol::Answer> Client::take(milliseconds patience) {
  if (streamed_.empty()) {
    return read(patience);
  }
  protocol::Answer answer = std::move(streamed_.front());
  streamed_.pop_front();
  return answer;
}

void Client::end(std::uint32_t stream) {
  protocol::Request request;
  request.mutable_end_stream()->set_id(stream);
  static_cast<void>(send(request));
}

}  // namespace fastcycle::inspect
