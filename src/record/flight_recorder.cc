#include "record/flight_recorder.h"

#include <algorithm>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "broker/serialized.h"
#include "log/log.pb.h"
#include "mcap/file.h"
#include "mcap/record_reader.h"
#include "mcap/writer.h"

namespace fastcycle::record {
namespace {

constexpr std::size_t kFlightHoldMax = 1;     // Messages are copied at once.
constexpr std::int64_t kMarks = 4096;         // Limit for the time before a trigger.
constexpr std::size_t kTriggersInWords = 64;  // Of one dump.
constexpr std::uint64_t kRepeats = 4;         // Of latched messages, per pass over the ring.

template <std::size_t kSize>
void put(std::array<char, kSize>& into, std::string_view text) {
  const std::size_t size = std::min(text.size(), kSize - 1);
  std::copy_n(text.data(), size, into.data());
  into[size] = '\0';
}

std::uint16_t to_kind(FlightKind kind) {
  return static_cast<std::uint16_t>(kind);
}

std::uint64_t lost_between_processes(const detail::Lane& lane) {
  return lane.options.is_imported ? lane.dropped_outside.get() : 0;
}

std::string in_words(const FlightDump& dump) {
  std::string text = fmt::format("{} ({} messages; {}{}{})", dump.file.string(), dump.messages,
                                 dump.trigger.reason, dump.trigger.component.empty() ? "" : " of ",
                                 dump.trigger.component);
  if (dump.missing > 0) {
    text += fmt::format("; {} older records were overwritten before: a larger ring keeps them",
                        dump.missing);
  }
  return text;
}

}  // namespace

FlightRecorder::FlightRecorder(FlightOptions options, const base::Clock& clock)
    : options_(std::move(options)), clock_(clock) {}

FlightRecorder::~FlightRecorder() {
  stop();
}

void FlightRecorder::tap(detail::Topics& topics) {
  streams_.tap(topics, options_.filter, options_.bytes, kFlightHoldMax);
}

void FlightRecorder::open(const Explanation& explanation) {
  if (auto left = dump_crashed(options_.file)) {
    const bool is_trouble = !left->problem.empty();
    on_news(is_trouble, is_trouble
                            ? "what the run before left could not be written: " + left->problem
                            : "the run before did not end in order: " + in_words(*left));
    dumps_.push_back(std::move(*left));
  }
  streams_.define();
  states_.resize(streams_.all().size());
  mcap::MemorySink sink;
  mcap::Writer writer(sink, {.profile = "fastcycle", .library = "fastcycle"});
  streams_.explain(writer, explanation, clock_.now());
  writer.flush();
  ring_ = std::make_unique<FlightRing>(
      FlightRing::Options{
          .file = options_.file, .bytes = options_.bytes, .start_ns = base::to_ns(clock_.now())},
      sink.bytes());
}

void FlightRecorder::start(Activity activity) {
  activations_ = ActivationReader(std::move(activity));
  note_mark(base::to_ns(clock_.now()));
  is_started_ = true;
  if (!clock_.is_simulated()) {
    dumping_ =
        base::Thread({.name = "flight-dump", .cpus = {}}, [this] { write_dumps(); }, refusals_);
    polling_ = base::Thread({.name = "flight-take", .cpus = {}}, [this] { poll(); }, refusals_);
  }
}

void FlightRecorder::poll() {
  std::unique_lock lock(mutex_);
  while (!stops_taking_) {
    lock.unlock();
    take();
    lock.lock();
    changed_.wait_for(lock, kPoll, [this] { return stops_taking_; });
  }
}

void FlightRecorder::take(std::uint32_t step) {
  const std::int64_t now_ns = base::to_ns(clock_.now());
  if (clock_.is_simulated()) {
    round_ = step;
  }
  look_at_ring();
  collect_triggers();
  hand_over_what_is_due(now_ns);
  note_mark(now_ns);
  streams_.take([this](const Stream& stream, const detail::Lane::Head& head) {
    keep(stream, *head.envelope);
    detail::release(head.envelope);
  });
  keep_activations();
  note_losses();
  if (ring_->mark().position - repeated_at_ > ring_->capacity() / kRepeats) {
    repeat_latched();
  }
  ring_->count_wake();
}

/// Reports, once, what others did to the file of the ring.
void FlightRecorder::look_at_ring() {
  constexpr std::int64_t kPeriodNs = 1'000'000'000;
  const std::int64_t now_ns = base::monotonic_ns();
  const bool is_newly_cut = ring_->is_cut() && !std::exchange(is_cut_, true);
  if (is_newly_cut) {
    ring_->forget();
  } else if (is_cut_ || now_ns - looked_ns_ < kPeriodNs) {
    return;
  }
  looked_ns_ = now_ns;
  const base::FileState state = ring_->look();
  const std::string words =
      state.words.empty() && is_cut_ ? "another program cut it off" : state.words;
  if (words.empty() || std::exchange(reported_, words) == words) {
    return;
  }
  problem_ = options_.file.string() + ": " + words +
             "; dumps are still written, but the next run does not find what a crash of this one "
             "leaves; start it anew to have that again";
  on_news(true, problem_);
}

void FlightRecorder::keep(const Stream& stream, const detail::Envelope& envelope) {
  const auto info = describe(stream, envelope.info, round_);
  scratch_.clear();
  if (info) {
    info->AppendToString(&scratch_);
  }
  const std::int64_t publish_ns = base::to_ns(envelope.info.publish_time);
  const FlightMessageHead head{.channel = stream.channel,
                               .info_size = static_cast<std::uint16_t>(scratch_.size()),
                               .sequence = static_cast<std::uint32_t>(envelope.info.sequence),
                               .publish_ns = publish_ns};
  parts_.assign({std::as_bytes(std::span(&head, 1)), mcap::bytes_of(scratch_)});
  bool is_kept = false;
  // Readers would reject a dump with a larger one.
  if (detail::serialized_size(*envelope.payload) <= mcap::kMostMessageBytes) {
    const std::span<const mcap::Bytes> message = serializer_.serialize(*envelope.payload);
    parts_.insert(parts_.end(), message.begin(), message.end());
    is_kept = ring_->append(to_kind(FlightKind::kMessage), publish_ns, parts_);
  }
  if (!is_kept) {
    ++states_[stream.index].too_large;
    return;
  }
  ++messages_;
  bytes_ += serializer_.size();
  if (stream.latched > 0) {
    remember(stream);
  }
}

/// Keeps a copy of the record just appended to the ring.
void FlightRecorder::remember(const Stream& stream) {
  std::vector<std::byte> copy;
  for (const mcap::Bytes part : parts_) {
    copy.insert(copy.end(), part.begin(), part.end());
  }
  auto& latched = states_[stream.index].latched;
  latched.push_back(std::move(copy));
  if (latched.size() > stream.latched) {
    latched.pop_front();
  }
}

/// Appends the valid latched messages again, so that the ring always has them. Leaves out those
/// larger than a share of it.
void FlightRecorder::repeat_latched() {
  const std::uint64_t share = ring_->capacity() / kRepeats / 4;
  std::uint64_t bytes = 0;
  for (const StreamState& state : states_) {
    for (const std::vector<std::byte>& message : state.latched) {
      bytes += message.size();
      if (bytes <= share) {
        const mcap::Bytes part(message);
        ring_->append(to_kind(FlightKind::kLatched), base::to_ns(clock_.now()), {&part, 1});
      }
    }
  }
  repeated_at_ = ring_->mark().position;
}

void FlightRecorder::keep_activations() {
  activations_.read([this](const NewActivations& its) {
    log::Activations message;
    message.set_worker(static_cast<std::uint32_t>(its.worker));
    set_incarnation(message, its.incarnation);
    message.set_lost(its.lost);
    for (const detail::ActivationRecord& activation : its.records) {
      const SeenReads& seen = activations_.seen_in(activation);
      reads_lost_ += seen.lost;
      add(message, activation, seen, streams_.leaves_out(activation.publisher));
    }
    activations_lost_ += its.lost;
    scratch_.clear();
    message.AppendToString(&scratch_);
    const mcap::Bytes part = mcap::bytes_of(scratch_);
    if (!ring_->append(to_kind(FlightKind::kActivations), base::to_ns(clock_.now()), {&part, 1})) {
      activations_lost_ += its.records.size();
    }
  });
}

/// Records the losses since the last time in the ring.
void FlightRecorder::note_losses() {
  for (const Stream& stream : streams_.all()) {
    StreamState& state = states_[stream.index];
    const std::uint64_t overflow = stream.lane->overflowed.get();
    const std::uint64_t pool = stream.lane->dropped_by_pool.get();
    const std::uint64_t process = lost_between_processes(*stream.lane);
    if (overflow == state.overflow && pool == state.pool && process == state.process &&
        state.too_large == state.too_large_noted) {
      continue;
    }
    const FlightLoss loss{
        .channel = stream.channel,
        .overflow = overflow - std::exchange(state.overflow, overflow),
        .pool = pool - std::exchange(state.pool, pool),
        .too_large = state.too_large - std::exchange(state.too_large_noted, state.too_large),
        .process = process - std::exchange(state.process, process)};
    const mcap::Bytes part = std::as_bytes(std::span(&loss, 1));
    ring_->append(to_kind(FlightKind::kLoss), base::to_ns(clock_.now()), {&part, 1});
  }
}

/// Records the position of the ring, so that a dump need not read what came long before its begin.
void FlightRecorder::note_mark(std::int64_t now_ns) {
  const std::int64_t step_ns = options_.before.count() / kMarks;
  if (marks_.empty() || now_ns > marks_.back().time_ns + step_ns) {
    marks_.push_back({.time_ns = now_ns, .mark = ring_->mark()});
  }
  // A trigger may be a little older than the time at which it is noticed.
  constexpr std::int64_t kSlackNs = 1'000'000'000;
  const std::int64_t old_ns = now_ns - options_.before.count() - kSlackNs;
  while (marks_.size() > 1 && marks_[1].time_ns <= old_ns) {
    marks_.pop_front();
  }
}

FlightMark FlightRecorder::mark_before(std::int64_t time_ns) const {
  FlightMark mark;  // The beginning of the run.
  for (const TimedMark& other : marks_) {
    if (other.time_ns > time_ns) {
      break;
    }
    mark = other.mark;
  }
  return mark;
}

void FlightRecorder::trigger(std::string_view reason, std::string_view component,
                             std::string_view detail) noexcept {
  for (TriggerSlot& slot : slots_) {
    auto expected = TriggerSlot::State::kFree;
    if (slot.state.compare_exchange_strong(expected, TriggerSlot::State::kWriting,
                                           std::memory_order_acquire, std::memory_order_relaxed)) {
      slot.time_ns = base::to_ns(clock_.now());
      put(slot.reason, reason);
      put(slot.component, component);
      put(slot.detail, detail);
      slot.state.store(TriggerSlot::State::kReady, std::memory_order_release);
      return;
    }
  }
  triggers_refused_.fetch_add(1, std::memory_order_relaxed);
}

void FlightRecorder::collect_triggers() {
  std::vector<FlightTrigger> triggers;
  for (TriggerSlot& slot : slots_) {
    if (slot.state.load(std::memory_order_acquire) == TriggerSlot::State::kReady) {
      triggers.push_back({.time_ns = slot.time_ns,
                          .reason = slot.reason.data(),
                          .component = slot.component.data(),
                          .detail = slot.detail.data()});
      slot.state.store(TriggerSlot::State::kFree, std::memory_order_release);
    }
  }
  // In simulated time the order must not depend on worker speed.
  std::ranges::sort(triggers);
  for (FlightTrigger& trigger : triggers) {
    add_trigger(std::move(trigger));
  }
}

void FlightRecorder::add_trigger(FlightTrigger trigger) {
  const std::int64_t end_ns = trigger.time_ns + options_.after.count();
  if (!windows_.empty()) {
    FlightWindow& last = windows_.back();
    const std::int64_t since_first = trigger.time_ns - last.triggers.front().time_ns;
    if (trigger.time_ns <= last.end_ns && since_first <= options_.before.count()) {
      last.end_ns = std::max(last.end_ns, end_ns);
      ++last.trigger_count;
      if (last.triggers.size() < kTriggersInWords) {
        last.triggers.push_back(std::move(trigger));
      }
      return;
    }
  }
  if (dump_count_ == kDumpsMax) {
    triggers_refused_.fetch_add(1, std::memory_order_relaxed);
    if (!std::exchange(is_limit_reported_, true)) {
      on_news(true,
              fmt::format("{} dumps were asked for in this run: no more are written", kDumpsMax));
    }
    return;
  }
  ++dump_count_;
  const std::int64_t begin_ns = trigger.time_ns - options_.before.count();
  windows_.push_back({.triggers = {std::move(trigger)},
                      .begin_ns = begin_ns,
                      .end_ns = end_ns,
                      .from = mark_before(begin_ns)});
}

void FlightRecorder::hand_over_what_is_due(std::int64_t now_ns) {
  // A publisher may have been delayed between its time stamp and its push.
  const std::int64_t slack_ns = clock_.is_simulated() ? 0 : std::chrono::nanoseconds(kPoll).count();
  while (!windows_.empty() && now_ns > windows_.front().end_ns + slack_ns) {
    hand_over(windows_.front());
    windows_.pop_front();
  }
}

void FlightRecorder::hand_over(const FlightWindow& window) {
  repeat_latched();
  Job job{.window = window, .reader = nullptr};
  try {
    job.reader = std::make_unique<FlightRingReader>(*ring_, window.from);
  } catch (const std::exception& error) {
    finish({.trigger = window.triggers.front(), .problem = error.what()});
    return;
  }
  if (clock_.is_simulated()) {
    finish(write_dump(*job.reader, window, options_.file));
    return;
  }
  const std::lock_guard lock(mutex_);
  jobs_.push_back(std::move(job));
  changed_.notify_all();
}

void FlightRecorder::write_dumps() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return !jobs_.empty() || stops_dumping_; });
    if (jobs_.empty()) {
      return;
    }
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    finish(write_dump(*job.reader, job.window, options_.file));
    lock.lock();
  }
}

