#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "dds_gateway/doctor/announcement.h"
#include "dds_gateway/doctor/host.h"
#include "dds_gateway/doctor/socket.h"

namespace fastcycle::dds_gateway {

/// An announcement that came to everybody.
struct Heard {
  Announcement announcement;
  std::uint32_t domain = 0;
  std::string from;       ///< The IPv4 address of its sender.
  std::string interface;  ///< On which it came.
};

/// Hears who announces itself in any domain, whether or not a DDS would find it, on a thread of its
/// own. It says nothing itself.
///
/// @threads  Safe.
class Listener {
 public:
  /// On all of `interfaces` that are for multicast.
  explicit Listener(const std::vector<LocalInterface>& interfaces);
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener() = default;

  /// What came until now: the newest announcement of each participant, at most 4096.
  [[nodiscard]] std::vector<Heard> heard() const;

 private:
  void run(const std::stop_token& stop);
  void take(std::size_t socket);

  std::vector<Socket> sockets_;  // Of the domains, by their numbers.
  std::map<int, std::string> names_;
  mutable std::mutex mutex_;
  std::map<std::pair<std::uint32_t, Guid>, Heard> heard_;  // Guarded by it.
  std::jthread thread_;
};

}  // namespace fastcycle::dds_gateway
