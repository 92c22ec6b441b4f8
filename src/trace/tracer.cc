#include "trace/tracer.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "component/time_driver.h"
#include "component/words.h"
#include "host/application.h"

namespace fastcycle::trace {
namespace {

using detail::ActivationRecord;
using detail::Cause;
using detail::Outcome;

/// How long a slice waits for the activation that published its message: callbacks that take longer
/// have no outgoing flows.
constexpr std::int64_t kPatienceNs = 1'000'000'000;
constexpr std::size_t kWaitingMax = 16'384;  // Slices of one worker.
constexpr std::size_t kPastMax = 1024;       // Activations of one component.
constexpr int kPollsPerLedger = 20;
constexpr int kPollsPerLook = 200;  // For new subscriptions.

std::int64_t read_clock(clockid_t id) {
  timespec time{};
  clock_gettime(id, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

/// The threads of this process, by name.
std::multimap<std::string, std::int64_t> threads_by_name() {
  std::multimap<std::string, std::int64_t> threads;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", error)) {
    std::string name;
    std::getline(std::ifstream(entry.path() / "comm"), name);
    threads.emplace(name, std::strtoll(entry.path().filename().c_str(), nullptr, 10));
  }
  return threads;
}

/// "serve", "timer 2", "timeout of the reply of "route""
std::string name_of_timer(const detail::TimerCore& timer) {
  constexpr std::string_view kBegin = "its callback for ";
  const detail::TimerRole& role = timer.role;
  if (role.label.starts_with(kBegin)) {
    return fmt::format("{} of {}", detail::to_word(role.cause),
                       std::string_view(role.label).substr(kBegin.size()));
  }
  return role.name.empty() ? fmt::format("timer {}", timer.number) : role.name;
}

/// The id of a flow, unique for each message and activation.
std::uint64_t flow_id(const ActivationRecord& record) {
  std::uint64_t hash = record.publisher;
  for (const std::uint64_t part : {record.key, std::uint64_t{record.component}, record.number}) {
    // The finalizer of splitmix64: https://prng.di.unimi.it/splitmix64.c
    hash += 0x9e3779b97f4a7c15U + part;
    hash = (hash ^ (hash >> 30U)) * 0xbf58476d1ce4e5b9U;
    hash = (hash ^ (hash >> 27U)) * 0x94d049bb133111ebU;
    hash ^= hash >> 31U;
  }
  return hash == 0 ? 1 : hash;
}

}  // namespace

Tracer::Tracer(config::TraceDescription description, std::vector<std::filesystem::path> inputs)
    : description_(std::move(description)),
      file_(description_.file, description_.buffer_bytes, std::move(inputs)),
      notes_(std::make_unique<std::array<Note, kNotes>>()) {
  for (std::size_t i = 0; i < kNotes; ++i) {
    (*notes_)[i].turn.store(i, std::memory_order_relaxed);
  }
}

Tracer::~Tracer() {
  end_reading();
}

void Tracer::end_reading() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    changed_.notify_all();
  }
  reading_.join();
}

void Tracer::open(config::Problems& problems) {
  try {
    file_.open();
  } catch (const std::runtime_error& error) {
    problems.add(config::make_error(description_.place,
                                    std::string("the trace cannot be written: ") + error.what()));
  }
}

std::int64_t Tracer::now_ns() const {
  return clock_->is_simulated() ? base::to_ns(clock_->now()) : base::monotonic_ns();
}

/// Converts `time_ns` of the application's clock to the trace's.
std::int64_t Tracer::to_trace(std::int64_t time_ns) const {
  return clock_->is_simulated() ? time_ns : clock_->monotonic_at(base::from_ns(time_ns));
}

std::uint64_t Tracer::new_track(std::uint64_t parent, std::string name, bool is_counter) {
  const std::uint64_t id = next_track_++;
  packets_.add(
      Track{.id = id, .parent = parent, .name = std::move(name), .is_counter = is_counter});
  return id;
}

