#include "replay/replay_plan.h"

#include <algorithm>
#include <utility>

#include <google/protobuf/descriptor.h>

#include "calls/server_core.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "component/service_topics.h"
#include "config/nearest.h"
#include "record/schema_difference.h"

namespace fastcycle::host {
namespace {

using record::RecordedStream;

std::string quoted(const std::string& text) {
  return "\"" + text + "\"";
}

config::Place place_of(std::string file) {
  return {.file = std::move(file), .line = 0, .pointer = {}};
}

/// Full topic name, without a leading slash.
std::string topic_name(std::string name) {
  return name.starts_with('/') ? name.substr(1) : name;
}

/// Whether `publisher` is the publisher of inspection tools, not a component.
bool is_tool(const std::string& publisher) {
  return publisher.starts_with(kOwnTopics);
}

/// A component without code, in place of `component`.
config::ComponentDescription idle(const config::ComponentDescription& component) {
  config::ComponentDescription description;
  description.name = component.name;
  description.executor = component.executor;
  description.after = component.after;  // Recordings count starts in their order.
  description.params = config::Value::object_at(component.params);
  description.place = component.place;
  return description;
}

std::string listed(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "none" : text;
}

class Planner {
 public:
  Planner(const ReplayOptions& options, const std::vector<RecordedStream>& streams,
          const config::ApplicationDescription& description,
          const std::vector<Connection>& connections, config::Problems& problems)
      : options_(options),
        streams_(streams),
        description_(description),
        connections_(connections),
        problems_(problems) {}

  ReplayPlan plan() {
    for (const RecordedStream& stream : streams_) {
      const auto renamed = options_.remap.find(stream.topic);
      plan_.streams.push_back(
          {.topic = topic_name(renamed == options_.remap.end() ? stream.topic : renamed->second)});
    }
    for (const Connection& connection : connections_) {
      if (!connection.is_publisher && connection.topic.ends_with(detail::kRequestTopic)) {
        plan_.services.insert(
            connection.topic.substr(0, connection.topic.size() - detail::kRequestTopic.size()));
      }
    }
    check_remap();
    choose_running();
    if (problems_.has_errors()) {
      return std::move(plan_);
    }
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      plan_stream(streams_[i], plan_.streams[i]);
    }
    run_own();
    find_shared();
    check_inputs();
    check_that_something_is_fed();
    return std::move(plan_);
  }

 private:
  void check_remap() {
    std::vector<std::string> known;
    for (const RecordedStream& stream : streams_) {
      known.push_back(stream.topic);
    }
    for (const auto& [from, to] : options_.remap) {
      if (std::ranges::find(known, from) == known.end()) {
        problems_.add(config::make_error(place_of("--remap " + from + ":=" + to),
                                         "the recording has no topic " + quoted(from),
                                         config::did_you_mean(config::nearest(from, known))));
      }
    }
  }

  void choose_running() {
    std::vector<std::string> known;
    for (const config::ComponentDescription& component : description_.components) {
      known.push_back(component.name);
      if (options_.into.empty() && !is_replaced(component.name)) {
        plan_.running.insert(component.name);
      }
    }
    for (const std::string& name : options_.into) {
      if (std::ranges::find(known, name) == known.end()) {
        problems_.add(config::make_error(place_of("--replay-into " + name),
                                         "there is no component " + quoted(name),
                                         config::did_you_mean(config::nearest(name, known))));
      }
      plan_.running.insert(name);
    }
  }

  /// Whether a component brings external input that the recording has.
  [[nodiscard]] bool is_replaced(const std::string& component) const {
    bool has_recorded = false;
    for (const Connection& connection : connections_) {
      if (connection.component != component) {
        continue;
      }
      if (!connection.is_publisher) {
        return false;
      }
      has_recorded = has_recorded || is_recorded(connection.topic, component);
    }
    return has_recorded;
  }

  /// Whether the recording has `topic` from `component`, or from an unknown publisher.
  [[nodiscard]] bool is_recorded(const std::string& topic, const std::string& component) const {
    for (std::size_t i = 0; i < streams_.size(); ++i) {
      const std::string& publisher = streams_[i].publisher;
      if (plan_.streams[i].topic == topic && options_.filter.wants(streams_[i].topic) &&
          (publisher == component || publisher.empty() ||
           !(is_component(publisher) || is_tool(publisher)))) {
        return true;
      }
    }
    return false;
  }

  [[nodiscard]] bool is_component(const std::string& name) const {
    return std::ranges::any_of(description_.components,
                               [&](const auto& component) { return component.name == name; });
  }

  [[nodiscard]] bool may_have_several_publishers(const std::string& topic) const {
    return topic.ends_with(detail::kRequestTopic) ||
           std::ranges::any_of(description_.topics, [&](const auto& described) {
             return described.name == topic && described.multiple_publishers;
           });
  }

