#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "executor/actor_base.h"
#include "executor/held_origins.h"
#include "executor/set_matcher.h"
#include "executor/subscriptions.h"

namespace fastcycle::detail {

class Synchronizer;

/// A subscription whose messages a synchronizer holds until their partners have arrived.
///
/// Its ledger counts messages passed to the synchronizer's callback as delivered, held ones as
/// queued, and those without partners as dropped.
class SynchronizerInput final : public CallbackSubscription {
 public:
  SynchronizerInput(Topic& its_topic, ActorBase& its_actor, const SubscriberOptions& queue,
                    Synchronizer& its_synchronizer, std::size_t its_place);

  Synchronizer& synchronizer;
  const std::size_t place;  ///< Among the inputs of the synchronizer.

  /// Statistics of partners that this input lacked from another one.
  struct Lack {
    Counter count;
    /// The smallest difference of the times, ns; the largest number before there was one.
    std::atomic<std::int64_t> smallest_ns{std::numeric_limits<std::int64_t>::max()};
  };

  /// A message of it found no partners.
  void note_unmatched(const SetMatcher::Departed& departed) noexcept;

  // Written by the component's worker; by the control thread before and after the run.
  Counter matched;
  std::array<Counter, static_cast<std::size_t>(Unmatched::kCount)> unmatched;
  /// For messages too far in time, and for those that waited: by the other input.
  std::array<Lack, SetMatcher::kMaxTopics> too_far;
  std::array<Lack, SetMatcher::kMaxTopics> waited;
  std::array<Counter, static_cast<std::size_t>(DropReason::kCount)> dropped;

 protected:
  bool add_decided(Ledger& decided) const noexcept override;
};

/// Calls a component with messages of several topics that belong together. Each message that
/// arrives is an activation; in that of the last member of a set the component is called, with the
/// oldest origin of the set.
///
/// @threads  As `Actor`.
class Synchronizer {
 public:
  Synchronizer(ActorBase& actor, HeldOrigins& held, std::size_t topics,
               const SynchronizerOptions& options, EnvelopeSetCallback callback);
  Synchronizer(const Synchronizer&) = delete;
  Synchronizer& operator=(const Synchronizer&) = delete;
  ~Synchronizer();

  /// Adds the next input, in the order of the topics.
  void connect(SynchronizerInput& input) noexcept { inputs_[input.place] = &input; }

  /// A message arrived.
  void take(const SynchronizerInput& input, Envelope& envelope);

  /// Releases all held messages, as dropped for `reason`.
  void drop_held(DropReason reason) noexcept;

  /// Sets the callback of a restarted component. Held messages are kept.
  void set_callback(EnvelopeSetCallback callback) { callback_ = std::move(callback); }

  [[nodiscard]] const SynchronizerInput& input(std::size_t place) const { return *inputs_[place]; }
  [[nodiscard]] std::size_t input_count() const noexcept { return count_; }
  [[nodiscard]] const SynchronizerOptions& options() const noexcept { return options_; }

 private:
  void release_departed(DropReason reason) noexcept;
  void call();
  void take_trails(const Envelope& envelope) noexcept;

  ActorBase& actor_;
  HeldOrigins& held_;
  const std::size_t count_;
  const SynchronizerOptions options_;
  EnvelopeSetCallback callback_;
  SetMatcher matcher_;
  std::array<SynchronizerInput*, SetMatcher::kMaxTopics> inputs_{};
  Origin origin_;              ///< Of the set that was called last.
  std::vector<Trail> trails_;  ///< Of that set, by root; empty if there are no chains.
};

}  // namespace fastcycle::detail
