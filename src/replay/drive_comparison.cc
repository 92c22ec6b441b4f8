#include "replay/drive_comparison.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "broker/topics.h"

namespace fastcycle::host {
namespace {

/// The time of the last activation that had begun at `time_ns`; `time_ns` if there is none.
std::int64_t activation_at(const record::RecordedSchedule::Component& component,
                           std::int64_t time_ns) {
  const auto& activations = component.activations;
  const auto after =
      std::ranges::upper_bound(activations, time_ns, {}, &record::RecordedActivation::time_ns);
  return after == activations.begin() ? time_ns : std::prev(after)->time_ns;
}

}  // namespace

DriveComparison::Lane& DriveComparison::lane_of(const detail::PublisherCore& publisher) {
  Lane& lane = lanes_[publisher.id];
  if (lane.publisher == nullptr) {
    lane.publisher = &publisher;
    lane.component = schedule_.find(publisher.owner.name);
    lane.change.topic = publisher.topic.name;
    lane.change.publisher = publisher.owner.name;
  }
  return lane;
}

void DriveComparison::is_recorded(const detail::PublisherCore& publisher, const MessageInfo& info,
                                  std::string_view bytes) {
  Lane& lane = lane_of(publisher);
  const std::int64_t time_ns = base::to_ns(info.publish_time);
  lane.recorded.push_back({.activation_time_ns = lane.component == nullptr
                                                     ? time_ns
                                                     : activation_at(*lane.component, time_ns),
                           .publish_time_ns = time_ns,
                           .sequence = info.sequence,
                           .bytes = std::string(bytes)});
  match(lane);
}

void DriveComparison::is_published(const detail::PublisherCore& publisher, const Source& source,
                                   std::uint64_t sequence, std::string_view bytes) {
  Lane& lane = lane_of(publisher);
  lane.published.push_back({.activation_time_ns = source.time_ns,
                            .activation = source.activation,
                            .sequence = sequence,
                            .bytes = std::string(bytes)});
  match(lane);
}

void DriveComparison::has_executed(const std::string& component, std::int64_t time_ns) {
  executed_ns_[component] = time_ns;
  for (auto& [id, lane] : lanes_) {
    if (lane.change.publisher == component) {
      match(lane);
    }
  }
}

/// The time up to which its component was executed; none if it was not executed yet.
std::optional<std::int64_t> DriveComparison::executed_ns(const Lane& lane) const {
  const auto found = executed_ns_.find(lane.change.publisher);
  return found == executed_ns_.end() ? std::nullopt : std::optional(found->second);
}

/// Compares the messages that both sides have reached.
void DriveComparison::match(Lane& lane) {
  const std::optional<std::int64_t> executed = executed_ns(lane);
  while (!lane.recorded.empty()) {
    const Recorded& recorded = lane.recorded.front();
    const bool is_awaited =
        lane.published.empty() && (!executed || *executed <= recorded.activation_time_ns);
    if (is_awaited) {
      return;
    }
    if (lane.published.empty() ||
        recorded.activation_time_ns < lane.published.front().activation_time_ns) {
      ++lane.change.missing;
      lane.recorded.pop_front();
    } else if (recorded.activation_time_ns > lane.published.front().activation_time_ns) {
      add(lane);
    } else {
      compare(lane, recorded, lane.published.front());
      lane.recorded.pop_front();
      lane.published.pop_front();
    }
  }
}

void DriveComparison::add(Lane& lane) {
  const Published& published = lane.published.front();
  ++lane.change.added;
  if (on_new_message) {
    on_new_message(
        {*lane.publisher, published.activation_time_ns, published.sequence, published.bytes});
  }
  lane.published.pop_front();
}

void DriveComparison::finish() {
  for (auto& [id, lane] : lanes_) {
    // Messages after the last executed activation were not compared.
    const std::optional<std::int64_t> executed = executed_ns(lane);
    while (!lane.recorded.empty() && executed &&
           lane.recorded.front().activation_time_ns <= *executed) {
      ++lane.change.missing;
      lane.recorded.pop_front();
    }
    lane.recorded.clear();
    while (!lane.published.empty()) {
      add(lane);
    }
  }
}

void DriveComparison::compare(Lane& lane, const Recorded& recorded, const Published& published) {
  ++lane.change.compared;
  if (on_new_message) {
    on_new_message(
        {*lane.publisher, recorded.publish_time_ns, published.sequence, published.bytes});
  }
  if (recorded.bytes == published.bytes) {
    return;
  }
  ++lane.change.different;
  const google::protobuf::Message& type = lane.publisher->default_instance;
  const std::unique_ptr<google::protobuf::Message> then(type.New());
  const std::unique_ptr<google::protobuf::Message> now(type.New());
  // An unreadable message has no fields, and differs as a whole.
  const bool is_read =
      then->ParseFromString(recorded.bytes) && now->ParseFromString(published.bytes);
  if (!is_read) {
    then->Clear();
    now->Clear();
  }
  lane.fields.add(*then, *now,
                  {.activation = published.activation,
                   .time_ns = published.activation_time_ns,
                   .sequence = recorded.sequence,
                   .recorded = fmt::format("{} bytes", recorded.bytes.size()),
                   .now = fmt::format("{} other bytes", published.bytes.size())});
}

std::vector<TopicChange> DriveComparison::topics() const {
  std::vector<TopicChange> topics;
  for (const auto& [id, lane] : lanes_) {
    TopicChange topic = lane.change;
    topic.fields = lane.fields.all();
    topics.push_back(std::move(topic));
  }
  std::ranges::sort(
      topics, {}, [](const TopicChange& topic) { return std::pair(topic.topic, topic.publisher); });
  return topics;
}

}  // namespace fastcycle::host
