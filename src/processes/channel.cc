#include "processes/channel.h"

#include <array>
#include <cerrno>
#include <utility>

#include <sys/socket.h>
#include <unistd.h>

namespace fastcycle::processes {

Channel::Channel(Channel&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

Channel& Channel::operator=(Channel&& other) noexcept {
  if (this != &other) {
    close();
    socket_ = std::exchange(other.socket_, -1);
  }
  return *this;
}

Channel::~Channel() {
  close();
}

void Channel::close() noexcept {
  if (socket_ >= 0) {
    ::close(std::exchange(socket_, -1));
  }
}

std::optional<std::pair<Channel, Channel>> Channel::make() {
  std::array<int, 2> sockets{};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, sockets.data()) != 0) {
    return std::nullopt;
  }
  return std::pair{Channel(sockets[0]), Channel(sockets[1])};
}

void Channel::send(Word word, std::string_view text) const noexcept {
  std::array<char, 256> message{};
  message[0] = static_cast<char>(word);
  const std::size_t size = text.copy(message.data() + 1, message.size() - 1) + 1;
  // write(), not send(): a sandbox forbids socket calls.
  while (write(socket_, message.data(), size) < 0 && errno == EINTR) {
  }
}

std::optional<Channel::Message> Channel::receive() const {
  std::array<char, 256> message{};
  ssize_t size = 0;
  do {
    size = read(socket_, message.data(), message.size());
  } while (size < 0 && errno == EINTR);
  if (size <= 0) {
    return std::nullopt;
  }
  return Message{.word = static_cast<Word>(message[0]),
                 .text = std::string(message.data() + 1, static_cast<std::size_t>(size) - 1)};
}

}  // namespace fastcycle::processes
