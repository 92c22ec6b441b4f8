#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "broker/lane.h"
#include "broker/pool.h"
#include "broker/publishing_component.h"

namespace fastcycle::detail {

class Inbox;
class Topic;

/// One lane that a publisher fills.
struct Target {
  std::shared_ptr<Lane> lane;
  Inbox* inbox;
  std::uint64_t bit;
};

/// The shares of a publisher's messages: owns how many its subscriptions need, and finds
/// subscriptions that keep more than their share, which receive no further message until they
/// release one ([decision
/// 0034](../../docs/decisions/0034-a-hoarding-component-uses-up-its-own-share.md)).
///
/// @threads  As the publisher.
/// @realtime `must_look` reads two flags; the rest is called only if a share may be exceeded.
class PoolShares {
 public:
  /// `keep` and `latched` messages are held on purpose; the pool may have `pool_max`, 0 for twice
  /// what the subscriptions need, plus 64.
  PoolShares(const Topic& topic, const PublishingComponent& owner, std::size_t keep,
             std::size_t latched, std::size_t pool_max) noexcept;

  void join(const Lane& lane) noexcept;
  void leave(const Lane& lane) noexcept;
  /// Another process may hold `capacity` messages.
  void join_export(std::size_t capacity) noexcept { needed_ += capacity; }
  /// How many messages the subscriptions, the exports and the owner may hold.
  [[nodiscard]] std::size_t needed() const noexcept { return needed_; }
  /// How many messages the pool may have.
  [[nodiscard]] std::size_t limit() const noexcept;

  /// More messages were needed than all may hold: shares are checked from now on.
  void note_shortage() noexcept { is_short_ = true; }
  /// Whether a share of `pool` may be exceeded, so that `find_held_back` is to be called.
  [[nodiscard]] bool must_look(const Pool& pool) const noexcept {
    return is_short_ || pool.is_overdrawn();
  }
  /// Marks the lanes that receive no further message; returns how many these are.
  std::size_t find_held_back(std::span<const Target> targets, const Pool& pool) const noexcept;
  /// Counts a message that `lane` does not receive, and reports the component that keeps too many.
  void hold_back(Lane& lane, const Pool& pool) const noexcept;
  /// The pool is empty, and the owner holds `loans`: reports the holder of most messages.
  void report_shortage(std::span<const Target> targets, const Pool& pool,
                       std::size_t loans) noexcept;

 private:
  [[nodiscard]] std::size_t share_of(const Lane& lane) const noexcept;
  [[nodiscard]] bool keeps_too_much(const Lane& lane, const Pool& pool) const noexcept;

  const Topic& topic_;
  const PublishingComponent& owner_;
  const std::size_t keep_;
  const std::size_t pool_max_;
  std::size_t needed_;           ///< By the present subscriptions, and by the owner.
  std::size_t lanes_ = 0;        ///< Those that joined.
  bool is_short_ = false;        ///< More messages were needed than all may hold.
  std::uint64_t dry_count_ = 0;  ///< How often the pool was empty.
};

}  // namespace fastcycle::detail
