#include "replay/exact_replay.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "broker/pool.h"
#include "broker/quality.h"
#include "broker/topics.h"
#include "component/declared_states.h"
#include "component/key_frame.h"
#include "component/repeat_event.h"
#include "config/nearest.h"
#include "executor/activation.h"
#include "executor/life_step.h"
#include "replay/message_difference.h"
#include "replay/stand_in.h"

namespace fastcycle::host {

using detail::Cause;
using detail::ComponentCore;
using detail::Envelope;
using detail::LifeStep;
using detail::PublisherCore;
using record::RecordedActivation;

namespace {

/// Whether a reload took place. One that is refused does nothing; each other one waits for the
/// threads of the object first, which is recorded also if there are none.
bool is_reload(const RecordedActivation& activation) {
  const auto is_of_threads = [](const detail::ReplayedReads::Entry& entry) {
    return entry.read.kind == detail::ReadKind::kThreads;
  };
  return activation.cause == Cause::kMode && activation.key == detail::to_key(LifeStep::kReload) &&
         (activation.outcome != detail::Outcome::kDone ||
          std::ranges::any_of(activation.reads, is_of_threads));
}

bool is_caused_by_message(const RecordedActivation& activation) {
  return activation.publisher != 0;
}

const char* to_word(LifeStep step) {
  switch (step) {
    case LifeStep::kStart:
      return "start()";
    case LifeStep::kBeginTimers:
      return "the start of the timers";
    case LifeStep::kActivate:
    case LifeStep::kToolStart:
      return "activate()";
    case LifeStep::kDeactivate:
    case LifeStep::kToolStop:
      return "deactivate()";
    case LifeStep::kEndTimers:
      return "the end of the timers";
    case LifeStep::kStop:
      return "stop()";
    case LifeStep::kClose:
      return "the end of its subscriptions";
    case LifeStep::kAlarm:
    case LifeStep::kRenew:
      return "a restart";
    case LifeStep::kReload:
    case LifeStep::kRollBack:
    case LifeStep::kConfirm:
      return "a reload";
    case LifeStep::kOther:
      break;
  }
  return "a step of its life cycle";
}

}  // namespace

/// The messages of one publisher that are built from recorded bytes.
class ExactReplay::StorePool {
 public:
  StorePool(const google::protobuf::Message& type, std::size_t roots)
      : pool_(new detail::Pool(&type, roots)) {}
  StorePool(const StorePool&) = delete;
  StorePool& operator=(const StorePool&) = delete;
  ~StorePool() { pool_->close(); }

  [[nodiscard]] Envelope* take() {
    pool_->collect();
    Envelope* envelope = pool_->take();
    if (envelope == nullptr) {
      pool_->grow(1);
      envelope = pool_->take();
    }
    return envelope;
  }
  void put_back(Envelope* envelope) noexcept { pool_->put_back(envelope); }

 private:
  detail::Pool* const pool_;
};

/// The messages that one component publishes in an activation; received only by this replay.
class ExactReplay::Outputs final : public detail::Stage {
 public:
  struct Output {
    PublisherCore* publisher;
    Envelope* envelope;
    std::string bytes = {};
  };
  void put(PublisherCore& publisher, Envelope* envelope) override {
    all.push_back({&publisher, envelope});
  }
  std::vector<Output> all;
};

/// One component.
struct ExactReplay::Player {
  ComponentCore* core = nullptr;
  const record::RecordedSchedule::Component* recorded = nullptr;  ///< Null: not in the log.
  bool is_wanted = false;
  std::size_t end = 0;  ///< Number of activations that can be executed.
  std::size_t next = 0;
  bool is_beginning = false;  ///< `next` is the activation of its key frame.
  std::map<PublisherId, std::uint64_t> begun_after = {};  ///< Published before the key frame.
  bool is_running = false;
  ExactReplayResult result = {};

  // During an activation.
  std::vector<std::pair<Key, Envelope*>> inputs = {};
  Outputs outputs = {};
  detail::Stage* own_stage = nullptr;  ///< The stage replaced by the outputs.
  detail::ReplayedReads replayed = {};
  std::unique_ptr<detail::ActivationRing> ring = {};
  std::vector<std::pair<Source, OutputDifference>> noted = {};
  bool is_astray = false;  ///< It ended differently than recorded.
  record::Serializer serializer = {};

