#include "record/recorder.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "base/thread.h"
#include "broker/publisher_core.h"
#include "log/log.pb.h"
#include "record/batch.h"
#include "record/descriptor_set.h"
#include "record/log_format.h"

namespace fastcycle::record {
namespace {

constexpr std::uint16_t kActivationsChannel = 1;
constexpr std::uint16_t kInfosChannel = 2;
constexpr int kActivationsAtOnce = 4096;

/// Messages of a publisher that may wait for the recorder, and that it may hold. Where their size
/// is known, they take no more than an eighth of the memory each.
struct Room {
  std::size_t depth = 512;
  std::size_t held = 64;
};

Room room_for(std::uint64_t message_bytes, std::uint64_t memory_bytes) {
  if (message_bytes == 0) {
    return {};
  }
  const std::uint64_t fit = memory_bytes / 8 / message_bytes;
  return {.depth = std::clamp<std::uint64_t>(fit, 4, 512),
          .held = std::clamp<std::uint64_t>(fit, 2, 64)};
}

std::uint64_t to_log_time(Time time) {
  return static_cast<std::uint64_t>(base::to_ns(time));
}

std::vector<std::byte> copy_of(std::span<const mcap::Bytes> parts) {
  std::vector<std::byte> bytes;
  for (const mcap::Bytes& part : parts) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  }
  return bytes;
}

/// What a message record has no place for; nothing if that is as usual.
std::optional<log::MessageInfo> describe(const MessageInfo& message, std::uint32_t step) {
  const Duration age = message.publish_time - message.origin.taken;
  const bool is_root = message.origin.root == message.publisher;
  const bool is_long = message.sequence > std::numeric_limits<std::uint32_t>::max();
  if (age == Duration(0) && is_root && !message.origin.held && step == kUsualStep && !is_long) {
    return std::nullopt;
  }
  log::MessageInfo info;
  info.set_sequence(message.sequence);
  info.set_age_ns(age.count());
  info.set_root(is_root ? 0 : message.origin.root);
  info.set_held(message.origin.held);
  if (step != kUsualStep) {
    info.set_step(step);
  }
  return info;
}

log::Activation to_message(const detail::ActivationRecord& record) {
  log::Activation message;
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

Recorder::Recorder(RecorderOptions options, const base::Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      recording_(
          options_.recording, [this](mcap::Writer& writer) { explain(writer); },
          [this](mcap::Writer& writer) { conclude(writer); }) {}

Recorder::~Recorder() {
  stop();
}

void Recorder::tap(detail::Topics& topics) {
  for (const auto& [name, topic] : topics.all()) {
    if (topic->publishers.empty() || !options_.filter.wants(name)) {
      continue;
    }
    std::uint64_t message_bytes = 0;
    for (const auto& publisher : topic->publishers) {
      message_bytes = std::max<std::uint64_t>(message_bytes, publisher->prototype_bytes());
    }
    const Room room = room_for(message_bytes, options_.memory_bytes);
    tap_.add(*topic, room.depth, room.held);
  }
}

std::size_t Recorder::open_for(const std::string& topic) {
  mcap::ChunkOptions wanted = options_.chunk;
  for (const CompressionRule& rule : options_.rules) {
    if (mcap::matches(rule.pattern, topic)) {
      wanted = rule.chunk;
      break;
    }
  }
  const auto found = std::ranges::find_if(open_, [&](const Open& open) {
    return open.options.compression == wanted.compression && open.options.level == wanted.level;
  });
  if (found == open_.end()) {
    open_.push_back({.options = wanted, .batch = nullptr});
    return open_.size() - 1;
  }
  return static_cast<std::size_t>(found - open_.begin());
}

void Recorder::define() {
  std::map<std::string, std::uint16_t> schema_ids;
  const auto schema_of = [&](const google::protobuf::Descriptor& type) {
    const auto [place, is_new] =
        schema_ids.try_emplace(type.full_name(), static_cast<std::uint16_t>(schema_ids.size() + 1));
    if (is_new) {
      schemas_.push_back({.id = place->second,
                          .name = type.full_name(),
                          .encoding = "protobuf",
                          .data = descriptor_set_of(type)});
    }
    return place->second;
  };
  const auto add_channel = [&](std::uint16_t id, const std::string& topic,
                               const google::protobuf::Descriptor& type,
                               std::map<std::string, std::string> metadata) {
    channels_.push_back({.id = id,
                         .schema_id = schema_of(type),
                         .topic = topic,
                         .message_encoding = "protobuf",
                         .metadata = std::move(metadata)});
  };
  open_.push_back({.options = options_.chunk, .batch = nullptr});
  add_channel(kActivationsChannel, kActivationsTopic, *log::Activations::descriptor(), {});
  add_channel(kInfosChannel, kInfosTopic, *log::MessageInfos::descriptor(), {});
  std::map<std::string, std::size_t> topic_indexes;
  std::uint16_t next_channel = kInfosChannel + 1;
  for (const auto& lane : tap_.lanes()) {
    const detail::Topic& topic = lane->subscription.topic;
    const auto publisher = std::ranges::find_if(
        topic.publishers, [&](const auto& other) { return other->id == lane->publisher; });
    const auto [place, is_new] = topic_indexes.try_emplace(topic.name, topics_.size());
    if (is_new) {
      topics_.push_back(std::make_unique<Topic>());
      topics_.back()->name = topic.name;
    }
    auto stream = std::make_unique<Stream>();
    stream->channel = next_channel++;
    stream->topic = place->second;
    stream->open = open_for(topic.name);
    if (topic.options.latched > 0) {
      stream->is_latched = true;
      latched_[stream->channel].count = topic.options.latched;
    }
    stream->is_external = lane->options.is_external;
    stream->may_hold = lane->subscription.keep;
    add_channel(stream->channel, topic.name, *(*publisher)->default_instance.GetDescriptor(),
                {{"publisher", (*publisher)->owner.name},
                 {"publisher_id", fmt::format("{:016x}", lane->publisher)}});
    streams_.emplace(lane.get(), std::move(stream));
  }
}

bool Recorder::start(Explanation explanation, std::vector<const detail::ActivationRing*> rings) {
  explanation_ = std::move(explanation);
  rings_ = std::move(rings);
  next_in_ring_.assign(rings_.size(), 0);
  define();
  const bool is_open = recording_.open();
  is_in_trouble_ = !is_open;
  is_started_ = true;
  writing_ =
      base::Thread({.name = "record-write", .cpus = {}}, [this] { write_batches(); }, refusals_);
  if (!clock_.is_simulated()) {
    polling_ = base::Thread({.name = "record-take", .cpus = {}}, [this] { poll(); }, refusals_);
  }
  return is_open;
}

void Recorder::poll() {
  std::unique_lock lock(mutex_);
  while (!stops_taking_) {
    lock.unlock();
    take();
    lock.lock();
    ended_.wait_for(lock, kPoll, [this] { return stops_taking_; });
  }
}

void Recorder::take(std::uint32_t step) {
  step_ = step;
  tap_.take([this](const detail::Lane& lane, const detail::Lane::Head& head) {
    take_message(lane, head);
  });
  if (options_.records_activations) {
    take_activations();
  }
  hand_over_what_is_due(false);
}

/// Whether a message may be taken: a large one is held until it is written, and only so many are.
bool Recorder::make_room(const Stream& stream, std::uint64_t bytes, bool is_large) {
  std::uint64_t open_bytes = bytes;
  for (const Open& open : open_) {
    open_bytes += open.batch != nullptr ? open.batch->chunk.size() : 0;
  }
  std::unique_lock lock(mutex_);
  const auto has_room = [&] {
    return (waiting_bytes_ == 0 || waiting_bytes_ + open_bytes <= options_.memory_bytes) &&
           (!is_large || stream.held.load(std::memory_order_acquire) < stream.may_hold);
  };
  if (clock_.is_simulated()) {
    went_.wait(lock, has_room);
  }
  return has_room();
}

void Recorder::take_message(const detail::Lane& lane, const detail::Lane::Head& head) {
  Stream& stream = *streams_.at(&lane);
  Topic& topic = *topics_[stream.topic];
  detail::Envelope* envelope = head.envelope;
  const mcap::MessageHead stored{.channel_id = stream.channel,
                                 .sequence = static_cast<std::uint32_t>(head.sequence),
                                 .log_time_ns = to_log_time(envelope->info.publish_time),
                                 .publish_time_ns = to_log_time(envelope->info.publish_time)};
  const std::uint64_t bytes = envelope->payload->ByteSizeLong();
  const bool is_large = bytes >= kLargeBytes && !stream.is_latched;
  if (!make_room(stream, bytes, is_large)) {
    topic.memory.fetch_add(1, std::memory_order_relaxed);
    detail::release(envelope);
    return;
  }
  topic.bytes.fetch_add(bytes, std::memory_order_relaxed);
  if (is_large) {
    add_large(stream, stored, envelope);
    return;
  }
  add_small(stream, stored, *envelope);
  detail::release(envelope);
}

void Recorder::add_small(Stream& stream, const mcap::MessageHead& head,
                         const detail::Envelope& envelope) {
  Open& open = open_[stream.open];
  if (open.batch == nullptr) {
    open.batch = new_batch(open.options);
  }
  const std::span<const mcap::Bytes> parts = serializer_.serialize(*envelope.payload);
  open.batch->chunk.add(head, parts);
  note(*open.batch, stream, envelope);
  if (stream.is_latched) {
    open.batch->latched.push_back({.head = head, .data = copy_of(parts)});
  }
  if (open.batch->chunk.size() >= kChunkBytes) {
    hand_over(std::move(open.batch));
  }
}

void Recorder::add_large(Stream& stream, const mcap::MessageHead& head,
                         detail::Envelope* envelope) {
  std::unique_ptr<Batch> batch = new_batch(open_[stream.open].options);
  batch->chunk.borrow(head, batch->serializer.serialize(*envelope->payload));
  note(*batch, stream, *envelope);
  stream.held.fetch_add(1, std::memory_order_relaxed);
  batch->hold(envelope, stream.held);
  hand_over(std::move(batch));
}

void Recorder::note(Batch& batch, const Stream& stream, const detail::Envelope& envelope) {
  // What foreign threads publish is there before a round, all else after it.
  const std::uint32_t step =
      clock_.is_simulated() ? step_ + (stream.is_external ? 0 : 1) : kUsualStep;
  if (auto info = describe(envelope.info, step)) {
    info->set_channel(stream.channel);
    *batch.infos.add_infos() = std::move(*info);
  }
  if (batch.counts.empty() || batch.counts.back().first != stream.topic) {
    batch.counts.emplace_back(stream.topic, 0);
  }
  ++batch.counts.back().second;
}

void Recorder::take_activations() {
  for (std::size_t worker = 0; worker < rings_.size(); ++worker) {
    activations_.clear();
    const std::uint64_t lost = rings_[worker]->read(next_in_ring_[worker], activations_);
    activations_lost_.fetch_add(lost, std::memory_order_relaxed);
    if (activations_.empty() && lost == 0) {
      continue;
    }
    Open& open = open_.front();
    if (open.batch == nullptr) {
      open.batch = new_batch(open.options);
    }
    log::Activations& waiting = open.batch->activations_of(worker);
    // What was lost came before all that follows it in the same record.
    if (lost > 0 && waiting.activations_size() > 0) {
      hand_over(std::move(open.batch));
      open.batch = new_batch(open.options);
    }
    log::Activations& activations = open.batch->activations_of(worker);
    activations.set_lost(activations.lost() + lost);
    for (const detail::ActivationRecord& record : activations_) {
      *activations.add_activations() = to_message(record);
    }
    if (activations.activations_size() >= kActivationsAtOnce) {
      hand_over(std::move(open.batch));
    }
  }
}

std::unique_ptr<Batch> Recorder::new_batch(const mcap::ChunkOptions& options) {
  auto batch = std::make_unique<Batch>(options);
  batch->began_ns = base::monotonic_ns();
  return batch;
}

void Recorder::add_own(Batch& batch, std::uint16_t channel,
                       const google::protobuf::Message& message) {
  const std::uint64_t at_ns = to_log_time(clock_.now());
  batch.chunk.add({.channel_id = channel,
                   .sequence = ++own_sequences_[channel],
                   .log_time_ns = at_ns,
                   .publish_time_ns = at_ns},
                  serializer_.serialize(message));
}

void Recorder::hand_over(std::unique_ptr<Batch> batch) {
  for (const log::Activations& activations : batch->activations) {
    if (activations.activations_size() > 0 || activations.lost() > 0) {
      add_own(*batch, kActivationsChannel, activations);
    }
  }
  if (batch->infos.infos_size() > 0) {
    add_own(*batch, kInfosChannel, batch->infos);
  }
  {
    const std::lock_guard lock(mutex_);
    waiting_bytes_ += batch->chunk.size();
    batches_.push_back(std::move(batch));
  }
  came_.notify_one();
}

void Recorder::hand_over_what_is_due(bool all) {
  const std::int64_t old_ns = base::monotonic_ns() - std::chrono::nanoseconds(kChunkAge).count();
  for (Open& open : open_) {
    if (open.batch != nullptr && (all || open.batch->began_ns <= old_ns)) {
      hand_over(std::move(open.batch));
    }
  }
}

void Recorder::write_batches() {
  std::unique_lock lock(mutex_);
  for (;;) {
    came_.wait(lock, [this] { return !batches_.empty() || stops_writing_; });
    if (batches_.empty()) {
      return;
    }
    const std::unique_ptr<Batch> batch = std::move(batches_.front());
    batches_.pop_front();
    lock.unlock();
    const std::uint64_t bytes = batch->chunk.size();
    write(*batch);
    batch->release();
    lock.lock();
    waiting_bytes_ -= bytes;
    went_.notify_one();
  }
}

void Recorder::write(Batch& batch) {
  batch.chunk.close();
  const bool is_written = recording_.write(batch.chunk);
  std::uint64_t messages = 0;
  for (const auto& [topic, count] : batch.counts) {
    auto& counter = is_written ? topics_[topic]->recorded : topics_[topic]->disk;
    counter.fetch_add(count, std::memory_order_relaxed);
    messages += count;
  }
  tell(is_written, messages);
  for (StoredMessage& message : batch.latched) {
    Latched& latched = latched_.at(message.head.channel_id);
    latched.last.push_back(std::move(message));
    if (latched.last.size() > latched.count) {
      latched.last.pop_front();
    }
  }
}

void Recorder::tell(bool is_written, std::uint64_t messages) {
  if (!is_written && !std::exchange(is_in_trouble_, true)) {
    lost_in_trouble_ = 0;
    on_trouble("nothing is recorded now: " + recording_.problem() +
               "; a new file is tried every second");
  } else if (is_written && std::exchange(is_in_trouble_, false)) {
    on_trouble(fmt::format("recording goes on in {}; {} messages were lost meanwhile",
                           recording_.files().back().string(), lost_in_trouble_));
  }
  lost_in_trouble_ += is_written ? 0 : messages;
}

void Recorder::explain(mcap::Writer& writer) {
  writer.write(mcap::Metadata{.name = kRunMetadata, .metadata = explanation_.facts});
  if (!explanation_.application.empty()) {
    mcap::Attachment attachment;
    attachment.log_time_ns = attachment.create_time_ns = to_log_time(clock_.now());
    attachment.name = "application.json";
    attachment.media_type = "application/json";
    attachment.data = mcap::bytes_of(explanation_.application);
    writer.write(attachment);
  }
  for (const mcap::Schema& schema : schemas_) {
    writer.add(schema);
  }
  for (const mcap::Channel& channel : channels_) {
    writer.add(channel);
  }
  // A file that begins later tells what held when it began.
  const std::uint64_t now_ns = to_log_time(clock_.now());
  for (const auto& [channel, latched] : latched_) {
    for (const StoredMessage& message : latched.last) {
      mcap::MessageHead head = message.head;
      head.log_time_ns = now_ns;
      const mcap::Bytes bytes(message.data);
      writer.write(head, {&bytes, 1});
    }
  }
  writer.flush();
}

void Recorder::conclude(mcap::Writer& writer) {
  if (!end_.empty()) {
    writer.write(mcap::Metadata{.name = kEndMetadata, .metadata = end_});
  }
  for (const RecordedTopic& topic : topics()) {
    writer.write(mcap::Metadata{.name = "fastcycle.loss",
                                .metadata = {{"topic", topic.topic},
                                             {"published", std::to_string(topic.published)},
                                             {"recorded", std::to_string(topic.recorded)},
                                             {"lost", std::to_string(topic.lost())},
                                             {"lost.overflow", std::to_string(topic.overflow)},
                                             {"lost.pool", std::to_string(topic.pool)},
                                             {"lost.memory", std::to_string(topic.memory)},
                                             {"lost.disk", std::to_string(topic.disk)}}});
  }
}

std::vector<RecordedTopic> Recorder::topics() const {
  std::vector<RecordedTopic> result;
  for (const auto& topic : topics_) {
    result.push_back({.topic = topic->name,
                      .recorded = topic->recorded.load(),
                      .bytes = topic->bytes.load(),
                      .memory = topic->memory.load(),
                      .disk = topic->disk.load()});
  }
  for (const auto& [lane, stream] : streams_) {
    RecordedTopic& topic = result[stream->topic];
    topic.published += lane->published.get();
    topic.overflow += lane->overflowed.get();
    topic.pool += lane->dropped_by_pool.get();
  }
  return result;
}

void Recorder::set(bool& flag) {
  const std::lock_guard lock(mutex_);
  flag = true;
  came_.notify_all();
  ended_.notify_all();
}

void Recorder::stop(std::map<std::string, std::string> end) {
  if (!std::exchange(is_started_, false)) {
    return;
  }
  if (!clock_.is_simulated()) {
    set(stops_taking_);
    polling_.join();
  }
  take();
  hand_over_what_is_due(true);
  set(stops_writing_);
  writing_.join();
  end_ = std::move(end);
  recording_.close();
}

}  // namespace fastcycle::record
