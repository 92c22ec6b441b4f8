#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "dds_gateway/clock_difference.h"
#include "dds_gateway/engine.h"

namespace fastcycle::dds_gateway {

/// The DDS topic on which gateways compare their clocks.
inline constexpr const char* kClockTopic = "fastcycle_clocks";
/// Its type.
inline constexpr const char* kRoundTripType = "fastcycle_msgs/msg/RoundTrip";

/// How clocks are compared.
enum class ClockSource : std::uint8_t {
  kRoundTrips,  ///< By round trips.
  kSystem       ///< Both system clocks are assumed equal, synchronized by PTP.
};

/// The clock of another application.
struct ClockPeer {
  std::string node;  ///< `/gateway`; may be invalid text.
  ClockDifference::Estimate estimate;
  /// Difference of both machines' system clocks, less the uncertainty of `estimate`: 0 if they may
  /// be equal.
  Duration system_apart{};
};

/// Requests the time from all other gateways of the domain, answers their requests, and estimates
/// the offsets of their clocks.
///
/// @threads  Confined to the thread that serves the participant, but for `peers`, which is Safe.
class ClockExchange {
 public:
  static constexpr std::chrono::milliseconds kPeriod{200};  ///< Between two requests.
  static constexpr std::size_t kPeersMax = 64;              ///< Maximum number of clocks.
  static constexpr std::size_t kAnswersMax = 100;           ///< Per period; others are ignored.

  /// Creates its reader and its writer with `user_data`. All arguments are borrowed.
  ///
  /// @errors  `EngineError`
  ClockExchange(Participant& participant, const base::Clock& clock, std::string node,
                const std::string& user_data, ClockSource source);

  /// Identifies this clock for receivers of its times: a random number other than 0.
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  [[nodiscard]] const Writer& writer() const noexcept { return *writer_; }
  [[nodiscard]] const Reader& reader() const noexcept { return *reader_; }

  /// Sends a request if it is due; returns the time until the next one.
  std::chrono::milliseconds ask();

  /// The offset of the clock with this id; none if it has not answered yet.
  [[nodiscard]] std::optional<Duration> ahead(std::uint64_t clock) const;

  /// Those that answered within the last ten seconds.
  [[nodiscard]] std::vector<ClockPeer> peers() const;

 private:
  struct Peer {
    ClockDifference difference;
    std::string node;
    Duration to_system{};
    Time last_received{};
  };
  struct Message;

  void take(std::span<const std::byte> message, const SampleInfo& info);
  void answer(const Message& question, Time came);
  void learn(const Message& answer, Time back);
  void send(const Message& message);
  [[nodiscard]] Duration to_system() const;
  [[nodiscard]] ClockPeer look_at(const Peer& peer, Time now) const;

  const base::Clock& clock_;
  const std::string node_;
  const ClockSource source_;
  const std::uint64_t id_;
  std::unique_ptr<Writer> writer_;
  std::unique_ptr<Reader> reader_;
  Time asked_{};
  std::size_t answers_ = 0;  // Since the last request.
  mutable std::mutex mutex_;
  std::map<std::uint64_t, Peer> peers_;  // Guarded by it.
};

}  // namespace fastcycle::dds_gateway