void Tracer::describe_tracks(const host::ObserverView& view) {
  const host::Application& application = view.application;
  const bool is_simulated = clock_->is_simulated();
  process_track_ = next_track_++;
  packets_.add(
      Track{.id = process_track_,
            .name = application.description().name + (is_simulated ? " (simulated time)" : ""),
            .process = getpid()});
  for (const auto& component : application.components()) {
    ComponentState state{.name = component->name};
    for (const auto& timer : component->timers()) {
      state.timers.push_back(name_of_timer(*timer));
    }
    const bool is_elsewhere = !view.peers.empty() && components_.size() < view.reads.size() &&
                              view.reads[components_.size()] == nullptr;
    if (is_simulated && !is_elsewhere) {
      state.track = new_track(process_track_, component->name);
    }
    components_.push_back(std::move(state));
  }
  for (const detail::ActivationRing* ring : view.rings) {
    workers_.push_back({.ring = ring});
  }
  if (!is_simulated) {
    describe_workers(application);
  }
  describe_peers(view);
}

void Tracer::describe_workers(const host::Application& application) {
  // The rings are in the same order.
  auto threads = threads_by_name();
  const std::vector<std::string> names = host::worker_names(application.description());
  for (std::size_t next = 0; next < std::min(names.size(), workers_.size()); ++next) {
    const auto thread = threads.find(names[next].substr(0, 15));
    workers_[next].track = next_track_++;
    packets_.add(Track{.id = workers_[next].track,
                       .parent = process_track_,
                       .name = names[next],
                       .process = getpid(),
                       .thread = thread == threads.end()
                                     ? getpid() + 1 + static_cast<std::int64_t>(next)
                                     : thread->second});
    if (thread != threads.end()) {
      threads.erase(thread);
    }
  }
}

/// Describes other processes; their tracks follow when they exist.
void Tracer::describe_peers(const host::ObserverView& view) {
  for (const detail::PeerActivity* const peer : view.peers) {
    const auto& first = peer->rings(1);
    for (std::size_t place = 0; place < first.reads.size(); ++place) {
      if (first.reads[place] != nullptr) {
        components_[place].peer = peer;
      }
    }
    peers_.push_back({.peer = peer, .first_worker = workers_.size()});
    for (std::size_t place = 0; place < first.workers.size(); ++place) {
      workers_.push_back({.peer = peer});
    }
  }
}

/// Describes a process that has started, or was restarted.
void Tracer::describe_process(const PeerState& its) {
  const bool is_simulated = clock_->is_simulated();
  const std::uint64_t track = next_track_++;
  packets_.add(Track{.id = track,
                     .name = its.peer->name() + (is_simulated ? " (simulated time)" : ""),
                     .process = its.peer->pid()});
  for (ComponentState& component : components_) {
    if (is_simulated && component.peer == its.peer) {
      component.track = new_track(track, component.name);
    }
  }
  const auto& rings = its.peer->rings(its.incarnation).workers;
  for (std::size_t place = 0; place < rings.size() && !is_simulated; ++place) {
    const std::uint64_t row = next_track_++;
    workers_[its.first_worker + place].track = row;
    packets_.add(Track{.id = row,
                       .parent = track,
                       .name = its.peer->worker_names()[place],
                       .process = its.peer->pid(),
                       .thread = its.peer->pid() + 1 + static_cast<std::int64_t>(place)});
  }
  static_cast<void>(hand_over());
}

void Tracer::describe_publishers(const detail::Topics& topics) {
  for (const auto& [name, topic] : topics.all()) {
    for (const auto& publisher : topic->publishers) {
      PublisherState state{.topic = name, .name = packets_.name("publish " + name)};
      const auto component =
          std::ranges::find(components_, publisher->owner.name, &ComponentState::name);
      state.component = static_cast<std::size_t>(component - components_.begin());
      const bool is_external = publisher->options.is_external && !publisher->is_imported;
      if (is_external || component == components_.end()) {
        state.external_track = new_track(process_track_, name + " from outside");
      }
      publishers_.emplace(publisher->id, std::move(state));
    }
  }
}