void FlightRecorder::finish(FlightDump dump) {
  const bool is_trouble = !dump.problem.empty();
  on_news(is_trouble,
          is_trouble ? "a dump could not be written: " + dump.problem : "wrote " + in_words(dump));
  const std::lock_guard lock(mutex_);
  dumps_.push_back(std::move(dump));
}

void FlightRecorder::stop() {
  if (ring_ != nullptr && std::exchange(is_started_, false)) {
    const auto set = [this](bool& flag) {
      const std::lock_guard lock(mutex_);
      flag = true;
      changed_.notify_all();
    };
    if (!clock_.is_simulated()) {
      set(stops_taking_);
      polling_.join();
    }
    take();
    collect_triggers();
    for (; !windows_.empty(); windows_.pop_front()) {
      hand_over(windows_.front());
    }
    if (!clock_.is_simulated()) {
      set(stops_dumping_);
      dumping_.join();
    }
  }
  if (ring_ != nullptr) {
    ring_->close();
  }
}

FlightReport FlightRecorder::report() const {
  FlightReport report{.file = options_.file,
                      .capacity = ring_ != nullptr ? ring_->capacity() : 0,
                      .messages = messages_,
                      .bytes = bytes_,
                      .activations_lost = activations_lost_,
                      .reads_lost = reads_lost_,
                      .problem = problem_,
                      .dumps = dumps_,
                      .triggers_refused = triggers_refused_.load(std::memory_order_relaxed)};
  for (const Stream& stream : streams_.all()) {
    report.overflow += stream.lane->overflowed.get();
    report.pool += stream.lane->dropped_by_pool.get();
    report.process += lost_between_processes(*stream.lane);
    report.too_large += states_[stream.index].too_large;
  }
  return report;
}

}  // namespace fastcycle::record
