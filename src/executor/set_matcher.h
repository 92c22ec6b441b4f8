#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {

/// Decides which messages of 2 to 4 topics belong together, by the rule that `SyncPolicy` states.
/// It only compares times: envelopes are handed through unread.
///
/// @threads  Compatible.
/// @realtime No allocation. `add` grows with the square of the number of messages held within
///           `max_difference`; where each topic holds one or two, that is nothing.
class SetMatcher {
 public:
  static constexpr std::size_t kMaxTopics = 4;

  /// A message that is given back, since it will never be in a set, or in no further one.
  struct Departed {
    std::size_t topic;
    Envelope* envelope;
    bool was_used;  ///< It was in a set: `kLatest` only.
  };

  /// One member of a set.
  struct Member {
    Envelope* envelope = nullptr;
    bool is_new = false;   ///< It was in no set before.
    bool is_held = false;  ///< It may be in further ones, and is given back later.
  };

  SetMatcher(std::size_t topics, const SynchronizerOptions& options);

  /// Takes over a message that arrived; what became of it, and of those that were held, is shown by
  /// `departed` and `set` until the next call. Returns whether it completed a set.
  [[nodiscard]] bool add(std::size_t topic, Time time, Envelope* envelope);

  /// Gives back all that is held, as `departed`.
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
  /// What arrived on one topic, in its order; as such also in the order of time.
  struct Queue {
    std::vector<Held> held;
    std::optional<Time> newest;  ///< Of all that ever came.

    /// The place of the first that is held and not before `time`.
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
