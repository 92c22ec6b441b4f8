#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "broker/lane.h"

namespace fastcycle::detail {

/// Why a component was called: the closed list.
enum class Cause : std::uint8_t {
  kMessage,
  kTick,
  kRequest,
  kReply,
  kTimeout,
  kParameter,
  kExternal,
  kJob,
  kEvent,
  kMode,
  kConnect,
  kFault,
};

[[nodiscard]] const char* to_word(Cause cause) noexcept;

/// How an activation ended.
enum class Outcome : std::uint8_t { kRunning, kDone, kFault };

/// One activation: written before the callback, so that a crash shows its cause, and completed
/// after.
struct ActivationRecord {
  std::uint32_t component = 0;  ///< The component's place in the application file.
  Cause cause{};
  Outcome outcome = Outcome::kRunning;
  /// Number of the subscription that received the message, among all of the component; 65535: none,
  /// or a later one.
  std::uint16_t subscription = kNoSubscription;
  static constexpr std::uint16_t kNoSubscription = 0xffff;
  std::uint64_t number = 0;   ///< Of the component, from 1.
  PublisherId publisher = 0;  ///< Of the message that caused it; else 0.
  std::uint64_t key = 0;      ///< The message's sequence, or the timer's number.
  std::uint64_t skipped = 0;  ///< Ticks skipped before this one.
  std::int64_t time_ns = 0;   ///< The activation's time.
  /// The time of its cause, on the application's clock: when the message was published, or the tick
  /// was due; else the activation's time.
  std::int64_t cause_ns = 0;
  std::int64_t begin_ns = 0;        ///< CLOCK_MONOTONIC; of a component never before its last end.
  std::int64_t duration_ns = 0;     ///< By CLOCK_MONOTONIC, when ended.
  std::int64_t published_ns = 0;    ///< Its last message's publish time; 0 if it published nothing.
  std::uint32_t publish_count = 0;  ///< Messages published in it, when ended.
};

/// The last activations of one worker: always on, for crash reports, tracing and logs.
///
/// It may lie in memory that other processes read. Memory that is zero is an empty ring.
///
/// @threads  One writer; `snapshot` by any thread: a record that is overwritten meanwhile is
/// skipped.
/// @realtime No lock, no allocation.
class ActivationRing {
 public:
  static constexpr std::size_t kCapacity = 4096;

  ActivationRing() = default;
  ActivationRing(const ActivationRing&) = delete;
  ActivationRing& operator=(const ActivationRing&) = delete;

  /// Writes `record`; returns its place for `end`.
  std::uint64_t begin(const ActivationRecord& record) noexcept;
  /// Completes the record at `place` with the outcome, duration and publishes of `record`.
  void end(std::uint64_t place, const ActivationRecord& record) noexcept;

  /// Appends to `records` those from position `next` on, up to one that has not ended yet, and
  /// advances `next`. Returns how many were lost because they were overwritten. Regardless of the
  /// ring's content, it appends at most `kCapacity` records.
  std::uint64_t read(std::uint64_t& next, std::vector<ActivationRecord>& records) const;

  /// The records that are complete, oldest first.
  [[nodiscard]] std::vector<ActivationRecord> snapshot() const;

  /// The record at `place`, counted from 0; false if it was overwritten. Also for a signal handler.
  [[nodiscard]] bool read_at(std::uint64_t place, ActivationRecord& record) const noexcept;

  /// All records ever begun.
  [[nodiscard]] std::uint64_t size() const noexcept {
    return next_.load(std::memory_order_acquire);
  }

 private:
  // A record as atomics, so that a reader may look while it is overwritten; `version` is odd while
  // it is being written.
  struct Slot {
    std::atomic<std::uint64_t> version{0};
    std::atomic<std::uint64_t> head{0};  ///< component, subscription, cause, outcome
    std::atomic<std::uint64_t> number{0};
    std::atomic<std::uint64_t> publisher{0};
    std::atomic<std::uint64_t> key{0};
    std::atomic<std::uint64_t> skipped{0};
    std::atomic<std::int64_t> time_ns{0};
    std::atomic<std::int64_t> cause_ns{0};
    std::atomic<std::int64_t> begin_ns{0};
    std::atomic<std::int64_t> duration_ns{0};
    std::atomic<std::int64_t> published_ns{0};
    std::atomic<std::uint64_t> publish_count{0};
  };

  std::array<Slot, kCapacity> slots_;
  std::atomic<std::uint64_t> next_{0};  ///< Released after the record.
};

/// One ring for each worker: of its own, or in memory that others own.
///
/// @threads  Confined to the control thread; constant once the workers work.
class ActivationRings {
 public:
  explicit ActivationRings(unsigned workers = 0) { make(workers); }

  /// Creates rings until there are as many as workers.
  void make(unsigned workers) {
    while (all_.size() < workers) {
      own_.push_back(std::make_unique<ActivationRing>());
      all_.push_back(own_.back().get());
    }
  }
  /// The first workers write into these; nothing was written yet.
  void use(std::span<ActivationRing* const> rings) {
    all_.resize(std::max(all_.size(), rings.size()));
    std::ranges::copy(rings, all_.begin());
  }

  [[nodiscard]] ActivationRing& operator[](std::size_t worker) const { return *all_[worker]; }
  [[nodiscard]] const std::vector<ActivationRing*>& all() const noexcept { return all_; }

 private:
  std::vector<std::unique_ptr<ActivationRing>> own_;
  std::vector<ActivationRing*> all_;
};

}  // namespace fastcycle::detail