void Tracer::start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) {
  application_ = &view.application;
  clock_ = &application_->clock();
  start_ns_ = now_ns();
  if (clock_->is_simulated()) {
    packets_.add(
        Packets::Clocks{.monotonic_ns = start_ns_, .boot_ns = start_ns_, .real_ns = start_ns_});
  } else {
    packets_.add(Packets::Clocks{.monotonic_ns = start_ns_,
                                 .boot_ns = read_clock(CLOCK_BOOTTIME),
                                 .real_ns = read_clock(CLOCK_REALTIME)});
  }
  words_ = {.number = packets_.name("activation"),
            .sequence = packets_.name("sequence"),
            .waited = packets_.name("waited_ns"),
            .skipped = packets_.name("ticks skipped"),
            .published = packets_.name("published"),
            .faulted = packets_.name("faulted"),
            .count = packets_.name("count"),
            .time = packets_.name("time_ns"),
            .lost = packets_.name("lost to the trace")};
  for (std::size_t cause = 0; cause < categories_.size(); ++cause) {
    categories_[cause] = packets_.name(detail::to_word(static_cast<Cause>(cause)));
  }
  describe_tracks(view);
  application_->look_at_topics(
      [this](const detail::Topics& topics) { describe_publishers(topics); });
  drops_track_ = new_track(process_track_, "drops");
  faults_track_ = new_track(process_track_, "faults");
  losses_track_ = new_track(process_track_, "losses of this trace");
  file_.start(refusals);
  find_queues();
  static_cast<void>(hand_over());
  is_started_ = true;
  takes_news_.store(true, std::memory_order_release);
  if (!clock_->is_simulated()) {
    reading_ = base::Thread({.name = "trace-read", .cpus = {}}, [this] { poll(); }, refusals);
  }
}

void Tracer::poll() {
  std::unique_lock lock(mutex_);
  while (!is_stopping_) {
    lock.unlock();
    take(false);
    lock.lock();
    changed_.wait_for(lock, kPoll, [this] { return is_stopping_; });
  }
}

void Tracer::round_ended(std::uint32_t) {
  take(false);
}

void Tracer::take(bool is_last) {
  ++batch_;
  if (is_last || batch_ % kPollsPerLook == 0) {
    find_queues();
  }
  read_rings();
  write_live(is_last);
  write_notes();
  write_faults();
  write_queues();
  if (is_last || batch_ % kPollsPerLedger == 0) {
    write_ledgers();
  }
  write_figures();
  write_losses(is_last);
}

void Tracer::stop(const host::Application&) {
  if (is_started_) {
    end_reading();
    take(true);
    is_started_ = false;
  }
  file_.close();
}

bool Tracer::hand_over() {
  if (packets_.bytes().empty()) {
    return true;
  }
  const bool is_taken = file_.append(packets_.bytes(), clock_->is_simulated());
  if (!is_taken) {
    counts_.events_lost += packets_.event_count();
    packets_.begin_anew();
  }
  packets_.clear();
  return is_taken;
}

void Tracer::read_rings() {
  for (Worker& worker : workers_) {
    read_ring(worker);
  }
  for (PeerState& peer : peers_) {
    look_at(peer);
  }
}

void Tracer::read_ring(Worker& worker) {
  if (worker.ring == nullptr) {
    return;
  }
  records_.clear();
  counts_.activations_lost += worker.ring->read(worker.next, records_);
  for (const ActivationRecord& record : records_) {
    // Another process may report components that run elsewhere, or do not exist.
    if (record.component >= components_.size() ||
        components_[record.component].peer != worker.peer || record.cause > Cause::kFault) {
      continue;
    }
    if (clock_->is_simulated()) {
      write_simulated(worker, record);
    } else {
      read_live(worker, record);
    }
  }
}

/// Switches to the present rings of a process that started, ended or was restarted.
void Tracer::look_at(PeerState& its) {
  const std::uint32_t now = its.peer->incarnation();
  if (now == its.incarnation) {
    return;
  }
  const std::size_t count = its.peer->rings(1).workers.size();
  const auto workers = std::span(workers_).subspan(its.first_worker, count);
  for (Worker& worker : workers) {
    read_ring(worker);  // Entries since the last pass.
  }
  write_live(true);
  its.incarnation = now;
  if (now != 0) {
    describe_process(its);
  }
  for (std::size_t place = 0; place < count; ++place) {
    workers[place].ring = now == 0 ? nullptr : its.peer->rings(now).workers[place];
    workers[place].next = 0;
    read_ring(workers[place]);
  }
}