  /// The components that subscribe to or publish `topic` and, depending on `run`, run or do not.
  [[nodiscard]] std::set<std::string> find(const std::string& topic, bool publish, bool run) const {
    std::set<std::string> names;
    for (const Connection& connection : connections_) {
      if (connection.topic == topic && connection.is_publisher == publish &&
          plan_.runs(connection.component) == run) {
        names.insert(connection.component);
      }
    }
    return names;
  }

  void plan_stream(const RecordedStream& recorded, ReplayPlan::Stream& stream) {
    stream.reason = find_obstacle(recorded, stream.topic);
    if (!stream.reason.empty()) {
      return;
    }
    if (!check_type(recorded, stream.topic)) {
      return;
    }
    const auto* pool = google::protobuf::DescriptorPool::generated_pool();
    stream.type = pool->FindMessageTypeByName(recorded.type);
    if (stream.type == nullptr) {
      stream.reason = "no library of the application knows its type " + recorded.type;
      return;
    }
    warn_of_difference(recorded, stream);
    stream.component = stand_in_of(recorded, stream.topic);
  }

  [[nodiscard]] std::string find_obstacle(const RecordedStream& recorded,
                                          const std::string& topic) const {
    if (!options_.filter.wants(recorded.topic)) {
      return "it is not asked for";
    }
    const bool is_named = !options_.filter.topics.empty();
    if (!is_named && find(topic, false, true).empty()) {
      return "no component that runs subscribes to it";
    }
    const std::set<std::string> publishers = find(topic, true, true);
    const bool is_another = (may_have_several_publishers(topic) || is_tool(recorded.publisher)) &&
                            !recorded.publisher.empty() && !plan_.runs(recorded.publisher);
    if (!publishers.empty() && !is_another) {
      return "component " + quoted(*publishers.begin()) + " publishes it, which runs";
    }
    if (recorded.encoding != "protobuf" || recorded.type.empty()) {
      return "its messages are not protobuf, but " +
             (recorded.encoding.empty() ? "of no known encoding" : quoted(recorded.encoding));
    }
    return {};
  }

  /// False after adding an error.
  bool check_type(const RecordedStream& recorded, const std::string& topic) {
    for (const Connection& connection : connections_) {
      if (connection.topic != topic || connection.type == recorded.type ||
          !plan_.runs(connection.component)) {
        continue;
      }
      config::Problem problem;
      problem.place = place_of_files();
      problem.expected = connection.type;
      problem.found = recorded.type;
      problem.message = "topic " + quoted(topic) + " has the type " + recorded.type +
                        " in the recording, but component " + quoted(connection.component) +
                        " uses it as " + connection.type;
      problems_.add(std::move(problem));
      return false;
    }
    return true;
  }

  void warn_of_difference(const RecordedStream& recorded, const ReplayPlan::Stream& stream) {
    const std::string difference = record::schema_difference(recorded.schema, *stream.type);
    if (!difference.empty()) {
      warn("topic " + quoted(stream.topic) + ": " + difference);
    }
  }

  [[nodiscard]] std::string stand_in_of(const RecordedStream& recorded,
                                        const std::string& topic) const {
    if (!recorded.publisher.empty() && !plan_.runs(recorded.publisher)) {
      return recorded.publisher;
    }
    const std::set<std::string> publishers = find(topic, true, false);
    if (recorded.publisher.empty() && !publishers.empty()) {
      return *publishers.begin();
    }
    std::string nobody = "replay";
    while (plan_.runs(nobody)) {
      nobody += "_";
    }
    return nobody;
  }

  /// FastCycle's own topics come from the recording, if it has them; else they are published by
  /// this run.
  void run_own() {
    for (const std::string name : {kOwnName, kLogName}) {
      const bool is_there = std::ranges::any_of(
          connections_, [&](const Connection& one) { return one.component == name; });
      if (is_there && !plan_.stands_in_for(name)) {
        plan_.running.insert(name);
      }
    }
  }

  void find_shared() {
    std::map<std::string, std::set<std::string>> publishers;
    for (const ReplayPlan::Stream& stream : plan_.streams) {
      if (stream.is_fed() && !may_have_several_publishers(stream.topic)) {
        publishers.try_emplace(stream.topic, find(stream.topic, true, true))
            .first->second.insert(stream.component);
      }
    }
    for (const auto& [topic, names] : publishers) {
      if (names.size() > 1) {
        plan_.shared_topics.insert(topic);
      }
    }
  }

  /// Reports subscriptions without a source.
  void check_inputs() {
    for (const Connection& input : connections_) {
      if (input.is_publisher || !plan_.runs(input.component) ||
          !find(input.topic, true, true).empty() || is_fed(input.topic)) {
        continue;
      }
      const std::set<std::string> publishers = find(input.topic, true, false);
      warn("topic " + quoted(input.topic) + ", which component " + quoted(input.component) +
           " subscribes to, " + why_not(input.topic) +
           (publishers.empty() ? ", and no component publishes it"
                               : ", and component " + quoted(*publishers.begin()) +
                                     ", which publishes it, does not run"));
    }
  }

