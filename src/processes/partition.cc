#include "processes/partition.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <map>
#include <thread>
#include <utility>

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <unistd.h>

#include "component/component_core.h"
#include "component/declare.h"
#include "component/service_topics.h"
#include "replay/stand_in.h"

namespace fastcycle::processes {

using segment::ProcessIndex;

namespace {

/// Interval of checks whether an awaited process has ended.
constexpr std::chrono::microseconds kLook{200};
/// FastCycle's own status and log, which start last.
constexpr std::size_t kOwnPlaces = 2;

}  // namespace

Partition::Partition(const ProcessPlan& plan, segment::Segments& segments,
                     host::ComponentClasses& classes)
    : plan_(plan),
      segments_(segments),
      classes_(classes),
      wire_(segments, plan.wire()),
      services_(plan.wiring().services.begin(), plan.wiring().services.end()) {}

Partition::~Partition() = default;

std::optional<std::string> Partition::become(ProcessIndex process, std::uint32_t incarnation) {
  process_ = process;
  incarnation_ = incarnation;
  auto refused = segments_.become(process, segment::Wire::generation_of(incarnation));
  if (!refused) {
    wire_.stage(process, incarnation, plan_.pid_word())
        .store(static_cast<std::uint32_t>(getpid()), std::memory_order_release);
    notices_ =
        std::make_unique<NoticeOrder>(wire_, process, incarnation, plan_.is_simulated(), *this);
  }
  return refused;
}

const ComponentClass* Partition::find(const config::ComponentDescription& component,
                                      config::Problems& problems) {
  return runs_here(component.name) ? classes_.find(component, problems) : &host::stand_in_class();
}

bool Partition::runs_here(const std::string& component) const {
  return plan_.hosts(process_, component);
}

std::uint32_t Partition::process_of(const std::string& component) const {
  const ProcessIndex its = plan_.process_of(component);
  const auto twin = plan_.twin_of(its);
  return twin ? Pair::active_of(wire_, its, *twin) : its;
}

std::uint16_t Partition::lane_room(const std::string& component) const {
  constexpr std::uint16_t kRoom = 1024;
  return plan_.other_of(process_) && runs_here(component) ? kRoom : 0;
}

std::atomic<std::uint32_t>* Partition::crashed() {
  return pair_ == nullptr ? nullptr : &wire_.standby(process_, incarnation_).crashed;
}

std::vector<host::Peers::Process> Partition::others() const {
  std::vector<Process> others;
  for (ProcessIndex process = 0; process < plan_.count(); ++process) {
    const std::uint32_t incarnation = wire_.incarnation(process).load(std::memory_order_acquire);
    if (process == process_ || incarnation == 0) {
      continue;
    }
    const std::int64_t pid =
        wire_.stage(process, incarnation, plan_.pid_word()).load(std::memory_order_acquire);
    if (pid != 0) {
      others.push_back({.name = plan_.name(process), .pid = pid});
    }
  }
  return others;
}

std::string Partition::switch_to_standby(const std::string& component) {
  const ProcessIndex active = process_of(component);
  const auto standby = plan_.twin_of(active);
  if (!standby) {
    return "component \"" + component + "\" has no standby: \"standby\": true gives it one";
  }
  const std::uint32_t incarnation = wire_.incarnation(*standby).load();
  if (incarnation == 0 || wire_.standby(*standby, incarnation).is_in_step.load() == 0) {
    return "process \"" + plan_.name(*standby) + "\" is not in step yet";
  }
  on_switch(plan_.name(active));
  return {};
}

void Partition::stops() {
  if (pair_ != nullptr) {
    pair_->end();
  }
}

void Partition::give_latched(std::uint32_t process) {
  for (const Outlet& one : outlets_) {
    if (one.to->link().to == process && one.publisher->options.latched > 0) {
      application_->beside(*one.publisher, [&one] {
        if (one.to->is_fresh()) {  // Else it has received newer ones.
          one.publisher->give_latched(*one.to, one.depth);
        }
      });
    }
  }
}

bool Partition::is_wanted(const std::string& topic) const {
  return std::ranges::any_of(plan_.wiring().subscriptions,
                             [&](const auto& one) { return one.topic == topic; });
}

std::vector<host::Peers::Invalid> Partition::take_invalid() {
  constexpr std::chrono::seconds kPause{10};
  std::vector<Invalid> all;
  for (Untrusted& one : untrusted_) {
    const std::uint64_t count = one.import->refused();
    const Time now = clock_->now();
    if (count == one.reported || now < one.next) {
      continue;
    }
    one.found.count = count - std::exchange(one.reported, count);
    one.next = now + kPause;
    all.push_back(one.found);
  }
  return all;
}

void Partition::declare(detail::ComponentCore& component) {
  auto& topics = component.application.wiring().topics();
  for (const auto& publisher : plan_.wiring().publishers) {
    if (publisher.component != component.name) {
      continue;
    }
    const auto* const type =
        google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(publisher.type);
    if (type == nullptr) {
      continue;  // No library here has the type, so there is no subscriber either.
    }
    if (publisher.topic.ends_with(detail::kRequestTopic)) {
      topics.set_options(publisher.topic, detail::kRequestTopicOptions);
    } else if (publisher.topic.find(detail::kServiceMark) != std::string::npos) {
      topics.set_options(publisher.topic, detail::kReplyTopicOptions);
    }
    detail::PublisherCore& stand_in = detail::declare_publisher(
        component, publisher.topic,
        *google::protobuf::MessageFactory::generated_factory()->GetPrototype(type), nullptr, true);
    stand_in.is_imported = true;
    stand_in.use_credits(publisher.credits);
  }
}

void Partition::connect(host::Application& application) {
  application_ = &application;
  clock_ = &application.clock();
  const auto find_publisher = [&](const ProcessPlan::Link& link) -> detail::PublisherCore* {
    const detail::Topic* const topic = application.topics().find(link.topic);
    if (topic == nullptr) {
      return nullptr;
    }
    std::size_t ordinal = 0;
    for (const auto& publisher : topic->publishers) {
      if (publisher->owner.name == link.component && ordinal++ == link.ordinal) {
        return publisher.get();
      }
    }
    return nullptr;
  };
  const auto& executors = application.executors();
  const bool is_simulated = clock_->is_simulated();
  // In simulated time there are no executors: input is taken between rounds.
  const std::size_t set_count = is_simulated ? 1 : executors.size();
  std::map<unsigned, segment::LinkSet*> sets;
  for (unsigned place = 0; place < set_count; ++place) {
    link_sets_.push_back(std::make_unique<segment::LinkSet>(wire_, process_, incarnation_, place));
    sets[place] = link_sets_.back().get();
  }
  for (const ProcessPlan::Link& link : plan_.links()) {
    const segment::LinkPlan& wire = plan_.wire().links[link.wire];
    if (wire.from != process_ && wire.to != process_) {
      continue;
    }
    detail::PublisherCore* const publisher = find_publisher(link);
    if (publisher == nullptr) {
      continue;
    }
    if (wire.from == process_) {
      // Continues its sequence, so that no two messages have the same number.
      publisher->continue_after(std::max(publisher->published(), last_sequence(link)));
      outlets_.push_back({.topic = link.topic,
                          .depth = link.depth,
                          .publisher = publisher,
                          .to = std::make_unique<segment::Export>(wire_, wire, incarnation_,
                                                                  publisher->default_instance)});
      publisher->add_export(*outlets_.back().to);
      if (publisher->credits() != nullptr && wire.credits > 0) {
        sets.at(is_simulated ? 0 : wire.publisher_executor)
            ->add(*publisher->credits(), *outlets_.back().to);
      }
    } else {
      const segment::Import& import =
          sets.at(is_simulated ? 0 : wire.executor)->add(wire, *publisher);
      if (wire.is_serialized) {
        untrusted_.push_back({.found = {.process = plan_.name(wire.from),
                                        .component = link.component,
                                        .topic = link.topic},
                              .import = &import});
      }
    }
  }
  notify_followers();
  if (plan_.other_of(process_)) {
    begin_pair();
  } else {
    for (unsigned place = 0; place < executors.size(); ++place) {
      executors[place]->set_foreign_inputs(*sets[place]);
    }
  }
  for (ProcessIndex one = ProcessPlan::kMain; keeps_activity() && one < plan_.count(); ++one) {
    if (one != process_ && plan_.shadow_in(one) == nullptr) {
      activity_elsewhere_.push_back(std::make_unique<ActivityOfProcess>(plan_, wire_, one));
    }
  }
  if (is_simulated) {
    rounds_ =
        std::make_unique<Rounds>(wire_, process_, incarnation_, *sets[0], *notices_, application);
  }
  if (const auto limit = plan_.description_of(process_).heartbeat; limit.count() > 0) {
    heart_ = std::jthread([this, limit](const std::stop_token& stop) { beat(limit, stop); });
  }
}

/// Has the components here notify their followers at the end of activations.
void Partition::notify_followers() {
  const std::vector<ProcessIndex> followers = plan_.followers_of(process_);
  if (followers.empty()) {
    return;
  }
  bell_ = std::make_unique<FollowerBell>(plan_, wire_, process_, incarnation_);
  for (const auto& component : application_->components()) {
    if (runs_here(component->name) && std::ranges::any_of(followers, [&](ProcessIndex follower) {
          return plan_.hosts(follower, component->name);
        })) {
      component->publishing.follower = bell_.get();
    }
  }
}

/// Why the component here cannot follow the one of the trial; empty if it can: it must publish and
/// subscribe to the same topics.
std::string Partition::why_other(const detail::ComponentCore& core) const {
  std::vector<std::string> published;
  std::vector<std::string> subscribed;
  for (const auto& publisher : plan_.wiring().publishers) {
    if (publisher.component == core.name) {
      published.push_back(publisher.topic);
    }
  }
  for (const auto& subscription : plan_.wiring().subscriptions) {
    if (subscription.component == core.name && subscription.is_called) {
      subscribed.push_back(subscription.topic);
    }
  }
  const auto topics_of = [](const auto& ends) {
    std::vector<std::string> topics;
    for (const auto* end : ends) {
      topics.push_back(end->topic.name);
    }
    std::ranges::sort(topics);
    return topics;
  };
  std::ranges::sort(published);
  std::ranges::sort(subscribed);
  const char* const what = topics_of(core.declared.publishers) != published ? "publishes on"
                           : topics_of(core.subscriptions.callbacks()) != subscribed
                               ? "subscribes to"
                               : nullptr;
  return what == nullptr
             ? std::string()
             : "its \"" + core.name + "\" " + what + " other topics than the one that it follows";
}

void Partition::begin_pair() {
  pair_ = std::make_unique<Pair>(plan_, wire_, process_, incarnation_);
  unsigned workers = 0;
  const auto& executors = application_->executors();
  for (unsigned place = 0; place < executors.size(); ++place) {
    paired_inputs_.push_back(std::make_unique<PairedInputs>(*link_sets_[place], *pair_, workers));
    executors[place]->set_foreign_inputs(*paired_inputs_.back());
    workers += executors[place]->options().threads;
  }
  std::vector<detail::ComponentCore*> components;
  for (const auto& component : application_->components()) {
    if (plan_.hosts(process_, component->name) && component->index < plan_.stage_count()) {
      components.push_back(component.get());
    }
  }
  for (const detail::ComponentCore* core : components) {
    if (const std::string why = why_other(*core);
        plan_.shadow_in(process_) != nullptr && !why.empty()) {
      on_standby.lost(why);
    }
  }
  std::vector<segment::LinkSet*> links;
  for (const auto& one : link_sets_) {
    links.push_back(one.get());
  }
  pair_->begin(*application_, components, std::move(links), on_standby);
}

/// Sequence of the last message published over this link before this process started, also by the
/// other one of a pair. A follower learns it from its primary.
std::uint64_t Partition::last_sequence(const ProcessPlan::Link& link) const {
  const segment::LinkPlan& wire = plan_.wire().links[link.wire];
  const auto last_of = [this](const segment::LinkPlan& one, std::uint32_t incarnation) {
    return incarnation == 0 ? 0
                            : wire_.out(one, incarnation).sequence.load(std::memory_order_relaxed);
  };
  std::uint64_t last = last_of(wire, incarnation_ - 1);
  const auto twin = plan_.twin_of(process_);
  if (!twin) {
    return last;
  }
  const std::uint32_t said = wire_.begins_on_standby(process_).load();
  if ((said & segment::kFollows) != 0) {
    return 0;
  }
  for (const ProcessPlan::Link& other : plan_.links()) {
    const segment::LinkPlan& its = plan_.wire().links[other.wire];
    if (its.from == *twin && its.to == wire.to && other.topic == link.topic &&
        other.component == link.component && other.ordinal == link.ordinal) {
      last = std::max(last, last_of(its, said));
    }
  }
  return last;
}

std::vector<detail::ActivationRing*> Partition::rings() const {
  std::vector<detail::ActivationRing*> rings;
  for (unsigned worker = 0; worker < plan_.wire().workers[process_]; ++worker) {
    rings.push_back(&wire_.ring(process_, incarnation_, worker));
  }
  return rings;
}

std::unique_ptr<detail::ReadRing> Partition::reads_of(std::size_t component) const {
  return component < plan_.wire().reads.size() && plan_.shadow_in(process_) == nullptr
             ? wire_.reads(process_, component, incarnation_)
             : nullptr;
}

std::vector<const detail::PeerActivity*> Partition::activity_elsewhere() const {
  std::vector<const detail::PeerActivity*> all;
  for (const auto& one : activity_elsewhere_) {
    all.push_back(one.get());
  }
  return all;
}

/// Increments the heartbeat that the supervisor checks.
void Partition::beat(std::chrono::nanoseconds limit, const std::stop_token& stop) {
  auto& word = wire_.stage(process_, incarnation_, plan_.heartbeat_word());
  while (!stop.stop_requested()) {
    word.fetch_add(1, std::memory_order_relaxed);
    std::this_thread::sleep_for(limit / 4);
  }
}

void Partition::sources_finished() {
  if (rounds_ != nullptr) {
    rounds_->end_sources();
  } else {
    on_sources_finished();
  }
}

std::size_t Partition::place_count() const {
  return plan_.stage_count() + kOwnPlaces;
}

host::Peers::AgreedEnd Partition::agreed_end() const {
  return rounds_ != nullptr ? rounds_->agreed_end() : AgreedEnd::kNone;
}

void Partition::count_rest() {
  for (const auto& links : link_sets_) {
    links->count_rest();
  }
}

void Partition::attach() {
  if (rounds_ != nullptr) {
    rounds_->join();
  }
  for (const auto& links : link_sets_) {
    links->attach();
  }
  notices_->begin();
  if (incarnation_ > 1) {
    send_notice(host::Notice::Kind::kReads, 0, {});
  }
  if (rounds_ != nullptr && incarnation_ > 1) {
    await_readers();
  }
}

/// In simulated time nothing may be published before all existing processes read it.
void Partition::await_readers() {
  const auto is_waited_for = [this](segment::Export& one) {
    const ProcessIndex reader = one.link().to;
    const std::uint32_t incarnation = wire_.incarnation(reader).load(std::memory_order_seq_cst);
    return incarnation != 0 && wire_.rounds(reader, incarnation).is_joining.load() == 0 &&
           !one.is_connected();
  };
  for (const Outlet& one : outlets_) {
    while (is_waited_for(*one.to)) {
      std::this_thread::sleep_for(kLook);
    }
  }
}

// ---- Progress of all processes ----
//
// A process reports its progress as one number that only grows: 1 + the index of the component that
// it starts next; then that all have started, that timers began; and so on to its end.

namespace {

// Words behind those of the components, in the stages of each process.
enum StageWord : std::size_t { kProgress, kBeginLow, kBeginHigh };

}  // namespace

/// Number of steps of the start; those of the end follow.
std::uint32_t Partition::steps() const {
  return static_cast<std::uint32_t>(place_count());
}

void Partition::publish_progress(std::uint32_t progress) {
  auto& word = wire_.stage(process_, incarnation_, plan_.stage_count() + kProgress);
  word.store(std::max(progress, word.load(std::memory_order_relaxed)), std::memory_order_seq_cst);
}

/// A process that has ended counts as farthest.
std::uint32_t Partition::progress_of(ProcessIndex process) const {
  const std::uint32_t incarnation = wire_.incarnation(process).load(std::memory_order_seq_cst);
  if (incarnation == 0) {
    return std::numeric_limits<std::uint32_t>::max();
  }
  return wire_.stage(process, incarnation, plan_.stage_count() + kProgress)
      .load(std::memory_order_seq_cst);
}

void Partition::await_progress(ProcessIndex process, std::uint32_t progress,
                               const std::function<bool()>& is_over) const {
  while (progress_of(process) < progress && !is_over()) {
    std::this_thread::sleep_for(kLook);
  }
}

void Partition::await_all(std::uint32_t progress, const std::function<bool()>& is_over) const {
  for (ProcessIndex process = ProcessPlan::kMain; process < plan_.count(); ++process) {
    await_progress(process, progress, is_over);
  }
}

void Partition::reach_start(std::size_t place) {
  publish_progress(static_cast<std::uint32_t>(place) + 1);
}

void Partition::await_start(const detail::ComponentCore& component, std::size_t place,
                            const std::function<bool()>& is_over) {
  // Its process has started it once it reaches the next one. Rounds synchronize by themselves.
  if (incarnation_ == 1 && rounds_ == nullptr) {
    await_progress(plan_.process_of(component.name), static_cast<std::uint32_t>(place) + 2,
                   is_over);
  }
}

Time Partition::agree_on_begin(base::Clock& clock, const std::function<bool()>& is_over) {
  if (rounds_ != nullptr) {
    if (is_main()) {
      publish_begin(base::to_ns(clock.now()));
    }
    return clock.now();
  }
  if (incarnation_ > 1) {
    if (clock.stands()) {  // The others have not begun either.
      await_progress(ProcessPlan::kMain, steps() + 2, is_over);
      clock.go_on_at(published_begin_ns() != 0 ? published_begin_ns() : base::monotonic_ns());
    }
    publish_progress(steps() + 2);
    return clock.now();  // The others have begun before.
  }
  publish_progress(steps() + 1);
  await_all(steps() + 1, is_over);
  if (is_main()) {
    publish_begin(base::monotonic_ns());
  } else {
    await_progress(ProcessPlan::kMain, steps() + 2, is_over);
  }
  if (clock.stands()) {
    clock.go_on_at(published_begin_ns() != 0 ? published_begin_ns() : base::monotonic_ns());
  }
  publish_progress(steps() + 2);
  return began();
}

std::optional<std::int64_t> Partition::clocks_began() const {
  const bool is_later = incarnation_ > 1 && rounds_ == nullptr;
  return is_later && published_begin_ns() != 0 ? std::optional(published_begin_ns()) : std::nullopt;
}

std::atomic<std::uint32_t>& Partition::begin_word(std::size_t which) const {
  return wire_.stage(ProcessPlan::kMain, 1, plan_.stage_count() + which);
}

/// In application time if that is simulated, in CLOCK_MONOTONIC live: shared by all.
void Partition::publish_begin(std::int64_t begin_ns) {
  const auto ns = static_cast<std::uint64_t>(begin_ns);
  begin_word(kBeginLow).store(static_cast<std::uint32_t>(ns), std::memory_order_relaxed);
  begin_word(kBeginHigh).store(static_cast<std::uint32_t>(ns >> 32), std::memory_order_release);
}

std::int64_t Partition::published_begin_ns() const {
  const std::uint64_t high = begin_word(kBeginHigh).load(std::memory_order_acquire);
  return static_cast<std::int64_t>(high << 32 |
                                   begin_word(kBeginLow).load(std::memory_order_relaxed));
}

Time Partition::began() const {
  const std::int64_t ns = published_begin_ns();
  if (ns == 0) {
    return clock_->now();
  }
  return rounds_ != nullptr ? base::from_ns(ns) : clock_->at_monotonic(ns);
}

namespace {

/// Time for the others to reach the same step at the end; slower ones are not awaited.
constexpr std::chrono::seconds kStepLimit{2};

auto until(std::chrono::steady_clock::duration limit) {
  return [end = std::chrono::steady_clock::now() + limit] {
    return std::chrono::steady_clock::now() > end;
  };
}

}  // namespace

void Partition::reach_end_of_input(const std::function<bool()>& is_over) {
  publish_progress(steps() + 3);
  await_all(steps() + 3, is_over);
}

void Partition::reach(Step step) {
  if (rounds_ != nullptr) {
    return;
  }
  const std::uint32_t progress = steps() + 4 + static_cast<std::uint32_t>(step);
  publish_progress(progress);
  await_all(progress, until(kStepLimit));
}

void Partition::reach_stop(std::size_t place) {
  publish_progress(steps() + 8 + steps() - static_cast<std::uint32_t>(place));
}

void Partition::await_stop(const detail::ComponentCore& component, std::size_t place) {
  if (rounds_ != nullptr) {
    return;
  }
  await_progress(plan_.process_of(component.name),
                 steps() + 9 + steps() - static_cast<std::uint32_t>(place), until(kStepLimit));
}

void Partition::end() {
  publish_progress(steps() + 10 + steps());
}

}  // namespace fastcycle::processes
