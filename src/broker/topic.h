#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "broker/chain_end.h"
#include "fastcycle/detail/envelope.h"
#include "fastcycle/time.h"

namespace fastcycle::detail {

class PublisherCore;
class Subscription;
class Topic;

/// Options of a topic as a whole.
struct TopicOptions {
  std::size_t latched = 0;
  bool ages = true;
  std::size_t keep = 0;
  std::size_t pool_max = 0;
  bool multiple_publishers = false;
  bool external = false;                  ///< It needs no publishing component.
  std::optional<Duration> lifespan = {};  ///< Older messages are not delivered.
  std::size_t credits = 0;                ///< Credit window; 0: that of the code.
};

/// Notified when a queue is full.
///
/// @threads  Safe.
/// @realtime As `publish` is.
class OverflowWatch {
 public:
  OverflowWatch() = default;
  OverflowWatch(const OverflowWatch&) = delete;
  OverflowWatch& operator=(const OverflowWatch&) = delete;
  virtual ~OverflowWatch() = default;

  /// One message for `subscription` was dropped because its queue was full.
  virtual void overflowed(const Subscription& subscription) noexcept = 0;
};

/// Why a pool had no message for a subscriber.
struct PoolShortage {
  enum class Kind : std::uint8_t {
    kKept,   ///< A component keeps more samples than its share; only it receives nothing.
    kLoans,  ///< The publisher's component holds loans that it does not publish.
    kSmall,  ///< The pool may not have as many messages as its subscribers may hold.
  };
  Kind kind;
  const Topic& topic;
  std::string_view publisher;  ///< The component.
  std::string_view component;  ///< The holder of most messages.
  std::size_t held;            ///< Messages that it keeps, holds as loans, or has not read yet.
  std::size_t share;           ///< Its share of the messages.
  std::size_t limit;           ///< How many the pool may have.
};

/// Notified when a pool has no message for a subscriber: at the first message dropped for that, the
/// 10th, the 100th, and so on.
///
/// @threads  Safe.
/// @realtime As `publish` is.
class PoolWatch {
 public:
  PoolWatch() = default;
  PoolWatch(const PoolWatch&) = delete;
  PoolWatch& operator=(const PoolWatch&) = delete;
  virtual ~PoolWatch() = default;

  virtual void ran_short(const PoolShortage& shortage) noexcept = 0;
};

/// A named stream of messages of one type.
class Topic {
 public:
  Topic(std::string its_name, TopicOptions its_options);
  Topic(const Topic&) = delete;
  Topic& operator=(const Topic&) = delete;
  ~Topic();

  const std::string name;
  const TopicOptions options;

  // Constant once anything is published.
  OverflowWatch* overflow_watch = nullptr;
  PoolWatch* pool_watch = nullptr;

  // Constant once anything is declared.
  std::size_t root_count = 0;       ///< Of all latency chains: the number of trails of a message.
  std::optional<std::size_t> root;  ///< Its index among these, if chains begin here.
  std::vector<ChainRule> ends;      ///< The chains that end here.

  // Constant once observers listen.
  /// A running recording omits its messages: receivers record their publish times.
  bool is_left_out = false;

  /// Whether its messages count for the origin of what timers publish. A latched message states a
  /// lasting fact; its age is not the age of what follows from it.
  [[nodiscard]] bool ages() const noexcept { return options.ages && options.latched == 0; }

  // Control plane.
  /// Adds a subscription. Those after `close_declarations` are ordered behind the others, by their
  /// components' names, independent of the order within a round.
  void add(std::unique_ptr<Subscription> subscription);
  /// Later subscriptions are added while the application runs.
  void close_declarations() noexcept { declared_count_ = subscriptions.size(); }
  /// The holder id of one more subscription whose samples are counted; `kNobody` if there are too
  /// many.
  [[nodiscard]] Holder next_holder() noexcept {
    return holder_count == kNobody ? kNobody : holder_count++;
  }
  Holder holder_count = 0;
  std::string type;
  std::string type_from;  ///< The component that declared it first.
  std::vector<std::unique_ptr<PublisherCore>> publishers;
  std::vector<std::unique_ptr<Subscription>> subscriptions;

 private:
  std::optional<std::size_t>
      declared_count_;  ///< Number of `subscriptions` at `close_declarations`.
};

}  // namespace fastcycle::detail
