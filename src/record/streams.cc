#include "record/streams.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "log/log.pb.h"
#include "record/descriptor_set.h"
#include "record/log_format.h"

namespace fastcycle::record {
namespace {

/// The number of messages of this size that fit an eighth of the memory, from `min` to `max`.
std::size_t how_many_fit(std::uint64_t message_bytes, std::uint64_t memory_bytes, std::size_t min,
                         std::size_t max) {
  if (message_bytes == 0) {
    return max;
  }
  return std::clamp<std::uint64_t>(memory_bytes / 8 / message_bytes, std::min(min, max), max);
}

log::Activation to_message(const detail::ActivationRecord& record, bool is_left_out) {
  log::Activation message;
  if (record.subscription != detail::ActivationRecord::kNoSubscription) {
    message.set_subscription(record.subscription);
  }
  if (record.cause == detail::Cause::kTick || record.cause == detail::Cause::kTimeout ||
      is_left_out) {
    message.set_late_ns(record.time_ns - record.cause_ns);
  }
  message.set_component(record.component);
  message.set_number(record.number);
  message.set_cause(static_cast<log::Cause>(record.cause));
  message.set_publisher(record.publisher);
  message.set_key(record.key);
  message.set_skipped(record.skipped);
  message.set_time_ns(record.time_ns);
  message.set_outcome(static_cast<log::Outcome>(record.outcome));
  message.set_duration_ns(static_cast<std::uint64_t>(record.duration_ns));
  message.set_publish_count(record.publish_count);
  return message;
}

}  // namespace

void Streams::tap(detail::Topics& topics, const mcap::TopicFilter& filter,
                  std::uint64_t memory_bytes, std::size_t hold_max) {
  constexpr std::size_t kDepthMax = 512;
  for (const auto& [name, topic] : topics.all()) {
    if (!filter.wants(name)) {
      topic->is_left_out = true;
      for (const auto& publisher : topic->publishers) {
        left_out_.insert(publisher->id);
      }
      continue;
    }
    if (topic->publishers.empty()) {
      continue;
    }
    std::uint64_t message_bytes = 0;
    for (const auto& publisher : topic->publishers) {
      message_bytes = std::max<std::uint64_t>(message_bytes, publisher->prototype_bytes());
    }
    tap_.add(*topic, how_many_fit(message_bytes, memory_bytes, 4, kDepthMax),
             how_many_fit(message_bytes, memory_bytes, 2, hold_max));
  }
}

void Streams::define() {
  add_channel(kActivationsChannel, kActivationsTopic, *log::Activations::descriptor(), {});
  add_channel(kInfosChannel, kInfosTopic, *log::MessageInfos::descriptor(), {});
  for (const auto& lane : tap_.lanes()) {
    add_stream(*lane);
  }
}

std::uint16_t Streams::schema_of(const google::protobuf::Descriptor& type) {
  const auto known = std::ranges::find(schemas_, type.full_name(), &mcap::Schema::name);
  if (known != schemas_.end()) {
    return known->id;
  }
  schemas_.push_back({.id = static_cast<std::uint16_t>(schemas_.size() + 1),
                      .name = type.full_name(),
                      .encoding = "protobuf",
                      .data = descriptor_set_of(type)});
  return schemas_.back().id;
}

void Streams::add_channel(std::uint16_t id, const std::string& topic,
                          const google::protobuf::Descriptor& type,
                          std::map<std::string, std::string> metadata) {
  channels_.push_back({.id = id,
                       .schema_id = schema_of(type),
                       .topic = topic,
                       .message_encoding = "protobuf",
                       .metadata = std::move(metadata)});
}

void Streams::add_stream(const detail::Lane& lane) {
  const detail::Topic& topic = lane.subscription.topic;
  const auto publisher = std::ranges::find_if(
      topic.publishers, [&](const auto& other) { return other->id == lane.publisher; });
  // The lanes of one topic follow each other.
  if (topics_.empty() || topics_.back() != topic.name) {
    topics_.push_back(topic.name);
  }
  const Stream stream{.lane = &lane,
                      .channel = static_cast<std::uint16_t>(channels_.size() + 1),
                      .index = streams_.size(),
                      .topic = topics_.size() - 1,
                      .latched = topic.options.latched,
                      .is_external = lane.options.is_external && !lane.options.is_imported,
                      .publisher = (*publisher)->owner.name,
                      .may_hold = lane.subscription.keep};
  add_channel(stream.channel, topic.name, *(*publisher)->default_instance.GetDescriptor(),
              {{"publisher", (*publisher)->owner.name},
               {"publisher_id", fmt::format("{:016x}", lane.publisher)}});
  index_of_lane_.emplace(&lane, stream.index);
  streams_.push_back(stream);
}

void Streams::explain(mcap::Writer& writer, const Explanation& explanation, Time now) const {
  writer.write(mcap::Metadata{.name = kRunMetadata, .metadata = explanation.facts});
  if (!explanation.application.empty()) {
    mcap::Attachment attachment;
    attachment.log_time_ns = attachment.create_time_ns = to_log_time(now);
    attachment.name = "application.json";
    attachment.media_type = "application/json";
    attachment.data = mcap::bytes_of(explanation.application);
    writer.write(attachment);
  }
  for (const mcap::Schema& schema : schemas_) {
    writer.add(schema);
  }
  for (const mcap::Channel& channel : channels_) {
    writer.add(channel);
  }
}

void set_incarnation(log::Activations& activations, std::uint32_t incarnation) {
  if (incarnation > 1) {
    activations.set_incarnation(incarnation);
  }
}

void add(log::Activations& activations, const detail::ActivationRecord& record,
         const SeenReads& seen, bool is_left_out) {
  log::Activation& activation = *activations.add_activations() = to_message(record, is_left_out);
  for (const detail::Read& read : seen.reads) {
    if (read.kind == detail::ReadKind::kText) {
      if (activation.reads_size() > 0 && read.place <= sizeof(read.value)) {
        activation.mutable_reads()->rbegin()->mutable_text()->append(
            reinterpret_cast<const char*>(&read.value), read.place);
      }
      continue;
    }
    log::Read& its = *activation.add_reads();
    its.set_kind(static_cast<log::ReadKind>(read.kind));
    its.set_place(read.place);
    its.set_publisher(read.publisher);
    its.set_value(read.value);
  }
  activation.set_reads_lost(seen.lost);
}

ActivationReader::ActivationReader(Activity activity) {
  parts_.push_back(
      {.rings = {.workers = std::move(activity.rings), .reads = std::move(activity.reads)}});
  parts_.front().workers.resize(parts_.front().rings.workers.size());
  parts_.front().reads.resize(parts_.front().rings.reads.size());
  for (const detail::PeerActivity* const peer : activity.peers) {
    Part part{.peer = peer};
    // The number is the same in all incarnations.
    part.workers.resize(peer->rings(1).workers.size());
    part.reads.resize(peer->rings(1).reads.size());
    begin(part, peer->incarnation());
    parts_.push_back(std::move(part));
  }
}

void ActivationReader::begin(Part& part, std::uint32_t incarnation) {
  part.incarnation = part.seen = incarnation;
  part.last = std::max(part.last, incarnation);
  part.rings = incarnation == 0 ? detail::PeerActivity::Rings() : part.peer->rings(incarnation);
  part.workers.assign(part.workers.size(), {});
  part.reads.assign(part.reads.size(), {});
}

/// Continues with the incarnation after one that has ended; false if there is none.
bool ActivationReader::begin_next(Part& part) {
  if (part.seen == part.incarnation) {
    return false;
  }
  constexpr std::uint32_t kBefore = detail::PeerActivity::kReadable - 1;
  const std::uint32_t oldest = part.seen > kBefore ? part.seen - kBefore : 1;
  begin(part, part.seen == 0 ? 0 : std::max(part.last + 1, oldest));
  return part.incarnation != 0;
}

void ActivationReader::take(Part& part) {
  if (part.peer != nullptr) {
    part.seen = part.peer->incarnation();
  }
  if (take_activations(part)) {
    take_reads(part);
  }
}

bool ActivationReader::take_activations(Part& part) {
  bool is_news = false;
  for (std::size_t i = 0; i < part.rings.workers.size(); ++i) {
    Worker& its = part.workers[i];
    const detail::ActivationRing& ring = *part.rings.workers[i];
    its.records.clear();
    its.lost = ring.read(its.next, its.records);
    if (part.seen != part.incarnation) {
      take_last(its, ring);
    }
    if (parts_.size() > 1) {
      leave_out_others(part, its);
    }
    is_news = is_news || its.lost > 0 || !its.records.empty();
  }
  for (Reads& its : part.reads) {
    its.first = std::numeric_limits<std::uint64_t>::max();
  }
  for (const Worker& worker : part.workers) {
    for (const detail::ActivationRecord& record : worker.records) {
      if (record.component < part.reads.size()) {
        std::uint64_t& first = part.reads[record.component].first;
        first = std::min(first, record.number);
      }
    }
  }
  return is_news;
}

/// The activation in which the process ended: it is never completed.
void ActivationReader::take_last(Worker& worker, const detail::ActivationRing& ring) {
  detail::ActivationRecord record;
  if (worker.next < ring.size() && ring.read_at(worker.next, record)) {
    worker.records.push_back(record);
    ++worker.next;
  }
}

/// Removes activations of placeholders for components of other processes. Another process may also
/// write anything, but must not report components that are not its own.
void ActivationReader::leave_out_others(const Part& part, Worker& worker) {
  const auto is_of_others = [&](const detail::ActivationRecord& record) {
    return record.component < part.rings.reads.size() &&
           part.rings.reads[record.component] == nullptr;
  };
  const auto is_forged = [&](const detail::ActivationRecord& record) {
    return record.component >= part.rings.reads.size() || record.cause > detail::Cause::kFault ||
           record.outcome > detail::Outcome::kFault;
  };
  std::erase_if(worker.records, [&](const detail::ActivationRecord& record) {
    return is_of_others(record) || (part.peer != nullptr && is_forged(record));
  });
}

void ActivationReader::take_reads(Part& part) {
  // After the activations: all that a finished activation read is recorded by now.
  constexpr std::size_t kMostKept = 4 * detail::ReadRing::kForViews;
  for (std::size_t component = 0; component < part.rings.reads.size(); ++component) {
    const detail::ReadRing* ring = part.rings.reads[component];
    Reads& its = part.reads[component];
    if (ring == nullptr) {
      continue;
    }
    // Another worker's ring may have had an activation older than the last one returned; it was
    // returned in the pass after that.
    const auto old = std::ranges::upper_bound(its.reads, its.old, {}, &detail::Read::activation);
    its.reads.erase(its.reads.begin(), old);
    its.old = its.given;
    its.lost += ring->read(its.next, its.reads);
    if (its.reads.size() > kMostKept) {
      const std::size_t surplus = its.reads.size() - kMostKept;
      its.reads.erase(its.reads.begin(), its.reads.begin() + static_cast<std::ptrdiff_t>(surplus));
      its.lost += surplus;
    }
  }
}

SeenReads ActivationReader::seen_in(const detail::ActivationRecord& record) {
  if (record.component >= part_->reads.size()) {
    return {};
  }
  Reads& its = part_->reads[record.component];
  its.given = std::max(its.given, record.number);
  const auto found =
      std::ranges::equal_range(its.reads, record.number, {}, &detail::Read::activation);
  const bool is_first = record.number <= its.first;
  return {.reads = {found.begin(), found.end()}, .lost = is_first ? std::exchange(its.lost, 0) : 0};
}

std::optional<log::MessageInfo> describe(const Stream& stream, const MessageInfo& message,
                                         std::optional<std::uint32_t> round) {
  // Messages of foreign threads exist before a round, all others after it.
  const std::uint32_t step = round ? *round + (stream.is_external ? 0 : 1) : kUsualStep;
  const Duration age = message.publish_time - message.origin.taken;
  const bool is_root = message.origin.root == message.publisher;
  const bool is_long = message.sequence > std::numeric_limits<std::uint32_t>::max();
  if (age == Duration(0) && is_root && !message.origin.held && step == kUsualStep && !is_long) {
    return std::nullopt;
  }
  log::MessageInfo info;
  info.set_channel(stream.channel);
  info.set_sequence(message.sequence);
  info.set_age_ns(age.count());
  info.set_root(is_root ? 0 : message.origin.root);
  info.set_held(message.origin.held);
  if (step != kUsualStep) {
    info.set_step(step);
  }
  return info;
}

mcap::MessageHead head_of(const Stream& stream, const MessageInfo& message) {
  return {.channel_id = stream.channel,
          .sequence = static_cast<std::uint32_t>(message.sequence),
          .log_time_ns = to_log_time(message.publish_time),
          .publish_time_ns = to_log_time(message.publish_time)};
}

std::uint64_t to_log_time(Time time) {
  return static_cast<std::uint64_t>(base::to_ns(time));
}

}  // namespace fastcycle::record
