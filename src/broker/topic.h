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

/// What belongs to a topic and not to one of its ends.
struct TopicOptions {
  std::size_t latched = 0;
  bool ages = true;
  std::size_t keep = 0;
  std::size_t pool_max = 0;
  bool multiple_publishers = false;
  bool external = false;                  ///< No component has to publish it.
  std::optional<Duration> lifespan = {};  ///< Older messages are not delivered.
  std::size_t credits = 0;  ///< Messages on their way to a subscriber; 0: what the code says.
};

/// Who is told when a queue is full.
///
/// @threads  Safe.
/// @realtime As `publish` is.
class OverflowWatch {
 public:
  OverflowWatch() = default;
  OverflowWatch(const OverflowWatch&) = delete;
  OverflowWatch& operator=(const OverflowWatch&) = delete;
  virtual ~OverflowWatch() = default;

  /// One message for `subscription` was dropped, since as many waited as may.
  virtual void overflowed(const Subscription& subscription) noexcept = 0;
};

/// Why a publisher had no message for somebody.
struct PoolShortage {
  enum class Kind : std::uint8_t {
    kKept,   ///< A component keeps more samples than its share; only it gets nothing.
    kLoans,  ///< The publisher's component holds loans that it does not publish.
    kSmall,  ///< The pool may not have as many messages as its subscribers may hold.
  };
  Kind kind;
  const Topic& topic;
  std::string_view publisher;  ///< The component.
  std::string_view component;  ///< Who holds the most.
  std::size_t held;            ///< Messages that it keeps, holds as loans, or has not read.
  std::size_t share;           ///< How many may be its own.
  std::size_t limit;           ///< How many the pool may have.
};

/// Who is told when a pool has no message for somebody: at the first message that is dropped for
/// that, at the 10th, the 100th, and so on.
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
  std::size_t root_count = 0;       ///< Of all latency chains: so many trails a message has.
  std::optional<std::size_t> root;  ///< Which of these it is itself, if chains begin here.
  std::vector<ChainRule> ends;      ///< The chains that end here.

  // Constant once observers listen.
  /// A recording runs that does not have its messages: who receives them remembers when they were
  /// published.
  bool is_left_out = false;

  /// Whether its messages count for the origin of what timers publish. A latched message says how
  /// things are; its age is not the age of what follows from it.
  [[nodiscard]] bool ages() const noexcept { return options.ages && options.latched == 0; }

  // Control plane.
  /// Adds a subscription. Those that come after `close_declarations` stand behind the others, by
  /// their components' names: which of two components was first in a round must not show.
  void add(std::unique_ptr<Subscription> subscription);
  /// From now on subscriptions come while the application runs.
  void close_declarations() noexcept { declared_count_ = subscriptions.size(); }
  /// A name for one more subscription among those whose samples are counted; nobody when there are
  /// too many to tell apart.
  [[nodiscard]] Holder next_holder() noexcept {
    return holder_count == kNobody ? kNobody : holder_count++;
  }
  Holder holder_count = 0;
  std::string type;
  std::string type_from;  ///< The component that declared it first.
  std::vector<std::unique_ptr<PublisherCore>> publishers;
  std::vector<std::unique_ptr<Subscription>> subscriptions;

 private:
  std::optional<std::size_t> declared_count_;  ///< Of `subscriptions`, once that is known.
};

}  // namespace fastcycle::detail
