#include "record/recorder.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "base/thread.h"
#include "broker/serialized.h"
#include "log/log.pb.h"
#include "record/batch.h"
#include "record/log_format.h"

namespace fastcycle::record {
namespace {

constexpr int kActivationsAtOnce = 4096;
constexpr std::size_t kHoldMax = 64;  // Large messages of one publisher.

std::vector<std::byte> copy_of(std::span<const mcap::Bytes> parts) {
  std::vector<std::byte> bytes;
  for (const mcap::Bytes& part : parts) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  }
  return bytes;
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
  streams_.tap(topics, options_.filter, options_.memory_bytes, kHoldMax);
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
  streams_.define();
  open_.push_back({.options = options_.chunk, .batch = nullptr});
  for (const std::string& topic : streams_.topics()) {
    topics_.push_back(std::make_unique<Topic>());
    topics_.back()->name = topic;
  }
  for (const Stream& stream : streams_.all()) {
    states_.push_back(std::make_unique<StreamState>());
    states_.back()->open = open_for(streams_.topics()[stream.topic]);
    if (stream.latched > 0) {
      latched_[stream.channel].count = stream.latched;
    }
  }
}

bool Recorder::start(Explanation explanation, Activity activity) {
  explanation_ = std::move(explanation);
  activations_ = ActivationReader(std::move(activity));
  define();
  const bool is_open = recording_.open();
  is_in_trouble_ = !is_open;
  if (!is_open) {  // The caller reports it.
    trouble_.store(&troubles_.emplace_back("nothing is recorded now: " + recording_.problem()));
  }
  is_started_ = true;
  const auto policy =
      options_.is_background ? base::SchedulingPolicy::kIdle : base::SchedulingPolicy::kOther;
  writing_ = base::Thread(
      {.name = "record-write", .cpus = {}, .policy = policy}, [this] { write_batches(); },
      refusals_);
  if (!clock_.is_simulated()) {
    polling_ = base::Thread(
        {.name = "record-take", .cpus = {}, .policy = policy}, [this] { poll(); }, refusals_);
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
  if (clock_.is_simulated()) {
    round_ = step;
  }
  streams_.take([this](const Stream& stream, const detail::Lane::Head& head) {
    take_message(stream, head.envelope);
  });
  if (options_.records_activations) {
    take_activations();
  }
  hand_over_what_is_due(false);
}

/// Whether a message may be taken: a large one is held until it is written, and their number is
/// limited.
bool Recorder::make_room(const Stream& stream, std::uint64_t bytes, bool is_large) {
  std::uint64_t open_bytes = bytes;
  for (const Open& open : open_) {
    open_bytes += open.batch != nullptr ? open.batch->chunk.size() : 0;
  }
  const std::atomic<std::size_t>& held = states_[stream.index]->held;
  std::unique_lock lock(mutex_);
  const auto has_room = [&] {
    return (waiting_bytes_ == 0 || waiting_bytes_ + open_bytes <= options_.memory_bytes) &&
           (!is_large || held.load(std::memory_order_acquire) < stream.may_hold);
  };
  if (clock_.is_simulated()) {
    went_.wait(lock, has_room);
  }
  return has_room();
}

void Recorder::take_message(const Stream& stream, detail::Envelope* envelope) {
  Topic& topic = *topics_[stream.topic];
  const std::uint64_t bytes = detail::serialized_size(*envelope->payload);
  if (bytes > options_.message_bytes_max) {
    refuse(stream, bytes);
    detail::release(envelope);
    return;
  }
  const bool is_large = bytes >= kLargeBytes && stream.latched == 0;
  if (!make_room(stream, bytes, is_large)) {
    topic.memory.fetch_add(1, std::memory_order_relaxed);
    detail::release(envelope);
    return;
  }
  if (is_large) {
    add_large(stream, envelope, bytes);
    return;
  }
  add_small(stream, *envelope, bytes);
  detail::release(envelope);
}

void Recorder::report_trouble(const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    if (troubles_.size() < kTroublesMax) {
      trouble_.store(&troubles_.emplace_back(text), std::memory_order_release);
    }
  }
  on_trouble(text);
}

std::string Recorder::trouble() const {
  const std::string* const text = trouble_.load(std::memory_order_acquire);
  return text == nullptr ? std::string() : *text;
}

void Recorder::refuse(const Stream& stream, std::uint64_t bytes) {
  topics_[stream.topic]->too_large.fetch_add(1, std::memory_order_relaxed);
  if (!std::exchange(states_[stream.index]->is_reported, true)) {
    report_trouble(fmt::format(
        "a message of component \"{}\" on {} is not recorded, and neither are "
        "others like it: it has {} bytes, and {} can be written; publish it in "
        "parts, or leave the topic out",
        stream.publisher, streams_.topics()[stream.topic], bytes, options_.message_bytes_max));
  }
}

void Recorder::add_small(const Stream& stream, const detail::Envelope& envelope,
                         std::uint64_t bytes) {
  Open& open = open_[states_[stream.index]->open];
  const bool is_alone = bytes >= kLargeBytes;  // Else its chunk may exceed the limits of readers.
  if (is_alone && open.batch != nullptr) {
    hand_over(std::move(open.batch));
  }
  if (open.batch == nullptr) {
    open.batch = new_batch(open.options);
  }
  const mcap::MessageHead head = head_of(stream, envelope.info);
  const std::span<const mcap::Bytes> parts = serializer_.serialize(*envelope.payload);
  open.batch->chunk.add(head, parts);
  note(*open.batch, stream, envelope, bytes);
  if (stream.latched > 0) {
    open.batch->latched.push_back({.head = head, .data = copy_of(parts)});
  }
  if (is_alone || open.batch->chunk.size() >= kChunkBytes) {
    hand_over(std::move(open.batch));
  }
}

void Recorder::add_large(const Stream& stream, detail::Envelope* envelope, std::uint64_t bytes) {
  StreamState& state = *states_[stream.index];
  std::unique_ptr<Batch> batch = new_batch(open_[state.open].options);
  batch->chunk.borrow(head_of(stream, envelope->info),
                      batch->serializer.serialize(*envelope->payload));
  note(*batch, stream, *envelope, bytes);
  state.held.fetch_add(1, std::memory_order_relaxed);
  batch->hold(envelope, state.held);
  hand_over(std::move(batch));
}

void Recorder::note(Batch& batch, const Stream& stream, const detail::Envelope& envelope,
                    std::uint64_t bytes) {
  if (auto info = describe(stream, envelope.info, round_)) {
    *batch.infos.add_infos() = std::move(*info);
  }
  if (batch.counts.empty() || batch.counts.back().topic != stream.topic) {
    batch.counts.push_back({.topic = stream.topic});
  }
  ++batch.counts.back().messages;
  batch.counts.back().bytes += bytes;
}

void Recorder::take_activations() {
  activations_.read([this](const NewActivations& its) {
    activations_lost_.fetch_add(its.lost, std::memory_order_relaxed);
    Open& open = open_.front();
    if (open.batch == nullptr) {
      open.batch = new_batch(open.options);
    }
    // Lost activations must precede all others of a record, which is of one incarnation.
    const log::Activations& before = open.batch->activations_of(its.worker);
    if (before.activations_size() > 0 &&
        (its.lost > 0 || its.incarnation != std::max(1U, before.incarnation()))) {
      hand_over(std::move(open.batch));
      open.batch = new_batch(open.options);
    }
    log::Activations& activations = open.batch->activations_of(its.worker);
    set_incarnation(activations, its.incarnation);
    activations.set_lost(activations.lost() + its.lost);
    for (const detail::ActivationRecord& record : its.records) {
      const SeenReads& seen = activations_.seen_in(record);
      reads_lost_.fetch_add(seen.lost, std::memory_order_relaxed);
      add(activations, record, seen, streams_.leaves_out(record.publisher));
    }
    if (activations.activations_size() >= kActivationsAtOnce) {
      hand_over(std::move(open.batch));
    }
  });
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
  for (const Batch::Count& count : batch.counts) {
    Topic& topic = *topics_[count.topic];
    auto& counter = is_written ? topic.recorded : topic.disk;
    counter.fetch_add(count.messages, std::memory_order_relaxed);
    topic.bytes.fetch_add(is_written ? count.bytes : 0, std::memory_order_relaxed);
    messages += count.messages;
  }
  has_failed_ = has_failed_ || !is_written;
  take_file_news(is_written);
  if (is_written) {
    auto& written = written_[recording_.active()];
    written.resize(topics_.size());
    for (const Batch::Count& count : batch.counts) {
      written[count.topic].messages += count.messages;
      written[count.topic].bytes += count.bytes;
    }
  }
  report(is_written, messages);
  for (StoredMessage& message : batch.latched) {
    Latched& latched = latched_.at(message.head.channel_id);
    latched.last.push_back(std::move(message));
    if (latched.last.size() > latched.count) {
      latched.last.pop_front();
    }
  }
}

/// Moves the messages lost with a file from recorded to lost. Returns their number.
std::uint64_t Recorder::count_as_lost(const std::filesystem::path& active) {
  std::uint64_t messages = 0;
  const std::vector<Written>& written = written_[active];
  for (std::size_t i = 0; i < written.size(); ++i) {
    topics_[i]->recorded.fetch_sub(written[i].messages, std::memory_order_relaxed);
    topics_[i]->bytes.fetch_sub(written[i].bytes, std::memory_order_relaxed);
    topics_[i]->disk.fetch_add(written[i].messages, std::memory_order_relaxed);
    messages += written[i].messages;
  }
  return messages;
}

/// Handles changes of files. `goes_on`: a file is being written.
void Recorder::take_file_news(bool goes_on) {
  for (const Recording::News& news : recording_.take_news()) {
    std::string text = news.text;
    if (news.is_lost) {
      text += fmt::format("; the {} messages that were recorded into it are lost",
                          count_as_lost(news.active));
      if (goes_on) {
        text += "; recording goes on in " + recording_.files().back().string();
      }
    }
    if (news.is_over) {
      written_.erase(news.active);
    }
    if (!text.empty()) {
      has_failed_ = has_failed_ || news.is_trouble;
      report_trouble(text);
    }
  }
}

void Recorder::report(bool is_written, std::uint64_t messages) {
  if (!is_written && !std::exchange(is_in_trouble_, true)) {
    lost_in_trouble_ = 0;
    report_trouble("nothing is recorded now: " + recording_.problem() +
                   "; a new file is tried every second");
  } else if (is_written && std::exchange(is_in_trouble_, false)) {
    report_trouble(fmt::format("recording goes on in {}; {} messages were lost meanwhile",
                               recording_.files().back().string(), lost_in_trouble_));
  }
  lost_in_trouble_ += is_written ? 0 : messages;
}

void Recorder::explain(mcap::Writer& writer) {
  streams_.explain(writer, explanation_, clock_.now());
  // A later file begins with the latched messages that were valid then.
  const std::uint64_t now_ns = to_log_time(clock_.now());
  for (const auto& [channel, latched] : latched_) {
    for (const StoredMessage& message : latched.last) {
      mcap::MessageHead head = message.head;
      head.log_time_ns = now_ns;
      const mcap::Bytes bytes(message.data);
      if (bytes.size() >= kLargeBytes) {
        writer.flush();  // A chunk of its own, without pending schemas and channels.
      }
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
                                             {"lost.disk", std::to_string(topic.disk)},
                                             {"lost.too_large", std::to_string(topic.too_large)},
                                             {"lost.process", std::to_string(topic.process)},
                                             {"lost.shutdown", std::to_string(topic.shutdown)}}});
  }
}

std::vector<RecordedTopic> Recorder::topics() const {
  std::vector<RecordedTopic> result;
  for (const auto& topic : topics_) {
    result.push_back({.topic = topic->name,
                      .recorded = topic->recorded.load(),
                      .bytes = topic->bytes.load(),
                      .memory = topic->memory.load(),
                      .disk = topic->disk.load(),
                      .too_large = topic->too_large.load()});
  }
  for (const Stream& stream : streams_.all()) {
    RecordedTopic& topic = result[stream.topic];
    topic.published += stream.lane->published.get();
    topic.overflow += stream.lane->overflowed.get();
    topic.pool += stream.lane->dropped_by_pool.get();
    (stream.lane->options.is_imported ? topic.process : topic.shutdown) +=
        stream.lane->dropped_outside.get();
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
  has_failed_ = !recording_.close() || has_failed_;
  take_file_news(false);
}

}  // namespace fastcycle::record
