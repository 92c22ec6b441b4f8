#pragma once

#include <cstddef>
#include <cstdint>

#include "base/log.h"
#include "component/peers.h"

namespace fastcycle::host {

class ApplicationHost;

/// For an application of several processes: sends the log lines of this one to the main process,
/// which passes them to its listeners. Each process prints its own.
///
/// Live at most `kMostLines` in each tenth of a second are sent; the next one has the number of
/// dropped ones. In simulated time all lines of components in a round are sent, at its end.
///
/// @threads  Live, lines arrive on the printing thread; all else as documented in `Peers`.
class PeerLog {
 public:
  static constexpr std::size_t kMostLines = 50;

  explicit PeerLog(ApplicationHost& application) : application_(application) {}

  /// Once the components are constructed.
  void begin();
  /// Before the lines of this process are printed no more.
  void end();
  /// In simulated time, before the notices of a round are handled.
  void send_round();
  void take(const Notice& notice);

 private:
  void send_live(const detail::LogLine& line);
  void send(std::uint32_t component, const detail::LogSource::AllKept& kept);

  ApplicationHost& application_;
  bool is_sending_ = false;

  // On the thread that prints.
  std::int64_t window_end_ns_ = 0;
  std::size_t count_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace fastcycle::host