void Tracer::remember(const ActivationRecord& record, const Slice& slice, std::uint64_t track) {
  if (record.publish_count == 0 && clock_->is_simulated()) {
    return;
  }
  std::deque<Past>& past = components_[record.component].past;
  // Workers are read one after the other, so a later activation may come first.
  auto place = past.end();
  while (place != past.begin() && std::prev(place)->number > record.number) {
    --place;
  }
  past.insert(place, {.number = record.number,
                      .track = track,
                      .begin_ns = slice.begin_ns,
                      .end_ns = slice.end_ns,
                      .time_ns = record.time_ns,
                      .batch = batch_});
  if (past.size() > kPastMax) {
    past.pop_front();
  }
}

void Tracer::read_live(Worker& worker, const ActivationRecord& record) {
  Slice slice{.record = record, .read_ns = now_ns()};
  slice.begin_ns = std::max(record.begin_ns, worker.end_ns);
  slice.end_ns = std::max(slice.begin_ns, record.begin_ns + record.duration_ns);
  worker.end_ns = slice.end_ns;
  remember(record, slice, worker.track);
  worker.slices.push_back(slice);
}

/// Simulated time stands still while components work. Activations at one moment are shown one after
/// the other, with their run time on this machine, as if each component had a CPU of its own.
void Tracer::write_simulated(Worker&, const ActivationRecord& record) {
  ComponentState& component = components_[record.component];
  Slice slice{.record = record};
  const auto flow = find_simulated(record);
  slice.begin_ns = std::max(record.time_ns, component.end_ns);
  if (flow) {
    slice.begin_ns = std::max(slice.begin_ns, flow->time_ns);
  }
  slice.end_ns = slice.begin_ns + std::max<std::int64_t>(record.duration_ns, 1);
  component.end_ns = slice.end_ns;
  remember(record, slice, component.track);
  write_slice(slice, component.track, flow);
}

void Tracer::write_live(bool is_last) {
  const std::int64_t now = now_ns();
  for (Worker& worker : workers_) {
    while (!worker.slices.empty()) {
      const Slice& slice = worker.slices.front();
      FlowBegin begin;
      const Found found = find_live(slice, begin);
      if (found == Found::kNotYet && !is_last && now - slice.read_ns < kPatienceNs &&
          worker.slices.size() < kWaitingMax) {
        break;
      }
      write_slice(slice, worker.track,
                  found == Found::kYes ? std::optional<FlowBegin>(begin) : std::nullopt);
      worker.slices.pop_front();
    }
  }
}

Tracer::Found Tracer::find_live(const Slice& slice, FlowBegin& begin) const {
  const auto publisher = publishers_.find(slice.record.publisher);
  if (slice.record.publisher == 0 || publisher == publishers_.end()) {
    return Found::kNo;
  }
  const std::int64_t time_ns = std::min(to_trace(slice.record.cause_ns), slice.begin_ns);
  if (time_ns < start_ns_) {
    return Found::kNo;
  }
  if (publisher->second.external_track != 0) {
    begin = {.track = publisher->second.external_track, .time_ns = time_ns};
    return Found::kYes;
  }
  const std::deque<Past>& past = components_[publisher->second.component].past;
  // If the rate is not 1 the clock's conversion rounds.
  constexpr std::int64_t kRounding = 2;
  const Past* later = nullptr;
  for (auto it = past.rbegin(); it != past.rend(); ++it) {
    if (it->begin_ns > time_ns + kRounding) {
      later = &*it;
      continue;
    }
    if (it->end_ns + kRounding >= time_ns) {
      begin = {.track = it->track, .time_ns = std::clamp(time_ns, it->begin_ns, it->end_ns)};
      begin.time_ns = std::min(begin.time_ns, slice.begin_ns);
      return Found::kYes;
    }
    // Published in the activation after this one: not read yet, or lost.
    return later == nullptr || later->number != it->number + 1 ? Found::kNotYet : Found::kNo;
  }
  return past.empty() ? Found::kNotYet : Found::kNo;
}

