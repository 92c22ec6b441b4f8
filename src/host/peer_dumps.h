#pragma once

#include <atomic>
#include <cstdint>
#include <string_view>

#include "component/peers.h"

namespace fastcycle::host {

class ApplicationHost;

/// For an application of several processes: sends requests for a dump of the flight recorder to the
/// main process, which has it. At most `kMost` in each tenth of a second of application time.
///
/// @threads  `ask` is Safe; `take` as documented in `Peers`.
class PeerDumps {
 public:
  static constexpr std::uint32_t kMost = 16;

  explicit PeerDumps(ApplicationHost& application) : application_(application) {}

  /// `component` is the name of one that runs here. False if the request is not passed on.
  bool ask(std::string_view reason, std::string_view component, std::string_view detail) noexcept;
  void take(const Notice& notice);

 private:
  ApplicationHost& application_;
  std::atomic<std::int64_t> window_ = 0;  ///< Index of the tenth of a second.
  std::atomic<std::uint32_t> count_ = 0;  ///< Of requests in it.
};

}  // namespace fastcycle::host