  [[nodiscard]] bool is_over() const { return !is_wanted || next >= end; }
  [[nodiscard]] const RecordedActivation& activation() const { return recorded->activations[next]; }
  /// Whether the message was published before the key frame at which the component begins.
  [[nodiscard]] bool is_before(PublisherId publisher, std::uint64_t sequence) const {
    const auto found = begun_after.find(publisher);
    return found != begun_after.end() && sequence <= found->second;
  }
};

namespace {

bool is_key_frame(const RecordedActivation& activation) {
  return std::ranges::any_of(activation.reads, [](const auto& entry) {
    return entry.read.kind == detail::ReadKind::kFrameNumber;
  });
}

}  // namespace

ExactReplay::ExactReplay(ApplicationHost& application, RecordedDriver& driver,
                         const record::RecordedSchedule& schedule, ExactReplayOptions options,
                         config::Problems& problems)
    : application_(application),
      driver_(driver),
      schedule_(schedule),
      options_(std::move(options)),
      reader_(options_.files) {
  for (const auto& [name, topic] : application_.wiring().topics().all()) {
    for (const auto& publisher : topic->publishers) {
      publishers_[publisher->id] = publisher.get();
    }
  }
  for (const record::RecordedStream& stream : reader_.streams()) {
    recorded_publishers_.insert(stream.publisher_id);
  }
  for (const auto& core : application_.components()) {
    auto player = std::make_unique<Player>();
    player->core = core.get();
    player->recorded = schedule_.find(core->name);
    player->result.component = core->name;
    player->result.is_component = core->component_class.create != stand_in_class().create;
    if (player->recorded != nullptr) {
      player->result.recorded = player->recorded->activations.size();
      player->end = player->recorded->activations.size();
    }
    players_.push_back(std::move(player));
  }
  choose(problems);
  count_uses();
}

ExactReplay::~ExactReplay() {
  for (auto& [key, entry] : entries_) {
    for (Envelope* envelope : {entry.envelope, entry.unstamped}) {
      if (envelope != nullptr) {
        detail::release(envelope);
      }
    }
  }
  for (const auto& player : players_) {
    player->core->publishing.replayed = nullptr;
    if (player->own_stage != nullptr) {
      player->core->publishing.stage = player->own_stage;
    }
  }
}

ExactReplay::Player* ExactReplay::find_player(const std::string& component) {
  const auto found = std::ranges::find_if(
      players_, [&](const auto& player) { return player->core->name == component; });
  return found == players_.end() ? nullptr : found->get();
}

PublisherCore* ExactReplay::publisher(PublisherId id) const {
  const auto found = publishers_.find(id);
  return found == publishers_.end() ? nullptr : found->second;
}

bool ExactReplay::comes_from_log(const Key& key) const {
  const auto producer = producers_.find(key.publisher);
  return comes_from_log(key.publisher) ||
         (producer != producers_.end() && producer->second->is_before(key.publisher, key.sequence));
}

bool ExactReplay::comes_from_log(PublisherId id) const {
  const bool is_recorded = recorded_publishers_.contains(id);
  return options_.input == ExactReplayOptions::Input::kRecorded ? is_recorded
                                                                : !producers_.contains(id);
}

// ---- Selection of components ----

/// Why the activations from the first gap on cannot be executed; empty if there is none.
std::string ExactReplay::find_gap(const record::RecordedSchedule::Component& recorded,
                                  std::size_t first) {
  std::uint64_t expected = recorded.activations[first].number;
  for (std::size_t i = first; i < recorded.activations.size(); ++i) {
    const RecordedActivation& activation = recorded.activations[i];
    if (activation.number != expected) {
      return fmt::format("the log has no activation {}: the recorder could not take it", expected);
    }
    if (activation.reads_lost > 0 && i > first) {
      return fmt::format(
          "{} reads of activation {} or one before it came faster than the recorder took them",
          activation.reads_lost, expected);
    }
    ++expected;
  }
  return {};
}

/// Why `player` cannot be executed at all; empty if it can.
std::string ExactReplay::why_not(const Player& player) const {
  if (!player.result.is_component) {
    return "it is no component of the application: what it published is taken from the log";
  }
  if (player.recorded == nullptr) {
    return "the log does not know it";
  }
  const auto& activations = player.recorded->activations;
  if (activations.empty()) {
    return "the log has no activation of it";
  }
  const auto reload = std::ranges::find_if(activations, is_reload);
  const bool begins_reloaded =
      reload == activations.end()
          ? schedule_.facts.contains(fmt::format("reloaded.{}", player.core->name))
          : player.next < activations.size() && reload->number <= activations[player.next].number;
  if (begins_reloaded) {
    return "it had been reloaded before: it ran another library than the application names";
  }
  if (activations.front().number != 1 && !player.is_beginning) {
    return fmt::format(
        "the log begins with its activation {}, and has no key frame of its state{}",
        activations.front().number,
        player.core->states == nullptr ? ": it declares none" : " with all that it needs");
  }
  if (activations.front().number == 1 && activations.front().cause == Cause::kMode &&
      activations.front().key == 0) {
    return "the log was recorded by an earlier version, and does not say what its activations saw";
  }
  for (std::size_t i = player.next; i < activations.size(); ++i) {
    const RecordedActivation& activation = activations[i];
    for (const Key& key :
         player.is_beginning&& i == player.next ? inputs_of(player) : inputs_of(activation)) {
      const PublisherCore* its = publisher(key.publisher);
      if (its == nullptr) {
        return fmt::format("a publisher of its inputs ({:016x}) is not in the application",
                           key.publisher);
      }
      if (!recorded_publishers_.contains(key.publisher) && !producers_.contains(key.publisher)) {
        return "its input \"" + its->topic.name + "\" was not recorded";
      }
    }
  }
  return {};
}

void ExactReplay::add_sources() {
  for (bool is_changed = true; is_changed;) {
    is_changed = false;
    for (const auto& player : players_) {
      if (!player->is_wanted || player->recorded == nullptr) {
        continue;
      }
      std::set<PublisherId> inputs;
      for (const RecordedActivation& activation : player->recorded->activations) {
        for (const Key& key : inputs_of(activation)) {
          inputs.insert(key.publisher);
        }
      }
      for (const PublisherId input : inputs) {
        const PublisherCore* its = publisher(input);
        if (its == nullptr || recorded_publishers_.contains(input) || its->options.is_external) {
          continue;
        }
        Player* const source = find_player(its->owner.name);
        if (source != nullptr && !source->is_wanted && source->recorded != nullptr) {
          source->is_wanted = true;
          source->result.is_source = true;
          is_changed = true;
        }
      }
    }
  }
}

void ExactReplay::choose(config::Problems& problems) {
  std::vector<std::string> known;
  for (const auto& player : players_) {
    known.push_back(player->core->name);
  }
  for (const std::string& name : options_.components) {
    if (Player* player = find_player(name)) {
      player->is_wanted = true;
    } else {
      problems.add(config::make_error({}, "there is no component \"" + name + "\"",
                                      config::did_you_mean(config::nearest(name, known))));
    }
  }
  for (const auto& player : players_) {
    player->is_wanted =
        player->is_wanted || (options_.components.empty() && player->recorded != nullptr);
  }
  add_sources();
  choose_frames();
  const auto note_producers = [this] {
    producers_.clear();
    for (const auto& player : players_) {
      if (player->is_wanted) {
        for (const PublisherId id : player->core->publishing.publishers) {
          if (PublisherCore* its = publisher(id); its != nullptr && !its->options.is_external) {
            producers_[id] = player.get();
          }
        }
      }
    }
  };
  // A component that is excluded may be the only publisher of what another one needs.
  for (bool is_changed = true; is_changed;) {
    is_changed = false;
    note_producers();
    for (const auto& player : players_) {
      if (!player->is_wanted) {
        continue;
      }
      if (std::string why = why_not(*player); !why.empty()) {
        player->is_wanted = false;
        player->result.why = std::move(why);
        is_changed = true;
        if (!options_.components.empty() && !player->result.is_source) {
          problems.add(
              config::make_error({}, "component \"" + player->core->name +
                                         "\" cannot be executed again: " + player->result.why));
        }
      }
    }
  }
  bool is_anyone = false;
  for (const auto& player : players_) {
    if (!player->is_wanted) {
      if (player->result.why.empty() && !options_.components.empty()) {
        player->result.why = "it was not asked for";
      }
      continue;
    }
    is_anyone = true;
    player->result.is_executed = true;
    player->ring = std::make_unique<detail::ActivationRing>();
    player->own_stage = std::exchange(player->core->publishing.stage, &player->outputs);
    driver_.clock(player->core->index).restart(base::from_ns(player->activation().time_ns));
    if (std::string why = find_gap(*player->recorded, player->next); !why.empty()) {
      player->result.why = std::move(why);
      const auto& all = player->recorded->activations;
      std::uint64_t expected = player->activation().number;
      player->end = player->next;
      while (all[player->end].number == expected++ &&
             (all[player->end].reads_lost == 0 || player->end == player->next)) {
        ++player->end;
      }
    }
    // An unfinished activation is the last in the log: it crashed, or the log was cut off.
    if (player->end > player->next &&
        player->recorded->activations[player->end - 1].outcome == detail::Outcome::kRunning) {
      --player->end;
      player->result.why = fmt::format("activation {} had not ended when the log did",
                                       player->recorded->activations[player->end].number);
    }
    const auto& all = player->recorded->activations;
    const auto reload = std::ranges::find_if(all, is_reload);
    if (const auto place = static_cast<std::size_t>(reload - all.begin());
        reload != all.end() && place < player->end) {
      player->end = place;
      player->result.why = fmt::format(
          "it was reloaded in activation {}: what follows is of another library", reload->number);
    }
    if (player->result.why.empty() && player->recorded->is_restarted) {
      player->result.why = fmt::format("its process was restarted after activation {}",
                                       player->recorded->activations.back().number);
    }
    total_ += player->end - player->next;
  }
  if (!is_anyone && !problems.has_errors()) {
    std::string why;
    for (const auto& player : players_) {
      if (!player->result.why.empty()) {
        why = "component \"" + player->core->name + "\": " + player->result.why;
        break;
      }
    }
    problems.add(config::make_error(
        {.file = options_.files.front().string(), .line = 0, .pointer = {}},
        "there is nothing that can be executed again" + (why.empty() ? why : "; " + why)));
  }
}

std::vector<ExactReplay::Key> ExactReplay::inputs_of(const RecordedActivation& activation) {
  std::vector<Key> inputs;
  for (const detail::ReplayedReads::Entry& entry : activation.reads) {
    if (entry.read.kind == detail::ReadKind::kTaken) {
      inputs.push_back({entry.read.publisher, entry.read.value});
    }
  }
  if (is_caused_by_message(activation)) {
    inputs.push_back({activation.publisher, activation.key});
  }
  return inputs;
}

std::vector<ExactReplay::Key> ExactReplay::inputs_of(const Player& player) {
  if (!player.is_beginning) {
    return inputs_of(player.activation());
  }
  std::vector<Key> inputs;
  for (const detail::ReplayedReads::Entry& entry : player.activation().reads) {
    if (entry.read.kind == detail::ReadKind::kKeyFrame ||
        entry.read.kind == detail::ReadKind::kHeld) {
      inputs.push_back({entry.read.publisher, entry.read.value});
    }
  }
  return inputs;
}

/// The publish times of messages that the log does not have.
void ExactReplay::note_publish_times(const RecordedActivation& activation) {
  for (std::size_t i = 1; i < activation.reads.size(); ++i) {
    const detail::Read& read = activation.reads[i].read;
    const detail::Read& before = activation.reads[i - 1].read;
    if (read.kind == detail::ReadKind::kPublished && before.kind == detail::ReadKind::kTaken) {
      entries_[{before.publisher, before.value}].published =
          base::from_ns(static_cast<std::int64_t>(read.value));
    }
  }
  if (is_caused_by_message(activation) && !recorded_publishers_.contains(activation.publisher)) {
    entries_[{activation.publisher, activation.key}].published =
        base::from_ns(activation.time_ns - activation.late_ns);
  }
}

void ExactReplay::count_uses() {
  for (const auto& player : players_) {
    if (!player->is_wanted || player->next >= player->end) {
      continue;
    }
    for (const Key& key : inputs_of(*player)) {
      ++entries_[key].uses;
    }
    if (!player->is_beginning) {
      note_publish_times(player->activation());
    }
    for (std::size_t i = player->next + 1; i < player->end; ++i) {
      for (const Key& key : inputs_of(player->recorded->activations[i])) {
        ++entries_[key].uses;
      }
      note_publish_times(player->recorded->activations[i]);
    }
  }
}

void ExactReplay::choose_frames() {
  const bool is_asked = options_.start.has_value();
  const std::int64_t start_ns =
      base::to_ns(reader_.begin()) + options_.start.value_or(Duration(0)).count();
  const auto may_begin_at = [&](const Player& player, const RecordedActivation& activation) {
    return is_key_frame(activation) && (is_asked ? activation.time_ns <= start_ns
                                                 : player.recorded->activations[0].number != 1);
  };
  // A key frame is usable if the log has the messages that it names.
  std::set<std::pair<PublisherId, std::uint64_t>> missing;
  for (const auto& player : players_) {
    for (player->next = 0; player->is_wanted && player->next < player->end; ++player->next) {
      if (may_begin_at(*player, player->activation())) {
        player->is_beginning = true;
        for (const Key& key : inputs_of(*player)) {
          missing.emplace(key.publisher, key.sequence);
        }
      }
    }
    player->next = 0;
    player->is_beginning = false;
  }
  if (missing.empty()) {
    return;
  }
  reader_.rewind({.wanted = std::vector<bool>(reader_.streams().size(), true),
                  .from = reader_.begin(),
                  .to = reader_.end()});
  for (auto moment = reader_.next(); !moment.empty(); moment = reader_.next()) {
    for (const record::RecordedMessage& message : moment) {
      missing.erase({reader_.streams()[message.stream].publisher_id, message.info.sequence});
    }
  }
  for (const auto& player : players_) {
    if (!player->is_wanted) {
      continue;
    }
    // The first one of a log that begins in the middle; else the last one before the time.
    std::optional<std::size_t> chosen;
    for (player->next = 0; player->next < player->end; ++player->next) {
      player->is_beginning = true;
      if (may_begin_at(*player, player->activation()) &&
          std::ranges::none_of(inputs_of(*player), [&](const Key& key) {
            return missing.contains({key.publisher, key.sequence});
          })) {
        chosen = player->next;
        if (!is_asked) {
          break;
        }
      }
    }
    player->next = chosen.value_or(0);
    player->is_beginning = chosen.has_value();
    if (!chosen) {
      continue;
    }
    const RecordedActivation& frame = player->activation();
    player->result.began_after = frame.number;
    player->result.began_ns = frame.time_ns - base::to_ns(reader_.begin());
    for (const detail::ReplayedReads::Entry& entry : frame.reads) {
      if (entry.read.kind == detail::ReadKind::kSequence) {
        player->begun_after[entry.read.publisher] = entry.read.value;
      }
    }
  }
}

// ---- The workers ----

void ExactReplay::run(const Watcher& watcher) {
  std::vector<bool> wanted;
  for (const record::RecordedStream& stream : reader_.streams()) {
    wanted.push_back(publishers_.contains(stream.publisher_id));
  }
  reader_.rewind({.wanted = wanted, .from = reader_.begin(), .to = reader_.end()});
  at_work_ = options_.workers;
  {
    std::vector<std::jthread> workers;
    for (unsigned worker = 0; worker < options_.workers; ++worker) {
      workers.emplace_back([this, worker] { work(worker); });
    }
    std::unique_lock lock(mutex_);
    while (at_work_ > 0) {
      changed_.wait_for(lock, std::chrono::milliseconds(100));
      const Progress progress{.done = done_.load(), .total = total_};
      lock.unlock();
      const bool goes_on = watcher == nullptr || watcher(progress);
      lock.lock();
      is_stopped_ = is_stopped_ || !goes_on;
    }
  }
  if (error_) {
    std::rethrow_exception(error_);
  }
  end_waiting();
}

void ExactReplay::work(unsigned) {
  const detail::ServingThread serving;
  std::unique_lock lock(mutex_);
  try {
    while (!is_stopped_ && execute_next(lock)) {
    }
  } catch (...) {  // Of the log, or of the listener.
    if (!lock.owns_lock()) {
      lock.lock();
    }
    if (!error_) {  // The first one is the cause.
      error_ = std::current_exception();
    }
    is_stopped_ = true;
  }
  --at_work_;
  changed_.notify_all();
}

/// Executes a ready activation, or reads on, or waits; false if there is nothing left to do.
bool ExactReplay::execute_next(std::unique_lock<std::mutex>& lock) {
  Player* const player = next_ready();
  if (player == nullptr) {
    if (load()) {
      return true;
    }
    const auto runs = [](const auto& one) { return one->is_running; };
    if (std::ranges::none_of(players_, runs)) {
      return false;  // All have finished, or wait in vain.
    }
    changed_.wait(lock);
    return true;
  }
  const RecordedActivation& activation = player->activation();
  player->is_running = true;
  lock.unlock();
  if (player->is_beginning) {
    begin_at(*player, activation);
  } else {
    execute(*player, activation);
  }
  lock.lock();
  finish(*player, activation);
  player->is_running = false;
  ++player->next;
  done_.fetch_add(1);
  changed_.notify_all();
  return true;
}

/// The player with the earliest next activation whose inputs exist.
ExactReplay::Player* ExactReplay::next_ready() {
  Player* best = nullptr;
  for (const auto& player : players_) {
    if (player->is_running || player->is_over() ||
        (best != nullptr && best->activation().time_ns <= player->activation().time_ns)) {
      continue;
    }
    const auto is_there = [this](const Key& key) { return entries_[key].envelope != nullptr; };
    if (std::ranges::all_of(inputs_of(*player), is_there)) {
      best = player.get();
    }
  }
  if (best != nullptr) {
    best->inputs.clear();
    for (const Key& key : inputs_of(*best)) {
      Envelope* envelope = entries_[key].envelope;
      detail::retain(*envelope);
      best->inputs.emplace_back(key, envelope);
    }
  }
  return best;
}

/// Reads the next moment of the recording; false at its end.
bool ExactReplay::load() {
  if (is_loaded_) {
    return false;
  }
  const auto moment = reader_.next();
  for (record::RecordedMessage& message : moment) {
    take(message);
  }
  if (!moment.empty()) {
    return true;
  }
  is_loaded_ = true;
  bool is_anything_new = false;
  for (auto& [key, entry] : entries_) {
    is_anything_new = is_anything_new || entry.unstamped != nullptr;
    stamp(entry);
  }
  return is_anything_new;
}

/// Passes on a new message, with its recorded facts.
void ExactReplay::stamp(Entry& entry) {
  if (entry.unstamped == nullptr) {
    return;
  }
  entry.envelope = std::exchange(entry.unstamped, nullptr);
  if (entry.info) {
    entry.envelope->info = *entry.info;
  } else if (entry.published) {
    entry.envelope->info.publish_time = *entry.published;
  }
}

void ExactReplay::take(record::RecordedMessage& message) {
  const PublisherId id = reader_.streams()[message.stream].publisher_id;
  const auto producer = producers_.find(id);
  const Key key{id, message.info.sequence};
  const bool is_before =
      producer != producers_.end() && producer->second->is_before(id, key.sequence);
  const bool is_compared =
      producer != producers_.end() && !is_before && !producer->second->is_over();
  if (listener != nullptr && producer != producers_.end() && !is_before) {
    listener->is_recorded(
        *publisher(id), message.info,
        {reinterpret_cast<const char*>(message.data.data()), message.data.size()});
  }
  auto found = entries_.find(key);
  if (found == entries_.end()) {
    if (!is_compared) {
      return;
    }
    found = entries_.emplace(key, Entry{}).first;
  }
  Entry& entry = found->second;
  if (entry.uses > 0 && entry.envelope == nullptr && comes_from_log(key)) {
    entry.envelope = parse(id, message);
  }
  if (producer == producers_.end() || is_before) {
    return;
  }
  if (entry.uses > 0 && !comes_from_log(key)) {
    entry.info = message.info;
    entry.info->publisher = id;
    entry.info->origin.root = message.info.origin.root == 0 ? id : message.info.origin.root;
    stamp(entry);
  }
  std::string bytes(reinterpret_cast<const char*>(message.data.data()), message.data.size());
  if (entry.produced) {
    compare(*producer->second, entry.produced->source, *publisher(id), key.sequence, bytes,
            entry.produced->bytes);
    entry.produced.reset();
  } else if (is_compared) {
    entry.recorded = std::move(bytes);
    entry.is_recorded = true;
  }
  if (entry.uses == 0 && !entry.is_recorded) {
    entries_.erase(found);
  }
}

Envelope* ExactReplay::parse(PublisherId id, const record::RecordedMessage& message) {
  const PublisherCore& its = *publisher(id);
  auto& pool = pools_[id];
  if (pool == nullptr) {
    pool = std::make_unique<StorePool>(its.default_instance, its.root_count);
  }
  Envelope* envelope = pool->take();
  if (!envelope->own->ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    pool->put_back(envelope);
    throw std::runtime_error(
        fmt::format("topic \"{}\", message {}: expected a {}, found {} bytes that are none",
                    its.topic.name, message.info.sequence, its.topic.type, message.data.size()));
  }
  envelope->payload = envelope->own;
  envelope->info = message.info;
  envelope->info.publisher = id;
  if (envelope->info.origin.root == 0) {
    envelope->info.origin.root = id;
  }
  for (std::size_t root = 0; root < its.root_count; ++root) {
    envelope->trails[root].forget();
  }
  envelope->references.store(1, std::memory_order_relaxed);
  return envelope;
}

/// Players that still wait do so in vain.
void ExactReplay::end_waiting() {
  for (const auto& player : players_) {
    if (player->is_over()) {
      continue;
    }
    std::string why = "it was stopped";
    for (const Key& key : inputs_of(*player)) {
      if (!is_stopped_ && entries_[key].envelope == nullptr) {
        const PublisherCore* its = publisher(key.publisher);
        why = fmt::format("activation {} needs message {} of \"{}\", which the log does not have",
                          player->activation().number, key.sequence,
                          its == nullptr ? "?" : its->topic.name);
        break;
      }
    }
    player->result.why = std::move(why);
  }
  for (auto& [key, entry] : entries_) {
    const auto producer = producers_.find(key.publisher);
    if (entry.produced && producer != producers_.end()) {
      ++producer->second->result.not_recorded;
    }
  }
}

// ---- One activation ----

/// Restores the component's state after the activation of a key frame: starts it, drops what it
/// publishes meanwhile, and restores the frame's contents.
void ExactReplay::begin_at(Player& player, const RecordedActivation& frame) {
  ComponentCore& core = *player.core;
  driver_.clock(core.index).set_simulated(base::from_ns(frame.time_ns));
  const auto state = [&](const detail::Read& read) -> const google::protobuf::Message& {
    std::size_t input = 0;
    for (const detail::ReplayedReads::Entry& entry : frame.reads) {
      if (&entry.read == &read) {
        break;
      }
      input += entry.read.kind == detail::ReadKind::kKeyFrame ||
               entry.read.kind == detail::ReadKind::kHeld;
    }
    return *player.inputs[input].second->payload;
  };
  detail::begin_at_key_frame(application_, core, *player.ring, player.replayed,
                             {.activation = frame.number, .reads = frame.reads, .state = state});
  for (const Outputs::Output& output : player.outputs.all) {
    detail::release(output.envelope);
  }
  player.outputs.all.clear();
  for (const auto& [id, sequence] : player.begun_after) {
    if (PublisherCore* its = publisher(id)) {
      its->continue_after(sequence);
    }
  }
  show_views(player, frame, detail::ReadKind::kHeld);
}

void ExactReplay::execute(Player& player, const RecordedActivation& activation) {
  ComponentCore& core = *player.core;
  base::Clock& clock = driver_.clock(core.index);
  clock.set_simulated(std::max(clock.now(), base::from_ns(activation.time_ns)));
  player.replayed.begin(activation.reads);
  core.repeat_next(activation.number, player.replayed);
  if (before_activation) {
    before_activation(core, activation.number);
  }
  const std::uint64_t before = player.ring->size();
  show_views(player, activation, detail::ReadKind::kTaken);
  call(player, activation);
  if (player.ring->size() > before) {
    check_end(player, activation);
  }
  core.hand_over_stage();
  for (Outputs::Output& output : player.outputs.all) {
    output.bytes = player.serializer.serialize_to_string(*output.envelope->payload);
  }
}

/// Shows views the inputs that `activation` took beside its cause, or those of a key frame.
void ExactReplay::show_views(Player& player, const RecordedActivation& activation,
                             detail::ReadKind kind) {
  const auto& views = player.core->subscriptions.views();
  std::size_t input = 0;
  for (const detail::ReplayedReads::Entry& entry : activation.reads) {
    if (entry.read.kind == detail::ReadKind::kKeyFrame && kind == detail::ReadKind::kHeld) {
      detail::release(player.inputs[input++].second);  // It was copied.
    }
    if (entry.read.kind != kind) {
      continue;
    }
    Envelope* const envelope = player.inputs[input++].second;
    if (entry.read.place >= views.size()) {
      detail::release(envelope);
      continue;
    }
    detail::View& view = *views[entry.read.place];
    const auto lanes = view.lanes();
    const auto lane = std::ranges::find_if(
        lanes, [&](const auto& one) { return one->publisher == entry.read.publisher; });
    if (lane == lanes.end()) {
      detail::release(envelope);
      continue;
    }
    player.core->repeat_view(view, **lane, envelope);
  }
}

void ExactReplay::call(Player& player, const RecordedActivation& activation) {
  if (is_caused_by_message(activation)) {
    call_message(player, activation);
    return;
  }
  ComponentCore& core = *player.core;
  switch (activation.cause) {
    case Cause::kTick:
    case Cause::kTimeout: {
      const auto& timers = core.timers();
      if (activation.key >= timers.size()) {
        note(player, {activation.number, cause_in_words(player, activation), activation.time_ns},
             {.field = "timer", .recorded = std::to_string(activation.key), .now = "none"});
        return;
      }
      core.repeat(*player.ring, *timers[activation.key],
                  {.due = base::from_ns(activation.time_ns - activation.late_ns),
                   .skipped = activation.skipped});
      return;
    }
    case Cause::kMode:
      call_lifecycle(player, activation);
      return;
    case Cause::kEvent:
      detail::repeat_event(core, *player.ring, activation.reads, activation.key, activation.time_ns,
                           activation.skipped);
      return;
    case Cause::kParameter:
      call_params(player, activation);
      return;
    case Cause::kJob:
      call_posted(player, activation, "the end of offloaded work");
      return;
    case Cause::kReply:
      call_posted(player, activation, "an answer that it gives itself");
      return;
    case Cause::kFault:
      if ((activation.key & ComponentCore::kThreadFault) != 0) {
        call_fault_of_thread(player, activation);
      } else {
        call_posted(player, activation, "a fault");
      }
      return;
    case Cause::kConnect:  // Its callbacks cannot see who subscribes.
    case Cause::kMessage:
    case Cause::kExternal:
    case Cause::kRequest:
      return;
  }
}

void ExactReplay::call_fault_of_thread(Player& player, const RecordedActivation& activation) {
  std::string what = "one of its threads threw";  // Older logs do not contain the text.
  for (const detail::ReplayedReads::Entry& entry : activation.reads) {
    what = entry.read.kind == detail::ReadKind::kThrew ? entry.text : what;
  }
  const std::uint64_t object = activation.key & ~ComponentCore::kThreadFault;
  player.core->repeat(*player.ring,
                      {.cause = Cause::kFault,
                       .body = [&] { player.core->take_fault_of_thread(object, what); },
                       .key = activation.key});
}

void ExactReplay::call_posted(Player& player, const RecordedActivation& activation,
                              const char* what) {
  if (!player.core->repeat_posted(*player.ring, activation.cause, activation.key)) {
    note(player, {activation.number, cause_in_words(player, activation), activation.time_ns},
         {.field = what, .recorded = fmt::format("number {}", activation.key), .now = "none"});
  }
}

void ExactReplay::call_message(Player& player, const RecordedActivation& activation) {
  Envelope* const envelope = player.inputs.back().second;
  const auto& callbacks = player.core->subscriptions.callbacks();
  std::shared_ptr<detail::Lane> lane;
  if (activation.subscription && *activation.subscription < callbacks.size() &&
      callbacks[*activation.subscription]->callback != nullptr) {
    // A subscription that ended and was created again has its former lanes, too.
    for (const auto& one : callbacks[*activation.subscription]->lanes()) {
      lane = one->publisher == activation.publisher ? one : lane;
    }
  }
  if (lane == nullptr) {
    detail::release(envelope);
    note(player, {activation.number, cause_in_words(player, activation), activation.time_ns},
         {.field = "subscription",
          .recorded = activation.subscription ? std::to_string(*activation.subscription) : "?",
          .now = "none that receives it"});
    return;
  }
  player.core->repeat(*player.ring, {.lane = lane.get(),
                                     .head = {.time_ns = base::to_ns(envelope->info.publish_time),
                                              .sequence = envelope->info.sequence,
                                              .envelope = envelope,
                                              .payload = envelope->payload}});
}

void ExactReplay::call_lifecycle(Player& player, const RecordedActivation& activation) {
  ComponentCore& core = *player.core;
  const auto step = static_cast<LifeStep>(activation.key);
  for (const detail::ReplayedReads::Entry& entry : activation.reads) {
    if (entry.read.kind == detail::ReadKind::kMadeWith) {
      config::Problems problems;
      application_.commit_recorded_params(core, entry.text, problems);
      note_params(player, activation, entry.text, problems);
    }
  }
  const auto repeat = [&](std::function<void()> body) {
    core.repeat(*player.ring,
                {.cause = Cause::kMode, .body = std::move(body), .key = activation.key});
  };
  switch (step) {
    case LifeStep::kStart:
      repeat([&core] { core.call_start(); });
      return;
    case LifeStep::kBeginTimers:
      repeat([&core] { core.begin_timers(core.publishing.now); });
      return;
    case LifeStep::kActivate:
      repeat([&core] { core.call_activate(); });
      return;
    case LifeStep::kDeactivate:
      repeat([&core] { core.call_deactivate(); });
      return;
    case LifeStep::kEndTimers:
      repeat([&core] {
        core.cancel_timers();
        core.cancel_alarm();
      });
      return;
    case LifeStep::kStop:
      repeat([&core] { core.call_stop(); });
      return;
    case LifeStep::kClose:
      repeat([&core] { core.close(detail::DropReason::kShutdown); });
      return;
    case LifeStep::kRenew:
    case LifeStep::kToolStop:
    case LifeStep::kToolStart:
    case LifeStep::kConfirm:
      repeat([&core, step] { static_cast<void>(core.obey(step)); });
      return;
    case LifeStep::kAlarm:
      if (!core.repeat_alarm(*player.ring)) {
        note(player, {activation.number, cause_in_words(player, activation), activation.time_ns},
             {.field = "restart", .recorded = "goes on", .now = "none is under way"});
      }
      return;
    case LifeStep::kReload:  // It was refused: execution ends before any other.
      repeat([] {});
      return;
    case LifeStep::kRollBack:
    case LifeStep::kOther:
      return;
  }
}

/// Reports recorded values of params that the component rejects.
void ExactReplay::note_params(Player& player, const RecordedActivation& activation,
                              const std::string& recorded, const config::Problems& problems) {
  for (const config::Problem& problem : problems.all()) {
    note(player, {activation.number, cause_in_words(player, activation), activation.time_ns},
         {.field = "params", .recorded = recorded, .now = config::to_string(problem)});
  }
}

void ExactReplay::call_params(Player& player, const RecordedActivation& activation) {
  if ((activation.key & ComponentCore::kParamsAsked) == 0) {
    const auto recorded = std::ranges::find_if(activation.reads, [](const auto& entry) {
      return entry.read.kind == detail::ReadKind::kParams;
    });
    config::Problems problems;
    if (recorded != activation.reads.end()) {
      application_.put_recorded_params(*player.core, activation.key, recorded->text, problems);
      note_params(player, activation, recorded->text, problems);
    }
  }
  call_posted(player, activation, "a change of params");
}

/// Compares the end of the activation.
void ExactReplay::check_end(Player& player, const RecordedActivation& activation) {
  detail::ActivationRecord record;
  if (!player.ring->read_at(player.ring->size() - 1, record)) {
    return;
  }
  if (activation.outcome == detail::Outcome::kRunning) {
    // Its process ended in it. Activations follow, so the standby completed it, with the reads of
    // the other one; what was published then is compared as usual.
    return;
  }
  const Source source{activation.number, cause_in_words(player, activation), activation.time_ns};
  const auto end_in_words = [](detail::Outcome outcome) {
    return outcome == detail::Outcome::kFault ? "an exception" : "in order";
  };
  if (record.outcome != activation.outcome) {
    const std::string fault =
        record.outcome == detail::Outcome::kFault ? ": " + player.core->last_fault : std::string();
    note(player, source,
         {.field = "its end",
          .recorded = end_in_words(activation.outcome),
          .now = end_in_words(record.outcome) + fault});
    player.is_astray = true;
  } else if (record.publish_count != activation.publish_count) {
    note(player, source,
         {.field = "messages published",
          .recorded = std::to_string(activation.publish_count),
          .now = std::to_string(record.publish_count)});
  } else if (player.replayed.has_missed()) {
    note(player, source,
         {.field = "what it asks for",
          .recorded = "less",
          .now = "credits, subscribers, the mode or something observed beyond that"});
  }
}

/// Records a difference found while the activation is executed, without the mutex.
void ExactReplay::note(Player& player, Source source, OutputDifference difference) {
  player.noted.emplace_back(std::move(source), std::move(difference));
}

/// Takes over what the activation published, and releases its inputs. The mutex is held.
void ExactReplay::finish(Player& player, const RecordedActivation& activation) {
  player.result.activations += std::exchange(player.is_beginning, false) ? 0 : 1;
  for (auto& [source, difference] : player.noted) {
    differ(player, source, std::move(difference));
  }
  player.noted.clear();
  if (player.is_astray) {
    // From here on its state differs from the recorded run.
    player.end = player.next + 1;
    player.result.why = "what follows cannot be compared";
  }
  for (const auto& [key, envelope] : player.inputs) {
    const auto found = entries_.find(key);
    if (found == entries_.end()) {
      continue;
    }
    Entry& entry = found->second;
    if (--entry.uses > 0) {
      continue;
    }
    detail::release(std::exchange(entry.envelope, nullptr));
    if (!entry.is_recorded && !entry.produced) {
      entries_.erase(found);
    }
  }
  const Source source{activation.number, cause_in_words(player, activation), activation.time_ns};
  for (Outputs::Output& output : player.outputs.all) {
    const Key key{output.publisher->id, output.envelope->info.sequence};
    const auto found = entries_.try_emplace(key).first;
    Entry& entry = found->second;
    if (listener != nullptr && recorded_publishers_.contains(key.publisher)) {
      listener->is_published(*output.publisher, {source.activation, source.cause, source.time_ns},
                             key.sequence, output.bytes);
    }
    if (entry.is_recorded) {
      compare(player, source, *output.publisher, key.sequence, entry.recorded, output.bytes);
      entry.is_recorded = false;
      entry.recorded = {};
    } else if (recorded_publishers_.contains(key.publisher)) {
      entry.produced = Produced{source, std::move(output.bytes)};
    } else {
      ++player.result.not_recorded;  // Its topic was not recorded.
    }
    if (entry.uses > 0 && entry.envelope == nullptr && !comes_from_log(key)) {
      entry.unstamped = output.envelope;
      if (entry.info || is_loaded_ || !recorded_publishers_.contains(key.publisher)) {
        stamp(entry);
      }
    } else {
      detail::release(output.envelope);
    }
    if (entry.uses == 0 && !entry.is_recorded && !entry.produced) {
      entries_.erase(found);
    }
  }
  player.outputs.all.clear();
  if (listener != nullptr) {
    listener->has_executed(player.core->name, activation.time_ns);
  }
}

void ExactReplay::compare(Player& player, const Source& source, const PublisherCore& its,
                          std::uint64_t sequence, const std::string& recorded,
                          const std::string& now) {
  ++player.result.outputs;
  if (recorded == now) {
    ++player.result.equal;
    return;
  }
  OutputDifference difference{.topic = its.topic.name, .sequence = sequence};
  if (!player.result.first_difference) {
    const std::unique_ptr<google::protobuf::Message> then(its.default_instance.New());
    const std::unique_ptr<google::protobuf::Message> again(its.default_instance.New());
    if (then->ParseFromString(recorded) && again->ParseFromString(now)) {
      for_each_difference(*then, *again, [&](const FieldDifference& field) {
        if (difference.field.empty()) {
          difference.field = field.path();
          difference.recorded = field.recorded();
          difference.now = field.now();
        }
      });
    }
    if (difference.field.empty()) {
      difference.field = "(bytes)";
      difference.recorded = fmt::format("{} bytes", recorded.size());
      difference.now = fmt::format("{} other bytes", now.size());
    }
  }
  differ(player, source, std::move(difference));
}

void ExactReplay::differ(Player& player, const Source& source, OutputDifference difference) {
  ++player.result.differences;
  const auto& first = player.result.first_difference;
  if (first && first->activation <= source.activation) {
    return;
  }
  difference.activation = source.activation;
  difference.cause = source.cause;
  difference.time_ns = source.time_ns - base::to_ns(reader_.begin());
  player.result.first_difference = std::move(difference);
}

std::string ExactReplay::cause_in_words(const Player& player,
                                        const RecordedActivation& activation) const {
  if (is_caused_by_message(activation)) {
    const PublisherCore* its = publisher(activation.publisher);
    return fmt::format("message {} of \"{}\"", activation.key,
                       its == nullptr ? "?" : its->topic.name);
  }
  switch (activation.cause) {
    case Cause::kTick:
    case Cause::kTimeout:
      return activation.key < player.core->timer_labels.size()
                 ? player.core->timer_labels[activation.key]
                 : fmt::format("timer {}", activation.key);
    case Cause::kMode:
      return to_word(static_cast<LifeStep>(activation.key));
    default:
      return detail::to_word(activation.cause);
  }
}

std::vector<ExactReplayResult> ExactReplay::results() const {
  std::vector<ExactReplayResult> results;
  for (const auto& player : players_) {
    if (player->recorded != nullptr || player->is_wanted) {
      results.push_back(player->result);
    }
  }
  return results;
}

}  // namespace fastcycle::host
