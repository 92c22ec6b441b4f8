#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "broker/chain_end.h"
#include "broker/publisher_core.h"
#include "broker/subscription.h"

namespace fastcycle::detail {

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

/// A named stream of messages of one type.
class Topic {
 public:
  Topic(std::string name_, TopicOptions options_) : name(std::move(name_)), options(options_) {}

  const std::string name;
  const TopicOptions options;

  OverflowWatch* overflow_watch = nullptr;  ///< Constant once anything is published.

  // Constant once anything is declared.
  std::size_t root_count = 0;       ///< Of all latency chains: so many trails a message has.
  std::optional<std::size_t> root;  ///< Which of these it is itself, if chains begin here.
  std::vector<ChainRule> ends;      ///< The chains that end here.

  /// Whether its messages count for the origin of what timers publish. A latched message says how
  /// things are; its age is not the age of what follows from it.
  [[nodiscard]] bool ages() const noexcept { return options.ages && options.latched == 0; }

  // Control plane.
  std::string type;
  std::string type_from;  ///< The component that declared it first.
  std::vector<std::unique_ptr<PublisherCore>> publishers;
  std::vector<std::unique_ptr<Subscription>> subscriptions;
};

/// One mistake in how the components of an application fit together.
struct TopicConflict {
  enum class Kind { kTwoTypes, kTwoPublishers, kNoPublisher };
  Kind kind;
  std::string topic;
  std::string component;        ///< Whose declaration does not fit.
  std::string other = {};       ///< With whose it does not.
  std::string type = {};        ///< Of two types: that of `component`,
  std::string other_type = {};  ///< and that of `other`.
};

/// The registry of topics: used when topics are declared and connected, never while messages move.
///
/// @threads  Confined to the control thread until the application runs; then whoever changes it
///           must exclude others.
class Topics {
 public:
  /// Sets what the application file says of `name`; before anything is declared.
  void set_options(const std::string& name, const TopicOptions& options);

  /// What holds for `name` if the file says nothing of it; before anything is declared.
  void set_default_options(const std::string& name, const TopicOptions& options) {
    default_options_[name] = options;
  }

  /// Says where latency chains begin, and those that end at each topic; before anything is
  /// declared.
  void set_chains(std::vector<std::string> roots,
                  std::map<std::string, std::vector<ChainRule>> ends);

  /// From now on `watch` is told of each overflow; before anything runs.
  void set_overflow_watch(OverflowWatch& watch) noexcept;

  PublisherCore& add_publisher(const std::string& name, PublishingComponent& owner,
                               const google::protobuf::Message& default_instance,
                               const google::protobuf::Message* prototype, bool is_external);
  /// The topic `name`, made if it is new; a second type is a conflict.
  Topic& get(const std::string& name, const std::string& component,
             const google::protobuf::Message& default_instance);

  /// Connects every publisher with every subscription, and finds what does not fit.
  void connect_all();

  /// The lane from `publisher` to `subscription`, not known to the two ends yet.
  static std::shared_ptr<Lane> make_lane(const PublisherCore& publisher,
                                         Subscription& subscription);

  /// Connects the two; before anything runs.
  static void connect(PublisherCore& publisher, Subscription& subscription);

  [[nodiscard]] std::vector<TopicConflict> conflicts() const;

  [[nodiscard]] const std::map<std::string, std::unique_ptr<Topic>>& all() const noexcept {
    return topics_;
  }
  [[nodiscard]] Topic* find(const std::string& name) const;

 private:
  void add_chains(Topic& topic) const;

  std::map<std::string, std::unique_ptr<Topic>> topics_;
  std::vector<std::string> roots_;
  std::map<std::string, std::vector<ChainRule>> ends_;
  std::map<std::string, TopicOptions> default_options_;
  std::vector<TopicConflict> type_conflicts_;
  OverflowWatch* overflow_watch_ = nullptr;
};

/// The identity of the publisher of `component` on `topic`: FNV-1a over both names, 64 bits.
/// http://www.isthe.com/chongo/tech/comp/fnv/
[[nodiscard]] PublisherId publisher_id(std::string_view component, std::string_view topic) noexcept;

}  // namespace fastcycle::detail
