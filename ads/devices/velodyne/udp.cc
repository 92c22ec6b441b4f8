#include "udp.h"

#include <cerrno>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace ads::velodyne {
namespace {

// A burst of an HDL-64E while the thread waits for a core: 3472 packets a second, 1206 bytes each.
constexpr int kReceiveBytes = 1 << 20;
// The number of datagrams read in a row, before the thread checks whether it has to end.
constexpr int kBurst = 64;

}  // namespace

std::uint32_t ipv4_of(const std::string& text) {
  in_addr address{};
  if (::inet_pton(AF_INET, text.c_str(), &address) != 1) {
    throw std::runtime_error(fmt::format("expected an IPv4 address, found \"{}\"", text));
  }
  return address.s_addr;
}

UdpDevice::UdpDevice(const std::string& address, std::uint16_t port, const std::string& sender,
                     Sink sink)
    : address_text_(address),
      address_(ipv4_of(address)),
      port_(port),
      sender_(sender.empty() ? std::nullopt : std::optional(ipv4_of(sender))),
      sink_(std::move(sink)) {}

std::string UdpDevice::name() const {
  return fmt::format("UDP {}:{}", address_text_, port_);
}

int UdpDevice::open() {
  socket_ =
      checked_descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), name());
  // Less than asked for will do: it is bounded by net.core.rmem_max.
  (void)::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &kReceiveBytes, sizeof kReceiveBytes);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(port_);
  at.sin_addr.s_addr = address_;
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) < 0) {
    throw_errno(name());
  }
  return socket_.get();
}

bool UdpDevice::read() {
  bool is_usable = false;
  for (int count = 0; count < kBurst; ++count) {
    sockaddr_in from{};
    socklen_t from_bytes = sizeof from;
    const auto size = ::recvfrom(socket_.get(), buffer_.data(), buffer_.size(), 0,
                                 reinterpret_cast<sockaddr*>(&from), &from_bytes);
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) {
        break;
      }
      throw_errno(name());
    }
    if (!sender_ || from.sin_addr.s_addr == *sender_) {
      is_usable = sink_(std::span(buffer_).first(static_cast<std::size_t>(size))) || is_usable;
    }
  }
  return is_usable;
}

}  // namespace ads::velodyne
