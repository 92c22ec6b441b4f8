#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

/// Why a message found no partners.
enum class Unmatched : std::uint8_t {
  kTooFar,     ///< Every message of another topic is too far from it in time.
  kDepth,      ///< `depth` newer messages of its topic arrived while it waited for another topic.
  kOvertaken,  ///< A newer one of its topic was in a set, or arrived, before it was.
  kLate,       ///< Its time is before that of an earlier one of its topic.
  kNoMessage,  ///< With `kLatest`: another topic had no message yet.
  kCount,
};

/// Decides which messages of 2 to 4 topics belong together, by the rule that `SyncPolicy` states.
/// It only compares times, and does not read envelopes.
///
/// @threads  Compatible.
/// @realtime No allocation. The time of `add` grows with the square of the number of messages held
///           within `max_difference`, usually one or two for each topic.
class SetMatcher {
 public:
  static constexpr std::size_t kMaxTopics = 4;

  /// A message that is returned because it will be in no (further) set.
  struct Departed {
    std::size_t topic;
    Envelope* envelope;
    bool was_used;  ///< It was in a set: `kLatest` only.
    Unmatched why = Unmatched::kOvertaken;
    std::size_t partner = 0;  ///< Of `kTooFar`, `kDepth`, `kNoMessage`: the other topic.
    /// For these: the distance to its nearest message, if known; none if it has none.
    std::optional<Duration> difference = {};
  };

  /// One member of a set.
  struct Member {
    Envelope* envelope = nullptr;
    bool is_new = false;   ///< It was in no set before.
    bool is_held = false;  ///< It may be in further ones, and is returned later.
  };

  SetMatcher(std::size_t topics, const SynchronizerOptions& options);

  /// Takes over a message that arrived; `departed` and `set` have the result until the next call.
  /// Returns whether it completed a set.
  [[nodiscard]] bool add(std::size_t topic, Time time, Envelope* envelope);

  /// Returns all held messages, as `departed`.
  void clear() noexcept;

  [[nodiscard]] const std::vector<Departed>& departed() const noexcept { return departed_; }
  /// One for each topic. @pre `add` returned true.
  [[nodiscard]] const std::array<Member, kMaxTopics>& set() const noexcept { return set_; }

 private:
  struct Held {
    Time time;
    Envelope* envelope;
    bool was_used;
  };
  /// The held messages of one topic, in the order of arrival, which is that of time.
  struct Queue {
    static constexpr std::size_t kRecent = 8;

    std::vector<Held> held;
    std::optional<Time> newest;          ///< Of all that ever came.
    std::array<Time, kRecent> recent{};  ///< The last received ones; the oldest is overwritten.
    std::size_t count = 0;               ///< Of all that ever came.

    void note(Time time) noexcept {
      newest = time;
      recent[count++ % kRecent] = time;
    }
    /// Distance from `time` to the nearest one, among those held and the last received.
    [[nodiscard]] std::optional<Duration> nearest(Time time) const noexcept;

    /// Index of the first held one that is not before `time`.
    [[nodiscard]] std::size_t first_from(Time time) const noexcept;
  };
  using Places = std::array<std::size_t, kMaxTopics>;

  bool add_to_latest(std::size_t topic, Time time, Envelope* envelope);
  [[nodiscard]] bool find_best(std::size_t topic, Time time, Places& best) const noexcept;
  [[nodiscard]] std::optional<Duration> span_from(std::size_t topic, Time time, Time first,
                                                  Places& places) const noexcept;
  void take(std::size_t topic, Envelope* envelope, const Places& places);
  [[nodiscard]] bool is_hopeless(std::size_t topic, Time time) const noexcept;
  [[nodiscard]] bool may_fill(std::size_t topic, Time first) const noexcept;
  template <typename Try>
  [[nodiscard]] bool any_begin(std::size_t topic, Time time, const Try& try_begin) const noexcept;
  void drop_hopeless() noexcept;
  void depart(std::size_t topic, std::size_t count) noexcept;
  void depart_without(std::size_t topic, const Held& held, Unmatched why) noexcept;

  // Constant after construction.
  const std::size_t topics_;
  const SyncPolicy policy_;
  const Duration max_difference_;
  const std::size_t depth_;

  std::array<Queue, kMaxTopics> queues_;
  std::vector<Departed> departed_;  ///< Has room for all.
  std::array<Member, kMaxTopics> set_;
};

}  // namespace fastcycle::detail
