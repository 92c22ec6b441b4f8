#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <fastcycle/fastcycle.h>

namespace rav4 {

/// The requirements on one stream of messages.
struct StreamLimits {
  std::string name;
  double rate_min_hz = 0.0;       ///< Over the last second.
  fastcycle::Duration age_max{};  ///< Of its newest message.
  bool is_essential = false;      ///< Without it the vehicle's position is unknown.
};

/// Counts the messages of one stream.
///
/// @threads  Confined.
/// @realtime No allocation.
class StreamWatch {
 public:
  explicit StreamWatch(StreamLimits limits) : limits_(std::move(limits)) {}

  void on_message(fastcycle::Time taken);

  /// Advances to the next of `kSlots` equal parts of the second over which the rate is measured.
  void next_slot();

  [[nodiscard]] const StreamLimits& limits() const { return limits_; }
  [[nodiscard]] std::int64_t count() const { return count_; }
  /// The timestamp of its newest message; none if it has none.
  [[nodiscard]] const std::optional<fastcycle::Time>& newest() const { return newest_; }
  /// In the last second; none in its first second.
  [[nodiscard]] std::optional<double> rate_hz() const;

  static constexpr std::size_t kSlots = 10;
  static constexpr fastcycle::Duration kSlot = std::chrono::milliseconds(100);

 private:
  StreamLimits limits_;
  std::int64_t count_ = 0;
  std::optional<fastcycle::Time> newest_;
  std::array<std::int64_t, kSlots> counts_{};  // A ring.
  std::size_t slot_ = 0;
  std::size_t full_slots_ = 0;  // Since the first message.
};

enum class Verdict : std::uint8_t { kStarting, kReady, kDegraded, kLost };

/// The uncertainty above which a position is degraded, and above which it is lost; 1 sigma.
struct PositionLimits {
  double degraded_stddev_m = 5.0;
  double lost_stddev_m = 20.0;
};

struct Judgement {
  Verdict verdict = Verdict::kStarting;
  std::string reason;  ///< The first and worst; empty if ready.
};

/// Judges the system by its streams and by the uncertainty of its position.
///
/// - starting: an essential stream, or the position, has not been received yet
/// - lost: an essential stream is late by more than ten times its maximum age, or the position is
///   too uncertain
/// - degraded: a stream is too old, too slow or not received yet, or the position is uncertain
/// - ready: none of these
Judgement judge(const std::vector<StreamWatch>& streams, std::optional<double> position_stddev_m,
                const PositionLimits& limits, fastcycle::Time now);

}  // namespace rav4