/// Messages of a round are handed over at its end: the publisher is the last earlier activation
/// that published at that time.
std::optional<Tracer::FlowBegin> Tracer::find_simulated(const ActivationRecord& record) const {
  const auto publisher = publishers_.find(record.publisher);
  if (record.publisher == 0 || publisher == publishers_.end()) {
    return std::nullopt;
  }
  if (publisher->second.external_track != 0) {
    return FlowBegin{.track = publisher->second.external_track, .time_ns = record.cause_ns};
  }
  const std::deque<Past>& past = components_[publisher->second.component].past;
  for (auto it = past.rbegin(); it != past.rend() && it->time_ns >= record.cause_ns; ++it) {
    if (it->time_ns == record.cause_ns && it->batch < batch_) {
      return FlowBegin{.track = it->track, .time_ns = it->end_ns - 1};
    }
  }
  return std::nullopt;
}

/// "planner: planning/speed", "planner: serve", "planner: mode"
std::uint64_t Tracer::name_of(const ActivationRecord& record) {
  const bool is_timer = record.cause == Cause::kTick || record.cause == Cause::kTimeout;
  const std::uint64_t what = is_timer ? record.key : record.publisher;
  std::uint64_t& name = names_[{record.component, record.cause, what}];
  if (name != 0) {
    return name;
  }
  const ComponentState& component = components_[record.component];
  std::string text = detail::to_word(record.cause);
  if (const auto publisher = publishers_.find(record.publisher); publisher != publishers_.end()) {
    text = publisher->second.topic;
  } else if (is_timer) {
    text = record.key < component.timers.size() ? component.timers[record.key]
                                                : fmt::format("timer {}", record.key);
  }
  name = packets_.name(component.name + ": " + text);
  return name;
}

void Tracer::write_slice(const Slice& slice, std::uint64_t track,
                         const std::optional<FlowBegin>& flow) {
  const ActivationRecord& record = slice.record;
  std::array<Annotation, 7> annotations;
  std::size_t count = 0;
  const auto annotate = [&](std::uint64_t word, std::int64_t value) {
    annotations[count++] = {.name = word, .value = value};
  };
  annotate(words_.number, static_cast<std::int64_t>(record.number));
  if (record.publisher != 0) {
    annotate(words_.sequence, static_cast<std::int64_t>(record.key));
  }
  if (!clock_->is_simulated()) {
    annotate(words_.waited, std::max<std::int64_t>(0, slice.begin_ns - to_trace(record.cause_ns)));
  }
  if (record.skipped > 0) {
    annotate(words_.skipped, static_cast<std::int64_t>(record.skipped));
  }
  if (record.publish_count > 0) {
    annotate(words_.published, record.publish_count);
  }
  if (record.outcome == Outcome::kFault) {
    annotate(words_.faulted, 1);
  }
  if (clock_->is_simulated()) {
    annotate(words_.time, record.time_ns);
  }
  const std::uint64_t id = flow ? flow_id(record) : 0;
  packets_.add(Event{.type = EventType::kBegin,
                     .time_ns = slice.begin_ns,
                     .track = track,
                     .name = name_of(record),
                     .category = categories_[static_cast<std::size_t>(record.cause)],
                     .flow_to = id,
                     .annotations = std::span(annotations).first(count)});
  packets_.add(Event{.type = EventType::kEnd, .time_ns = slice.end_ns, .track = track});
  if (flow) {
    packets_.add(Event{.type = EventType::kInstant,
                       .time_ns = flow->time_ns,
                       .track = flow->track,
                       .name = publishers_.at(record.publisher).name,
                       .flow_from = id});
  }
  if (hand_over()) {
    ++counts_.slices;
    counts_.flows += flow ? 1 : 0;
  }
}

void Tracer::write_instant(std::int64_t time_ns, std::uint64_t track, std::uint64_t name,
                           std::span<const Annotation> annotations, std::string_view text) {
  packets_.add(Event{.type = EventType::kInstant,
                     .time_ns = time_ns,
                     .track = track,
                     .name = name,
                     .text = text,
                     .annotations = annotations});
  counts_.instants += hand_over() ? 1 : 0;
}

void Tracer::find_queues() {
  application_->look_at_topics([this](const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      for (const auto& subscription : topic->subscriptions) {
        if (subscription->kind == detail::Subscription::Kind::kTap) {
          continue;
        }
        const auto [place, is_new] = queue_of_.try_emplace(subscription.get(), queues_.size());
        if (is_new) {
          const std::string path = name + " → " + subscription->component;
          queues_.push_back({.subscription = subscription.get(),
                             .track = new_track(process_track_, "queue " + path, true),
                             .name_of_drop = packets_.name("dropped: " + path)});
        }
        queues_[place->second].lanes = subscription->lanes();
      }
    }
  });
  static_cast<void>(hand_over());
}

