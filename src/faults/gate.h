#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "broker/lane_gate.h"
#include "broker/publisher_core.h"
#include "config/description.h"
#include "faults/field_path.h"

namespace fastcycle::faults {

/// One fault, and how often it acted.
struct ActiveFault {
  static constexpr std::size_t kMostKept = 1000;

  explicit ActiveFault(const config::FaultDescription& its) : description(its) {}

  const config::FaultDescription& description;
  std::atomic<std::uint64_t> count{0};  ///< Messages that were affected.
  base::PriorityMutex mutex;
  std::vector<std::uint64_t> messages;  ///< The sequences of the first of them.
};

/// What all gates of an application share.
struct GateClock {
  std::uint64_t seed = 0;
  std::atomic<std::int64_t> begin_ns{base::kNever};  ///< Of the timers.
  std::atomic<std::int64_t> end_ns{base::kNever};    ///< No injection from then on.
  std::function<void()> held = [] {};                ///< Called when a message is held for later.
};

/// Applies faults to the messages of one publisher, before its lanes.
///
/// A fault affects the same messages in every run: the draw depends only on the seed, the fault,
/// the publisher and the message's sequence. Each message passes the faults in the order of the
/// file. Held or changed messages are copies: they do not occupy the publisher's pool.
///
/// Messages keep sequence, publish time and origin. Their order in each lane is kept: later
/// messages wait for a delayed one.
///
/// @threads  As `LaneGate`; `put_due` and `next_due_ns` take the mutex.
class Gate final : public detail::LaneGate {
 public:
  /// A fault, and the field that it corrupts, if any.
  struct Part {
    ActiveFault* fault;
    std::optional<FieldPath> field;
  };

  /// All of these outlive all publishes.
  Gate(detail::PublisherCore& publisher, std::vector<Part> parts, const GateClock& clock);
  ~Gate() override;

  void begin(detail::Envelope& message) noexcept override;
  void pass(detail::Envelope& message, detail::Subscription& subscription) noexcept override;
  void end(detail::Envelope& message) noexcept override;

  /// Delivers messages that are due at `now`.
  void put_due(Time now) noexcept;
  /// When the next held message is due; `kNever` if there is none.
  [[nodiscard]] std::int64_t next_due_ns() noexcept;
  /// Drops the held messages, which cannot be delivered any more.
  void give_up() noexcept;

 private:
  struct Held {
    Time due;
    detail::Subscription* to;
    detail::Envelope* envelope;
    unsigned times;
  };
  /// What a fault does to the present message.
  struct Drawn {
    bool is_meant = false;
    bool has_acted = false;
    std::uint64_t bits = 0;
  };

  [[nodiscard]] bool is_meant(const config::FaultDescription& fault, const MessageInfo& info,
                              std::uint64_t bits) const noexcept;
  [[nodiscard]] detail::Envelope* copy(const detail::Envelope& message,
                                       const google::protobuf::Message& content);
  void put(detail::Subscription& to, detail::Envelope* envelope, unsigned times) noexcept;

  detail::PublisherCore& publisher_;
  std::vector<Part> parts_;
  std::vector<Drawn> drawn_;  ///< One for each part.
  const GateClock& clock_;
  detail::Pool* const copies_;
  bool keeps_before_ = false;                  ///< A fault needs the previous message.
  detail::Envelope* before_ = nullptr;         ///< The previous message.
  detail::Envelope* last_unfrozen_ = nullptr;  ///< The last one before a fault freezes.
  std::deque<Held> held_;                      ///< In the order in which they are due.
  std::map<const detail::Subscription*, Time> waits_until_;  ///< The last that is held for each.
};

}  // namespace fastcycle::faults
