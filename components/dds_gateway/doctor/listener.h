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

/// A received multicast announcement.
struct ReceivedAnnouncement {
  Announcement announcement;
  std::uint32_t domain = 0;
  std::string from;       ///< The IPv4 address of its sender.
  std::string interface;  ///< The receiving interface.
};

/// Receives announcements of participants in any domain, whether or not a DDS would discover them,
/// on a thread of its own. It sends nothing.
///
/// @threads  Safe.
class Listener {
 public:
  /// Listens on those of `interfaces` that support multicast.
  explicit Listener(const std::vector<LocalInterface>& interfaces);
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  ~Listener() = default;

  /// The newest announcement of each participant so far, at most 4096.
  [[nodiscard]] std::vector<ReceivedAnnouncement> announcements() const;

 private:
  void run(const std::stop_token& stop);
  void take(std::size_t socket);

  std::vector<Socket> sockets_;  // By domain number.
  std::map<int, std::string> names_;
  mutable std::mutex mutex_;
  std::map<std::pair<std::uint32_t, Guid>, ReceivedAnnouncement> announcements_;  // Guarded by it.
  std::jthread thread_;
};

}  // namespace fastcycle::dds_gateway