void Tracer::write_queues() {
  const std::int64_t now = now_ns();
  for (Queue& queue : queues_) {
    std::uint64_t depth = 0;
    for (const auto& lane : queue.lanes) {
      depth += lane->queued();
    }
    if (depth == queue.depth) {
      continue;
    }
    packets_.add(Event{.type = EventType::kCounter,
                       .time_ns = now,
                       .track = queue.track,
                       .value = static_cast<std::int64_t>(depth)});
    if (hand_over()) {
      queue.depth = depth;
      ++counts_.samples;
    }
  }
}

/// All drops since the last pass, except those of full queues, which leave notes.
void Tracer::write_ledgers() {
  const std::int64_t now = now_ns();
  for (Queue& queue : queues_) {
    const detail::Ledger ledger = queue.subscription->ledger();
    for (std::size_t i = 0; i < ledger.dropped.size(); ++i) {
      const auto reason = static_cast<detail::DropReason>(i);
      const std::uint64_t before = queue.ledger.dropped[i];
      if (reason == detail::DropReason::kOverflow || reason == detail::DropReason::kSuperseded ||
          ledger.dropped[i] <= before) {
        continue;
      }
      const Annotation count{.name = words_.count,
                             .value = static_cast<std::int64_t>(ledger.dropped[i] - before)};
      write_instant(now, drops_track_, queue.name_of_drop, std::span(&count, 1),
                    detail::to_word(reason));
    }
    queue.ledger = ledger;
  }
}

void Tracer::write_figures() {
  std::map<std::size_t, FiguresNote> figures;
  {
    const std::lock_guard lock(fault_mutex_);
    figures.swap(figures_);
  }
  if (figures.empty()) {
    return;
  }
  std::set<std::string> known;
  application_->look_at_topics([&](const detail::Topics& topics) {
    for (const auto& [name, topic] : topics.all()) {
      known.insert(name);
    }
  });
  for (const auto& [component, note] : figures) {
    if (component >= components_.size()) {
      continue;
    }
    std::map<std::string, std::size_t> numbers;
    for (const host::FiguresElsewhere::Subscription& subscription : note.subscriptions) {
      if (!known.contains(subscription.topic)) {
        continue;  // A hostile process could name any number of topics.
      }
      const auto [place, is_new] = queues_elsewhere_.try_emplace(
          {component, subscription.topic, numbers[subscription.topic]++});
      if (is_new) {
        const std::string path = subscription.topic + " → " + components_[component].name;
        place->second = {.track = new_track(process_track_, "queue " + path, true),
                         .name_of_drop = packets_.name("dropped: " + path)};
      }
      write_figures(note.time_ns, place->second, subscription);
    }
  }
}

void Tracer::write_figures(std::int64_t time_ns, QueueElsewhere& queue,
                           const host::FiguresElsewhere::Subscription& subscription) {
  const detail::Ledger& ledger = subscription.ledger;
  if (ledger.queued != queue.ledger.queued) {
    packets_.add(Event{.type = EventType::kCounter,
                       .time_ns = time_ns,
                       .track = queue.track,
                       .value = static_cast<std::int64_t>(ledger.queued)});
    counts_.samples += hand_over() ? 1 : 0;
  }
  for (std::size_t i = 0; i < ledger.dropped.size(); ++i) {
    const std::uint64_t last = queue.ledger.dropped[i];
    const std::uint64_t before = ledger.dropped[i] < last ? 0 : last;  // Of a restarted process.
    if (ledger.dropped[i] > before &&
        static_cast<detail::DropReason>(i) != detail::DropReason::kSuperseded) {
      const Annotation count{.name = words_.count,
                             .value = static_cast<std::int64_t>(ledger.dropped[i] - before)};
      write_instant(time_ns, drops_track_, queue.name_of_drop, std::span(&count, 1),
                    detail::to_word(static_cast<detail::DropReason>(i)));
    }
  }
  queue.ledger = ledger;
}

