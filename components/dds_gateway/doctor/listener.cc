#include "dds_gateway/doctor/listener.h"

#include <array>
#include <cstring>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

namespace fastcycle::dds_gateway {
namespace {

constexpr std::size_t kAnnouncementsMax = 4096;
constexpr std::size_t kPacketBytesMax = 65'536;
constexpr int kLook_ms = 100;     // Maximum delay of the end.
constexpr int kTakenAtOnce = 64;  // Of one socket, before the others are served.

Socket open_domain(std::uint32_t domain, const std::vector<LocalInterface>& interfaces) {
  Socket made(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int yes = 1;
  (void)setsockopt(made.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  (void)setsockopt(made.get(), IPPROTO_IP, IP_PKTINFO, &yes, sizeof yes);
  // Bound to the group itself: takes no unicast packets away from participants.
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(discovery_port(domain));
  inet_pton(AF_INET, kDiscoveryGroup, &place.sin_addr);
  if (bind(made.get(), reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0) {
    return {};
  }
  for (const LocalInterface& interface : interfaces) {
    ip_mreqn membership{};
    membership.imr_multiaddr = place.sin_addr;
    membership.imr_ifindex = interface.index;
    if (interface.is_multicast) {
      (void)setsockopt(made.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership);
    }
  }
  return made;
}

}  // namespace

Listener::Listener(const std::vector<LocalInterface>& interfaces) {
  for (const LocalInterface& interface : interfaces) {
    names_[interface.index] = interface.name;
  }
  for (std::uint32_t domain = 0; domain < kDomains; ++domain) {
    sockets_.push_back(open_domain(domain, interfaces));
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

std::vector<ReceivedAnnouncement> Listener::announcements() const {
  const std::lock_guard lock(mutex_);
  std::vector<ReceivedAnnouncement> all;
  for (const auto& [key, received] : announcements_) {
    all.push_back(received);
  }
  return all;
}

void Listener::run(const std::stop_token& stop) {
  std::vector<pollfd> waiting;
  for (const Socket& socket : sockets_) {
    waiting.push_back({.fd = socket.get(), .events = POLLIN, .revents = 0});
  }
  while (!stop.stop_requested()) {
    if (poll(waiting.data(), waiting.size(), kLook_ms) <= 0) {
      continue;
    }
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      if ((waiting[i].revents & POLLIN) != 0) {
        take(i);
      }
    }
  }
}

void Listener::take(std::size_t socket) {
  static thread_local std::vector<std::byte> packet(kPacketBytesMax);
  for (int i = 0; i < kTakenAtOnce; ++i) {
    sockaddr_in from{};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(in_pktinfo))> control{};
    iovec vector{.iov_base = packet.data(), .iov_len = packet.size()};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof from;
    message.msg_iov = &vector;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = recvmsg(sockets_[socket].get(), &message, 0);
    if (size < 0) {
      return;
    }
    const auto announcement =
        read_announcement(std::span(packet).first(static_cast<std::size_t>(size)));
    if (!announcement) {
      continue;
    }
    ReceivedAnnouncement received{.announcement = *announcement,
                                  .domain = static_cast<std::uint32_t>(socket),
                                  .from = {},
                                  .interface = {}};
    std::array<char, INET_ADDRSTRLEN> text{};
    if (inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size()) != nullptr) {
      received.from = text.data();
    }
    for (const cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr;
         part = CMSG_NXTHDR(&message, const_cast<cmsghdr*>(part))) {
      if (part->cmsg_level == IPPROTO_IP && part->cmsg_type == IP_PKTINFO) {
        in_pktinfo info{};
        std::memcpy(&info, CMSG_DATA(part), sizeof info);
        const auto name = names_.find(info.ipi_ifindex);
        received.interface = name == names_.end() ? "" : name->second;
      }
    }
    const std::lock_guard lock(mutex_);
    const std::pair key(received.domain, received.announcement.participant);
    if (announcements_.size() < kAnnouncementsMax || announcements_.contains(key)) {
      announcements_[key] = std::move(received);
    }
  }
}

}  // namespace fastcycle::dds_gateway