  [[nodiscard]] bool is_fed(const std::string& topic) const {
    return std::ranges::any_of(plan_.streams, [&](const ReplayPlan::Stream& stream) {
      return stream.topic == topic && stream.is_fed();
    });
  }

  [[nodiscard]] std::string why_not(const std::string& topic) const {
    for (const ReplayPlan::Stream& stream : plan_.streams) {
      if (stream.topic == topic) {
        return "is not fed (" + stream.reason + ")";
      }
    }
    return "is not in the recording";
  }

  void check_that_something_is_fed() {
    if (problems_.has_errors() || std::ranges::any_of(plan_.streams, &ReplayPlan::Stream::is_fed)) {
      return;
    }
    config::Problem problem;
    problem.place = place_of_files();
    problem.message = streams_.empty()
                          ? "there is nothing to feed: the recording has no messages"
                          : "there is nothing to feed: the recording has the topics " +
                                listed(recorded_topics()) +
                                "; the components that run subscribe to " + listed(inputs());
    if (options_.into.empty() && !streams_.empty()) {
      problem.hint =
          "components that subscribe to nothing, and whose topics are recorded, are replaced by "
          "themselves; --replay-into NAME says which components run otherwise";
    }
    problems_.add(std::move(problem));
  }

  [[nodiscard]] std::set<std::string> recorded_topics() const {
    std::set<std::string> topics;
    for (const ReplayPlan::Stream& stream : plan_.streams) {
      topics.insert(stream.topic);
    }
    return topics;
  }

  /// The topics to which running components subscribe.
  [[nodiscard]] std::set<std::string> inputs() const {
    std::set<std::string> topics;
    for (const Connection& connection : connections_) {
      if (!connection.is_publisher && plan_.runs(connection.component)) {
        topics.insert(connection.topic);
      }
    }
    return topics;
  }

  void warn(const std::string& text) {
    config::Problem problem = config::make_error(place_of_files(), text);
    problem.warning = true;
    problems_.add(std::move(problem));
  }

  [[nodiscard]] config::Place place_of_files() const {
    return place_of(options_.files.empty() ? "" : options_.files.front().string());
  }

  const ReplayOptions& options_;
  const std::vector<RecordedStream>& streams_;
  const config::ApplicationDescription& description_;
  const std::vector<Connection>& connections_;
  config::Problems& problems_;
  ReplayPlan plan_;
};

}  // namespace

bool ReplayPlan::stands_in_for(const std::string& component) const {
  return std::ranges::any_of(streams,
                             [&](const Stream& stream) { return stream.component == component; });
}

std::vector<Connection> connections_of(const Components& components) {
  std::vector<Connection> connections;
  for (const auto& component : components) {
    const auto add = [&](const detail::Topic& topic, bool is_publisher) {
      connections.push_back({.component = component->name,
                             .topic = topic.name,
                             .type = topic.type,
                             .is_publisher = is_publisher});
    };
    for (const detail::PublisherCore* publisher : component->declared.publishers) {
      add(publisher->topic, true);
    }
    for (const detail::CallbackSubscription* subscription : component->declared.subscriptions) {
      add(subscription->topic, false);
    }
    for (const detail::View* view : component->declared.views) {
      add(view->topic, false);
    }
    for (const detail::PublisherCore* publisher : component->service_publishers) {
      add(publisher->topic, true);
    }
    for (const auto& server : component->servers) {
      if (const auto* requests = detail::ServerCore::of(*server).requests; requests != nullptr) {
        add(requests->topic, false);
      }
    }
  }
  return connections;
}

ReplayPlan plan_replay(const ReplayOptions& options, const std::vector<RecordedStream>& streams,
                       const config::ApplicationDescription& description,
                       const std::vector<Connection>& connections, config::Problems& problems) {
  return Planner(options, streams, description, connections, problems).plan();
}

config::ApplicationDescription describe_replay(config::ApplicationDescription description,
                                               const ReplayPlan& plan) {
  std::set<std::string> known;
  for (config::ComponentDescription& component : description.components) {
    known.insert(component.name);
    if (!plan.runs(component.name)) {
      component = idle(component);
    }
  }
  for (const ReplayPlan::Stream& stream : plan.streams) {
    if (stream.is_fed() && known.insert(stream.component).second) {
      config::ComponentDescription added;
      added.name = stream.component;
      added.params = config::Value::object_at(description.shared_params);
      added.place = description.place;
      description.components.push_back(std::move(added));
    }
  }
  for (const std::string& topic : plan.shared_topics) {
    auto described = std::ranges::find(description.topics, topic, &config::TopicDescription::name);
    if (described == description.topics.end()) {
      config::TopicDescription added;
      added.name = topic;
      added.place = description.place;
      described = description.topics.insert(described, std::move(added));
    }
    described->multiple_publishers = true;
  }
  return description;
}

}  // namespace fastcycle::host