/// Keeps the newest figures of a component in another process.
void Tracer::changed_elsewhere(const host::ComponentNews& news) noexcept {
  if (!news.elsewhere || !takes_news_.load(std::memory_order_acquire)) {
    return;
  }
  try {
    FiguresNote note{.time_ns = now_ns(), .subscriptions = news.elsewhere->subscriptions};
    std::erase_if(note.subscriptions, [](const auto& subscription) {
      return subscription.kind == host::to_word(detail::Subscription::Kind::kTap);
    });
    const std::lock_guard lock(fault_mutex_);
    figures_.insert_or_assign(news.component, std::move(note));
  } catch (const std::bad_alloc&) {
    // The next figures have these counts too.
  }
}

void Tracer::overflowed(const detail::Subscription& subscription) noexcept {
  if (clock_ == nullptr) {
    return;
  }
  std::uint64_t place = next_note_.load(std::memory_order_relaxed);
  for (;;) {
    Note& note = (*notes_)[place % kNotes];
    const std::uint64_t turn = note.turn.load(std::memory_order_acquire);
    if (turn < place) {
      notes_lost_.fetch_add(1, std::memory_order_relaxed);  // The queue of notes is full.
      return;
    }
    if (turn > place) {
      place = next_note_.load(std::memory_order_relaxed);
      continue;
    }
    if (next_note_.compare_exchange_weak(place, place + 1, std::memory_order_relaxed)) {
      note.time_ns = now_ns();
      note.subscription = &subscription;
      note.turn.store(place + 1, std::memory_order_release);
      return;
    }
  }
}

void Tracer::write_notes() {
  for (;;) {
    Note& note = (*notes_)[read_note_ % kNotes];
    if (note.turn.load(std::memory_order_acquire) != read_note_ + 1) {
      return;
    }
    const std::int64_t time_ns = note.time_ns;
    const detail::Subscription* subscription = note.subscription;
    note.turn.store(read_note_ + kNotes, std::memory_order_release);
    ++read_note_;
    const auto queue = queue_of_.find(subscription);
    if (queue != queue_of_.end()) {
      write_instant(time_ns, drops_track_, queues_[queue->second].name_of_drop, {}, "overflow");
    }
  }
}

void Tracer::faulted(std::string_view component, std::string_view what) noexcept {
  if (!takes_news_.load(std::memory_order_acquire)) {
    return;
  }
  const std::unique_lock lock(fault_mutex_, std::try_to_lock);
  try {
    if (lock && faults_.size() < kFaultNotes) {
      faults_.push_back({now_ns(), std::string(component), std::string(what)});
      return;
    }
  } catch (const std::bad_alloc&) {
    // Counted as lost.
  }
  notes_lost_.fetch_add(1, std::memory_order_relaxed);
}

void Tracer::write_faults() {
  std::vector<FaultNote> faults;
  {
    const std::lock_guard lock(fault_mutex_);
    faults.swap(faults_);
  }
  for (const FaultNote& fault : faults) {
    write_instant(fault.time_ns, faults_track_, packets_.name("fault of " + fault.component), {},
                  fault.what);
  }
}

/// At the end waits for room, so that every loss is reported.
void Tracer::write_losses(bool is_last) {
  counts_.notes_lost = notes_lost_.load(std::memory_order_relaxed);
  const std::uint64_t lost = counts_.activations_lost + counts_.events_lost + counts_.notes_lost;
  if (lost == reported_lost_) {
    return;
  }
  const Annotation count{.name = words_.count,
                         .value = static_cast<std::int64_t>(lost - reported_lost_)};
  packets_.add(Event{.type = EventType::kInstant,
                     .time_ns = now_ns(),
                     .track = losses_track_,
                     .name = words_.lost,
                     .annotations = std::span(&count, 1)});
  if (file_.append(packets_.bytes(), is_last || clock_->is_simulated())) {
    reported_lost_ = lost;
  } else {
    packets_.begin_anew();
  }
  packets_.clear();
}

TraceReport Tracer::report() const {
  TraceReport report = counts_;
  report.file = file_.file().string();
  report.problem = file_.problem();
  report.bytes = file_.written();
  return report;
}

}  // namespace fastcycle::trace
