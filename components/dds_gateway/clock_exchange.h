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

/// The topic of DDS on which gateways ask each other for the time.
inline constexpr const char* kClockTopic = "fastcycle_clocks";
/// Its type.
inline constexpr const char* kRoundTripType = "fastcycle_msgs/msg/RoundTrip";

/// How one clock is compared with another.
enum class ClockSource : std::uint8_t {
  kRoundTrips,  ///< By questions and answers.
  kSystem       ///< The system clocks of both machines are taken as equal: PTP sees to that.
};

/// Another application, as far as its clock is concerned.
struct ClockPeer {
  std::string node;  ///< `/gateway`; it may be no text.
  ClockDifference::Estimate estimate;
  /// By how much the system clocks of both machines differ, less what `estimate` leaves open: 0 if
  /// they may be equal.
  Duration system_apart{};
};

/// Asks all other gateways of the domain for the time, answers theirs, and knows how far their
/// clocks are ahead.
///
/// @threads  Confined to the thread that serves the participant, but for `peers`, which is Safe.
class ClockExchange {
 public:
  static constexpr std::chrono::milliseconds kPeriod{200};  ///< Between two questions.
  static constexpr std::size_t kPeersMax = 64;              ///< Clocks that are known.
  static constexpr std::size_t kAnswersMax = 100;           ///< In a period; more are left out.

  /// Opens its reader and its writer; `user_data` is what they announce. All are borrowed.
  ///
  /// @errors  `EngineError`
  ClockExchange(Participant& participant, const base::Clock& clock, std::string node,
                const std::string& user_data, ClockSource source);

  /// Which clock this one is, for those who get its times: a random number other than 0.
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }
  [[nodiscard]] const Writer& writer() const noexcept { return *writer_; }
  [[nodiscard]] const Reader& reader() const noexcept { return *reader_; }

  /// Asks, if it is time to; returns how long it is until then.
  std::chrono::milliseconds ask();

  /// How far the clock with this number is ahead; none if it did not answer yet.
  [[nodiscard]] std::optional<Duration> ahead(std::uint64_t clock) const;

  /// Those that answered within the last ten seconds.
  [[nodiscard]] std::vector<ClockPeer> peers() const;

 private:
  struct Peer {
    ClockDifference difference;
    std::string node;
    Duration to_system{};
    Time heard{};
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
  std::size_t answers_ = 0;  // Since it asked last.
  mutable std::mutex mutex_;
  std::map<std::uint64_t, Peer> peers_;  // Guarded by it.
};

}  // namespace fastcycle::dds_gateway
