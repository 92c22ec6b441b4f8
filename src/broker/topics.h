#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "broker/chain_end.h"
#include "broker/publisher_core.h"
#include "broker/publisher_names.h"
#include "broker/subscription.h"
#include "broker/topic.h"

namespace fastcycle::detail {

/// One conflict between declarations of components.
struct TopicConflict {
  enum class Kind { kTwoTypes, kTwoPublishers, kNoPublisher };
  Kind kind;
  std::string topic;
  std::string component;        ///< The component whose declaration conflicts.
  std::string other = {};       ///< The one that it conflicts with.
  std::string type = {};        ///< Of two types: that of `component`,
  std::string other_type = {};  ///< and that of `other`.
};

/// The registry of topics: used when topics are declared and connected, never while messages move.
///
/// @threads  Confined to the control thread until the application runs; then changes need external
///           locking.
class Topics {
 public:
  /// Sets the options of `name` from the application file; before anything is declared.
  void set_options(const std::string& name, const TopicOptions& options);

  /// Sets the options of `name` for a file without any; before anything is declared.
  void set_default_options(const std::string& name, const TopicOptions& options) {
    default_options_[name] = options;
  }

  /// Sets the topics where latency chains begin, and the chains that end at each topic; before
  /// anything is declared.
  void set_chains(std::vector<std::string> roots,
                  std::map<std::string, std::vector<ChainRule>> ends);

  /// Notifies `watch` of each overflow; before anything runs.
  void set_overflow_watch(OverflowWatch& watch) noexcept;
  /// Notifies `watch` when a pool runs short; before anything runs.
  void set_pool_watch(PoolWatch& watch) noexcept;

  /// `keep`: how many of its messages components keep on purpose; else the topic's number.
  PublisherCore& add_publisher(const std::string& name, PublishingComponent& owner,
                               const google::protobuf::Message& default_instance,
                               const google::protobuf::Message* prototype, bool is_external,
                               std::optional<std::size_t> keep = {});
  /// The topic `name`, created if it is new; a second type is a conflict.
  Topic& get(const std::string& name, const std::string& component,
             const google::protobuf::Message& default_instance);

  /// Connects every publisher with every subscription, and returns the conflicts.
  void connect_all();

  /// Creates the lane from `publisher` to `subscription`, without adding it to the two ends.
  static std::shared_ptr<Lane> make_lane(const PublisherCore& publisher,
                                         Subscription& subscription);

  /// Connects the two; before anything runs.
  static void connect(PublisherCore& publisher, Subscription& subscription);

  [[nodiscard]] std::vector<TopicConflict> conflicts() const;

  [[nodiscard]] const std::map<std::string, std::unique_ptr<Topic>>& all() const noexcept {
    return topics_;
  }
  [[nodiscard]] Topic* find(const std::string& name) const;

  /// The topics where latency chains begin, in the order of a message's trails; constant once
  /// anything is declared.
  [[nodiscard]] const std::vector<std::string>& roots() const noexcept { return roots_; }

  /// The names of all publishers, past ones and those of other applications included. Safe.
  [[nodiscard]] PublisherNames& names() noexcept { return names_; }
  [[nodiscard]] const PublisherNames& names() const noexcept { return names_; }

 private:
  void add_chains(Topic& topic) const;

  std::map<std::string, std::unique_ptr<Topic>> topics_;
  std::vector<std::string> roots_;
  std::map<std::string, std::vector<ChainRule>> ends_;
  std::map<std::string, TopicOptions> default_options_;
  std::vector<TopicConflict> type_conflicts_;
  PublisherNames names_;
  bool is_connected_ = false;
  OverflowWatch* overflow_watch_ = nullptr;
  PoolWatch* pool_watch_ = nullptr;
};

/// The identity of the publisher of `component` on `topic`: FNV-1a over both names, 64 bits.
/// http://www.isthe.com/chongo/tech/comp/fnv/
///
/// `ordinal` numbers several publishers of one component on one topic in the order of declaration,
/// from 0; from the second on it is part of the identity.
[[nodiscard]] PublisherId publisher_id(std::string_view component, std::string_view topic,
                                       std::size_t ordinal = 0) noexcept;

}  // namespace fastcycle::detail
