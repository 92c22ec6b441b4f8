#include "broker/topics.h"

#include <algorithm>
#include <utility>

namespace fastcycle::detail {

PublisherId publisher_id(std::string_view component, std::string_view topic,
                         std::size_t ordinal) noexcept {
  constexpr std::uint64_t kOffset = 14695981039346656037ULL;
  constexpr std::uint64_t kPrime = 1099511628211ULL;
  std::uint64_t hash = kOffset;
  const auto add = [&](std::string_view text) {
    for (const char c : text) {
      hash = (hash ^ static_cast<unsigned char>(c)) * kPrime;
    }
  };
  add(component);
  add("\n");
  add(topic);
  if (ordinal > 0) {
    add("\n");
    add(std::to_string(ordinal));
  }
  return hash == 0 ? 1 : hash;
}

// Here, where its two ends are known.
Topic::Topic(std::string its_name, TopicOptions its_options)
    : name(std::move(its_name)), options(its_options) {}
Topic::~Topic() = default;

void Topic::add(std::unique_ptr<Subscription> subscription) {
  auto place = subscriptions.end();
  if (declared_count_) {
    place = std::upper_bound(subscriptions.begin() + static_cast<std::ptrdiff_t>(*declared_count_),
                             subscriptions.end(), subscription->component,
                             [](const std::string& component, const auto& other) {
                               return component < other->component;
                             });
  }
  subscriptions.insert(place, std::move(subscription));
}

void Topics::set_options(const std::string& name, const TopicOptions& options) {
  const auto [topic, is_new] = topics_.try_emplace(name, std::make_unique<Topic>(name, options));
  add_chains(*topic->second);
}

void Topics::set_overflow_watch(OverflowWatch& watch) noexcept {
  overflow_watch_ = &watch;
  for (const auto& [name, topic] : topics_) {
    topic->overflow_watch = &watch;
  }
}

void Topics::set_pool_watch(PoolWatch& watch) noexcept {
  pool_watch_ = &watch;
  for (const auto& [name, topic] : topics_) {
    topic->pool_watch = &watch;
  }
}

void Topics::set_chains(std::vector<std::string> roots,
                        std::map<std::string, std::vector<ChainRule>> ends) {
  roots_ = std::move(roots);
  ends_ = std::move(ends);
  for (const auto& [name, topic] : topics_) {
    add_chains(*topic);
  }
}

void Topics::add_chains(Topic& topic) const {
  topic.root_count = roots_.size();
  const auto root = std::ranges::find(roots_, topic.name);
  if (root != roots_.end()) {
    topic.root = static_cast<std::size_t>(root - roots_.begin());
  }
  if (const auto rules = ends_.find(topic.name); rules != ends_.end()) {
    topic.ends = rules->second;
  }
}

Topic* Topics::find(const std::string& name) const {
  const auto found = topics_.find(name);
  return found == topics_.end() ? nullptr : found->second.get();
}

Topic& Topics::get(const std::string& name, const std::string& component,
                   const google::protobuf::Message& default_instance) {
  auto& topic = topics_[name];
  if (topic == nullptr) {
    const auto options = default_options_.find(name);
    topic = std::make_unique<Topic>(
        name, options == default_options_.end() ? TopicOptions() : options->second);
    topic->overflow_watch = overflow_watch_;
    topic->pool_watch = pool_watch_;
    add_chains(*topic);
    if (is_connected_) {
      topic->close_declarations();
    }
  }
  const std::string type = default_instance.GetTypeName();
  if (topic->type.empty()) {
    topic->type = type;
    topic->type_from = component;
  } else if (topic->type != type) {
    type_conflicts_.push_back(
        {TopicConflict::Kind::kTwoTypes, name, component, topic->type_from, type, topic->type});
  }
  return *topic;
}

PublisherCore& Topics::add_publisher(const std::string& name, PublishingComponent& owner,
                                     const google::protobuf::Message& default_instance,
                                     const google::protobuf::Message* prototype, bool is_external,
                                     std::optional<std::size_t> keep) {
  Topic& topic = get(name, owner.name, default_instance);
  const auto of_owner = std::ranges::count_if(
      topic.publishers, [&](const auto& other) { return other->owner.name == owner.name; });
  topic.publishers.push_back(std::make_unique<PublisherCore>(
      topic, owner, publisher_id(owner.name, name, static_cast<std::size_t>(of_owner)),
      default_instance, prototype,
      PublisherCore::Options{.is_external = is_external,
                             .keep = keep.value_or(topic.options.keep),
                             .pool_max = topic.options.pool_max,
                             .latched = topic.options.latched,
                             .lifespan = topic.options.lifespan}));
  names_.learn(topic.publishers.back()->id, owner.name, name);
  return *topic.publishers.back();
}

std::shared_ptr<Lane> Topics::make_lane(const PublisherCore& publisher,
                                        Subscription& subscription) {
  // A message of a synchronizer counts for origins once it is in a set.
  return subscription.add_lane(
      publisher.id, publisher.owner.name, publisher.options.is_external,
      publisher.topic.ages() && subscription.kind != Subscription::Kind::kSynchronized,
      publisher.is_imported,
      subscription.is_called() && publisher.credits() != nullptr
          ? std::make_shared<LaneCredit>(publisher.credits())
          : nullptr);
}

void Topics::connect(PublisherCore& publisher, Subscription& subscription) {
  const auto lane = make_lane(publisher, subscription);
  subscription.inbox.add(lane);
  publisher.connect(lane, subscription.inbox);
}

void Topics::connect_all() {
  for (const auto& [name, topic] : topics_) {
    for (const auto& publisher : topic->publishers) {
      publisher->distinguish_holders(topic->holder_count);
      for (const auto& subscription : topic->subscriptions) {
        connect(*publisher, *subscription);
      }
    }
    topic->close_declarations();
  }
  is_connected_ = true;
}

std::vector<TopicConflict> Topics::conflicts() const {
  std::vector<TopicConflict> conflicts = type_conflicts_;
  for (const auto& [name, topic] : topics_) {
    if (topic->publishers.size() > 1 && !topic->options.multiple_publishers) {
      for (std::size_t i = 1; i < topic->publishers.size(); ++i) {
        conflicts.push_back({TopicConflict::Kind::kTwoPublishers, name,
                             topic->publishers[i]->owner.name, topic->publishers[0]->owner.name});
      }
    }
    if (topic->publishers.empty() && !topic->options.external) {
      for (const auto& subscription : topic->subscriptions) {
        conflicts.push_back({TopicConflict::Kind::kNoPublisher, name, subscription->component});
      }
    }
  }
  return conflicts;
}

}  // namespace fastcycle::detail
