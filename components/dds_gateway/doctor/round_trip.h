#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <sys/types.h>

#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// Results of messages to another process of this machine and back.
struct RoundTripResult {
  std::chrono::milliseconds found_after{-1};  ///< From the start of the other process; negative: it
                                              ///< was never found.
  std::vector<std::chrono::nanoseconds> small = {};  ///< 64 bytes, there and back; sorted.
  std::vector<std::chrono::nanoseconds> large = {};  ///< 1 MiB.
  std::size_t lost = 0;                              ///< Messages that did not return in time.
};

/// Sends messages to another process of this machine, which sends them back.
///
/// @threads  Confined to the thread that serves the participant.
class RoundTrip {
 public:
  static constexpr std::size_t kRounds = 20;  ///< Of each size.
  static constexpr std::size_t kSmallBytes = 64;
  static constexpr std::size_t kLargeBytes = 1 << 20;

  /// Creates its reader and writer, and starts `program` with `args` followed by the names of the
  /// two topics. That program calls `echo`.
  ///
  /// @errors  `EngineError`
  RoundTrip(Participant& participant, const std::string& program, std::vector<std::string> args);
  RoundTrip(const RoundTrip&) = delete;
  RoundTrip& operator=(const RoundTrip&) = delete;
  /// Ends the other process.
  ~RoundTrip();

  /// Sends the next message if the last one has returned or timed out. Called between two calls of
  /// `Participant::serve`.
  void step();
  [[nodiscard]] bool is_done() const;
  /// Results so far.
  [[nodiscard]] RoundTripResult result() const;

  /// The body of the other process: sends messages from `from` back on `to`, until the end of
  /// standard input.
  static void echo(Participant& participant, const std::string& from, const std::string& to);

 private:
  using Clock = std::chrono::steady_clock;

  void take(std::span<const std::byte> message);
  void send();

  const Clock::time_point begin_ = Clock::now();
  std::unique_ptr<Writer> writer_;
  std::unique_ptr<Reader> reader_;
  RoundTripResult result_;
  std::uint64_t number_ = 0;  // Of the pending message; 0: none.
  std::uint64_t last_ = 0;
  Clock::time_point sent_;
  pid_t process_ = -1;
  int input_ = -1;
};

}  // namespace fastcycle::dds_gateway
