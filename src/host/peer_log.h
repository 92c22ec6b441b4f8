#pragma once

#include <cstddef>
#include <cstdint>

#include "base/log.h"
#include "component/peers.h"

namespace fastcycle::host {

class ApplicationHost;

/// Where an application has several processes: tells the main process the lines that this one
/// writes to its log, and gives there the lines of the others to who wants lines. Each process
/// prints its own.
///
/// Live at most `kMostLines` in each tenth of a second are told; of the others the next one says
/// how many they were. In simulated time all that components wrote in a round are, when it is over.
///
/// @threads  Live, lines come on the thread that prints them; all else as `Peers` says.
class PeerLog {
 public:
  static constexpr std::size_t kMostLines = 50;

  explicit PeerLog(ApplicationHost& application) : application_(application) {}

  /// Once the components are made.
  void begin();
  /// Before the lines of this process are printed no more.
  void end();
  /// In simulated time, before what was told in a round is taken.
  void tell_round();
  void take(const Notice& notice);

 private:
  void tell_live(const detail::LogLine& line);
  void tell(std::uint32_t component, const detail::LogSource::AllKept& kept);

  ApplicationHost& application_;
  bool tells_ = false;

  // On the thread that prints.
  std::int64_t window_end_ns_ = 0;
  std::size_t count_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace fastcycle::host
