#include "standby/followed_component.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "broker/topic.h"
#include "component/component_core.h"
#include "component/component_state.h"
#include "component/declared_states.h"
#include "component/key_frame.h"
#include "component/repeat_event.h"
#include "executor/life_step.h"

namespace fastcycle::standby {

using detail::Cause;
using detail::Lane;
using detail::LifeStep;
using detail::ReadKind;

namespace {

/// Time for an input in flight, after the followed process has ended.
constexpr std::int64_t kPatienceNs = 200'000'000;

bool is_posted(Cause cause) {
  return cause == Cause::kMode || cause == Cause::kParameter || cause == Cause::kJob ||
         cause == Cause::kFault;
}

bool is_step(LifeStep step, Cause cause, std::uint64_t key) {
  return cause == Cause::kMode && key == detail::to_key(step);
}

/// Steps that a component started from a key frame repeats, although its own process may have
/// posted them before that, when they were dropped.
std::function<void()> step_to_repeat(detail::ComponentCore& core,
                                     const detail::ActivationRecord& record) {
  if (is_step(LifeStep::kBeginTimers, record.cause, record.key)) {
    return [&core] { core.begin_timers(core.publishing.now); };
  }
  if (is_step(LifeStep::kActivate, record.cause, record.key)) {
    return [&core] { core.call_activate(); };
  }
  if (is_step(LifeStep::kDeactivate, record.cause, record.key)) {
    return [&core] { core.call_deactivate(); };
  }
  return {};
}

bool is_frame(const FollowedActivation& activation) {
  return std::ranges::any_of(activation.reads, [](const auto& entry) {
    return entry.read.kind == ReadKind::kFrameNumber;
  });
}

/// The newest lane of that publisher: a subscription that ended and was created again has older
/// ones.
std::shared_ptr<Lane> lane_of(const detail::Subscription& subscription, PublisherId publisher) {
  std::shared_ptr<Lane> found;
  for (const auto& lane : subscription.lanes()) {
    found = lane->publisher == publisher ? lane : found;
  }
  return found;
}

}  // namespace

FollowedComponent::FollowedComponent(detail::ComponentCore& core, detail::OutputComparer& comparer,
                                     Listener listener, host::ApplicationHost* late)
    : core_(core), listener_(std::move(listener)), late_(late) {
  core.follow(*this);
  core.publishing.is_following = true;
  core.log_source.mute(true);
  for (detail::PublisherCore* publisher : core.declared.publishers) {
    if (!publisher->options.is_external) {
      publisher->follow(comparer);
      publishers_.push_back(publisher);
    }
  }
  const auto widen = [](const detail::Subscription& subscription) {
    for (const auto& lane : subscription.lanes()) {
      lane->set_limit(std::max<std::size_t>(lane->options.depth, lane->options.room));
    }
  };
  std::ranges::for_each(core.subscriptions.callbacks(), widen,
                        [](auto* one) -> auto& { return *one; });
  std::ranges::for_each(core.subscriptions.views(), widen, [](auto* one) -> auto& { return *one; });
}

void FollowedComponent::add(FollowedActivation activation) {
  const std::lock_guard lock(mutex_);
  waiting_.push_back(std::move(activation));
}

void FollowedComponent::take_over() {
  Stage expected = Stage::kFollows;
  stage_.compare_exchange_strong(expected, Stage::kTakesOver);
}

void FollowedComponent::end() {
  for (Stage now = stage_.load(); now == Stage::kFollows || now == Stage::kTakesOver;) {
    if (stage_.compare_exchange_weak(now, Stage::kEnds)) {
      mark();
      wake();
      return;
    }
  }
}

const FollowedActivation* FollowedComponent::next() {
  const std::lock_guard lock(mutex_);
  return waiting_.empty() ? nullptr : &waiting_.front();
}

bool FollowedComponent::serve(detail::ActivationRing&) {
  detail::ActivationRing& ring = *ring_;
  const Stage stage = stage_.load();  // Before the waiting list is read: nothing is added after it.
  if (stage == Stage::kEnds) {
    core_.publishing.is_muted = true;
    return stop_following();
  }
  if (stage == Stage::kTakesOver && !std::exchange(is_public_, true)) {
    go_public();
  }
  connect_what_waits(ring);
  const FollowedActivation* const activation = next();
  if (late_ != nullptr) {
    drop_posted();
    return has_started_ && activation != nullptr && seek(ring, *activation);
  }
  if (activation != nullptr) {
    return execute_next(ring, *activation);
  }
  if (stage != Stage::kTakesOver || is_lost_) {
    answer_for_mode(ring);
    return false;
  }
  static_cast<void>(stop_following());
  listener_.taken_over();
  return true;
}

bool FollowedComponent::execute_next(detail::ActivationRing& ring,
                                     const FollowedActivation& activation) {
  if (is_lost_) {
    return false;
  }
  const Input input = find_inputs(activation);
  if (stage_.load() == Stage::kTakesOver && input != Input::kThere) {
    // Its publisher may have ended too, before it arrived here: do not wait for it.
    const std::int64_t now_ns = base::monotonic_ns();
    missing_since_ns_ = missing_since_ns_ == 0 ? now_ns : missing_since_ns_;
    if (input == Input::kLost || now_ns - missing_since_ns_ > kPatienceNs) {
      missing_since_ns_ = 0;
      skip(activation, "an input of it never came");
      executed_.store(activation.record.number);
      pop();
      return true;
    }
  }
  switch (input) {
    case Input::kThere:
      missing_since_ns_ = 0;
      break;
    case Input::kNotYet:
      return false;
    case Input::kLost:
      lose(fmt::format("a message{} that activation {} of \"{}\" was given never came{}", lost_of(),
                       activation.record.number, core_.name, why_lost()));
      return false;
  }
  const std::uint64_t number = activation.record.number;
  if (number == left_out_.load()) {
    skip(activation, "the other process crashed in it");
  } else {
    execute(ring, activation);
  }
  executed_.store(number);
  pop();
  return true;
}

std::string FollowedComponent::lost_of() const {
  return lost_ == nullptr ? "" : fmt::format(" of \"{}\"", lost_->subscription.topic.name);
}

std::string FollowedComponent::why_lost() const {
  const std::uint64_t dropped =
      lost_ == nullptr
          ? 0
          : lost_->overflowed.get() + lost_->dropped_by_pool.get() + lost_->dropped_outside.get();
  return dropped == 0 ? ""
                      : fmt::format(
                            " (dropped on the way to the standby so far: {}); a larger \"depth\" "
                            "than {} has "
                            "room for more",
                            dropped, lost_->options.depth);
}

/// Messages published before the crash count as published.
void FollowedComponent::skip(const FollowedActivation& activation, std::string_view why) {
  for (const ForView& one : std::exchange(for_views_, {})) {
    core_.repeat_view(*one.view, *one.lane, one.envelope);
  }
  reads_found_ = 0;
  if (message_.lane != nullptr) {
    detail::release(message_.head.envelope);
    message_.lane->subscription.left_out.add();
    message_ = {};
  }
  for (detail::PublisherCore* publisher : publishers_) {
    publisher->skip_followed();
  }
  core_.repeat_next(activation.record.number + 1, replayed_);
  core_.log_source.write(LogLevel::kWarning, fmt::format("activation {} is left out: {}",
                                                         activation.record.number, why));
}

/// What is posted before it starts from a key frame is already part of that state. This includes
/// the steps of a start, which its process posts and waits for as for any other component: it does
/// not begin before the last of them has arrived, since later ones would never be served.
void FollowedComponent::drop_posted() {
  detail::Control dropped;
  while (core_.drop_posted(dropped)) {
    has_started_ = has_started_ || is_step(LifeStep::kBeginTimers, dropped.cause, dropped.key);
  }
}

void FollowedComponent::pop() {
  const std::lock_guard lock(mutex_);
  waiting_.pop_front();
}

/// Messages for callbacks that are missing here, with later ones in their lanes; above 0 where some
/// may be, since the process took none from the others while it started.
std::uint64_t FollowedComponent::missing() const {
  std::uint64_t sum = 0;
  for (const detail::CallbackSubscription* subscription : core_.subscriptions.callbacks()) {
    for (const auto& lane : subscription->lanes()) {
      const bool drops_newest = lane->options.overflow == Overflow::kDropNewest;
      sum += (lane->options.is_imported ? 1U : 0U) + lane->dropped_outside.get() +
             lane->dropped_by_pool.get() + (drops_newest ? lane->overflowed.get() : 0);
    }
  }
  return sum;
}

/// Makes room for newer messages, where the lane would drop them.
void FollowedComponent::drop_cause(const FollowedActivation& activation) {
  const detail::ActivationRecord& record = activation.record;
  const auto& callbacks = core_.subscriptions.callbacks();
  if (record.publisher == 0 || record.subscription >= callbacks.size()) {
    return;
  }
  const auto lane = lane_of(*callbacks[record.subscription], record.publisher);
  Lane::Head found;
  if (lane != nullptr && lane->options.overflow == Overflow::kDropNewest &&
      find(*lane, record.key, found) == Input::kThere) {
    detail::release(found.envelope);
    lane->subscription.left_out.add();
  }
}

/// Checks whether it can begin after this activation; false if it must wait for that.
bool FollowedComponent::seek(detail::ActivationRing& ring, const FollowedActivation& activation) {
  if (const std::uint64_t now = missing(); now != missing_) {
    missing_ = now;
    frames_after_ns_ = base::monotonic_ns();
  }
  const bool may_begin = is_frame(activation) && activation.record.begin_ns > frames_after_ns_;
  Input input = may_begin ? find_frame(activation) : Input::kLost;
  if (input == Input::kThere) {
    input = find_after_frame();
  }
  if (input == Input::kNotYet) {
    return false;
  }
  if (input == Input::kThere) {
    begin_at(ring, activation);
    late_ = nullptr;
    listener_.found_frame();
  } else {
    drop_cause(activation);
  }
  for (const ForView& one : for_views_) {  // Of a frame with missing messages.
    detail::release(one.envelope);
  }
  for_views_.clear();
  reads_found_ = 0;
  executed_.store(activation.record.number);
  pop();
  return true;
}

/// The messages of a key frame.
FollowedComponent::Input FollowedComponent::find_frame(const FollowedActivation& activation) {
  const auto& states = static_cast<detail::DeclaredStates&>(*core_.states).all();
  const auto& views = core_.subscriptions.views();
  for (; reads_found_ < activation.reads.size(); ++reads_found_) {
    const detail::Read& read = activation.reads[reads_found_].read;
    if (read.kind == ReadKind::kKeyFrame && read.place < states.size()) {
      detail::PublisherCore& publisher = *states[read.place]->publisher;
      const std::lock_guard lock(publisher.mutex());
      bool is_past = false;
      if (publisher.find_followed(read.value, is_past) == nullptr) {
        return is_past ? Input::kLost : Input::kNotYet;
      }
    } else if (read.kind == ReadKind::kHeld && read.place < views.size()) {
      const Input input = find_for_view(*views[read.place], read);
      if (input != Input::kThere) {
        return input;
      }
    }
  }
  return Input::kThere;
}

/// The first message of each lane that the known activations after a key frame were given: while
/// the process started, its lanes may have dropped it. Where it is not here, but a later key frame
/// is, that one is tried.
FollowedComponent::Input FollowedComponent::find_after_frame() {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Lane>> found;
  Input result = Input::kThere;
  const auto look = [&](const detail::Subscription& subscription, PublisherId publisher,
                        std::uint64_t sequence) {
    const auto lane = lane_of(subscription, publisher);
    if (lane == nullptr) {
      result = Input::kLost;
      return;
    }
    if (std::ranges::find(found, lane) != found.end()) {
      return;
    }
    found.push_back(lane);
    Lane::Head head;
    if (!lane->peek(head)) {
      result = result == Input::kLost ? result : Input::kNotYet;
    } else if (head.sequence > sequence) {
      result = Input::kLost;
    }
  };
  const auto& callbacks = core_.subscriptions.callbacks();
  const auto& views = core_.subscriptions.views();
  for (std::size_t i = 1; i < waiting_.size() && result != Input::kLost; ++i) {
    const FollowedActivation& activation = waiting_[i];
    if (result == Input::kNotYet && is_frame(activation)) {
      return Input::kLost;
    }
    if (activation.record.publisher != 0 && activation.record.subscription < callbacks.size()) {
      look(*callbacks[activation.record.subscription], activation.record.publisher,
           activation.record.key);
    }
    for (const auto& [read, text] : activation.reads) {
      if (read.kind == ReadKind::kTaken && read.place < views.size()) {
        look(*views[read.place], read.publisher, read.value);
      }
    }
  }
  return result;
}

/// Delivers what it publishes from now on.
void FollowedComponent::go_public() {
  core_.publishing.is_following = false;
  core_.log_source.mute(false);
  for (detail::PublisherCore* publisher : publishers_) {
    publisher->stop_following();
  }
}

bool FollowedComponent::stop_following() {
  const auto narrow = [](const detail::Subscription& subscription) {
    for (const auto& lane : subscription.lanes()) {
      lane->set_limit(lane->options.depth);
      Lane::Head head;
      while (lane->holds_more_than(lane->options.depth) && lane->peek(head)) {
        if (lane->pop(head)) {
          detail::release(head.envelope);
          lane->subscription.left_out.add();
        }
      }
    }
  };
  for (const detail::CallbackSubscription* subscription : core_.subscriptions.callbacks()) {
    narrow(*subscription);
  }
  for (const detail::View* view : core_.subscriptions.views()) {
    narrow(*view);
  }
  core_.publishing.is_following = false;
  core_.log_source.mute(false);
  core_.stop_following();
  stage_.store(Stage::kOver);
  return true;
}

void FollowedComponent::lose(std::string why) {
  is_lost_ = true;
  listener_.lost(why);
}

/// Takes the message of this sequence out of its lane, and drops those before it, as the followed
/// process did.
FollowedComponent::Input FollowedComponent::find(Lane& lane, std::uint64_t sequence,
                                                 Lane::Head& found) {
  while (lane.peek(found)) {
    if (found.sequence > sequence) {
      return Input::kLost;
    }
    if (!lane.pop(found)) {
      continue;
    }
    if (found.sequence == sequence) {
      return Input::kThere;
    }
    detail::release(found.envelope);
    lane.subscription.left_out.add();
  }
  return Input::kNotYet;
}

FollowedComponent::Input FollowedComponent::find_inputs(const FollowedActivation& activation) {
  if (const Input input = find_for_views(activation); input != Input::kThere) {
    return input;
  }
  return find_cause(activation);
}

FollowedComponent::Input FollowedComponent::find_for_views(const FollowedActivation& activation) {
  const auto& views = core_.subscriptions.views();
  for (; reads_found_ < activation.reads.size(); ++reads_found_) {
    const detail::Read& read = activation.reads[reads_found_].read;
    if (read.kind == ReadKind::kTaken && read.place < views.size()) {
      if (const Input input = find_for_view(*views[read.place], read); input != Input::kThere) {
        return input;
      }
    }
  }
  return Input::kThere;
}

/// The message that a view took over or holds, according to `read`.
FollowedComponent::Input FollowedComponent::find_for_view(detail::View& view,
                                                          const detail::Read& read) {
  const auto lane = lane_of(view, read.publisher);
  if (lane == nullptr) {
    return Input::kLost;
  }
  Lane::Head found;
  const Input input = find(*lane, read.value, found);
  lost_ = input == Input::kLost ? lane : nullptr;
  if (input == Input::kThere) {
    lane->delivered.add();
    for_views_.push_back({&view, lane.get(), found.envelope});
  }
  return input;
}

FollowedComponent::Input FollowedComponent::find_cause(const FollowedActivation& activation) {
  const detail::ActivationRecord& record = activation.record;
  if (record.publisher != 0) {
    return find_message(activation);
  }
  if (record.cause == Cause::kReply) {
    return core_.has_own() ? Input::kThere : Input::kLost;
  }
  if (!is_posted(record.cause) || core_.has_posted(record.cause, record.key)) {
    return Input::kThere;
  }
  if (is_step(LifeStep::kAlarm, record.cause, record.key)) {
    return Input::kThere;  // Its own.
  }
  return has_started_ && step_to_repeat(core_, record) ? Input::kThere : Input::kNotYet;
}

FollowedComponent::Input FollowedComponent::find_message(const FollowedActivation& activation) {
  if (message_.lane != nullptr) {
    return Input::kThere;
  }
  const detail::ActivationRecord& record = activation.record;
  const auto& callbacks = core_.subscriptions.callbacks();
  if (record.subscription >= callbacks.size()) {
    return Input::kLost;
  }
  const auto lane = lane_of(*callbacks[record.subscription], record.publisher);
  if (lane == nullptr) {
    return Input::kLost;
  }
  const Input input = find(*lane, record.key, message_.head);
  lost_ = input == Input::kLost ? lane : nullptr;
  message_.lane = input == Input::kThere ? lane.get() : nullptr;
  return input;
}

/// Starts after the activation of a key frame.
void FollowedComponent::begin_at(detail::ActivationRing& ring, const FollowedActivation& frame) {
  const auto& states = static_cast<detail::DeclaredStates&>(*core_.states).all();
  std::vector<std::unique_ptr<google::protobuf::Message>> copies(states.size());
  for (const auto& entry : frame.reads) {
    if (entry.read.kind == ReadKind::kKeyFrame && entry.read.place < states.size()) {
      detail::PublisherCore& publisher = *states[entry.read.place]->publisher;
      const std::lock_guard lock(publisher.mutex());
      bool is_past = false;
      const google::protobuf::Message& state =
          *publisher.find_followed(entry.read.value, is_past)->payload;
      copies[entry.read.place].reset(state.New());
      copies[entry.read.place]->CopyFrom(state);
    }
  }
  core_.follow_at(base::from_ns(frame.record.time_ns));
  detail::begin_at_key_frame(
      *late_, core_, ring, replayed_,
      {.activation = frame.record.number,
       .reads = frame.reads,
       .state = [&copies](const detail::Read& read) -> const google::protobuf::Message& {
         return *copies[read.place];
       }});
  for (const auto& entry : frame.reads) {
    if (entry.read.kind == ReadKind::kSequence) {
      const auto its =
          std::ranges::find(publishers_, entry.read.publisher, &detail::PublisherCore::id);
      if (its != publishers_.end()) {
        (*its)->continue_following_after(entry.read.value);
      }
    }
  }
  for (const ForView& one : std::exchange(for_views_, {})) {
    core_.repeat_view(*one.view, *one.lane, one.envelope);
  }
}

/// A mode switch waits for all processes. A component started from a key frame may receive a step
/// that it took with that, or repeated before the request: nothing is left to do.
void FollowedComponent::answer_for_mode(detail::ActivationRing& ring) {
  const detail::ComponentState state = core_.state;
  const bool is_active = state == detail::ComponentState::kActive;
  if (!has_started_ || (!is_active && state != detail::ComponentState::kStandby)) {
    return;
  }
  const std::uint64_t done =
      detail::to_key(is_active ? LifeStep::kActivate : LifeStep::kDeactivate);
  while (core_.has_posted(Cause::kMode, done)) {
    replayed_.begin({});
    core_.repeat_next(executed_.load(), replayed_);
    static_cast<void>(core_.repeat_posted(ring, Cause::kMode, done));
  }
}

/// Callbacks cannot see who subscribes, and that differs between processes.
void FollowedComponent::connect_what_waits(detail::ActivationRing& ring) {
  while (core_.has_posted(Cause::kConnect, 0)) {
    replayed_.begin({});
    core_.repeat_next(executed_.load(), replayed_);
    static_cast<void>(core_.repeat_posted(ring, Cause::kConnect, 0));
  }
}

void FollowedComponent::execute(detail::ActivationRing& ring,
                                const FollowedActivation& activation) {
  const detail::ActivationRecord& record = activation.record;
  replayed_.begin(activation.reads);
  core_.repeat_next(record.number, replayed_);
  core_.follow_at(base::from_ns(record.time_ns));
  for (const ForView& one : for_views_) {
    core_.repeat_view(*one.view, *one.lane, one.envelope);
  }
  for_views_.clear();
  reads_found_ = 0;
  if (message_.lane != nullptr) {
    core_.repeat(ring, std::exchange(message_, {}));
    return;
  }
  switch (record.cause) {
    case Cause::kTick:
    case Cause::kTimeout:
      if (record.key < core_.timers().size()) {
        core_.repeat(ring, *core_.timers()[record.key],
                     {.due = base::from_ns(record.cause_ns), .skipped = record.skipped});
      }
      return;
    case Cause::kEvent:
      if (!core_.repeat_posted(ring, Cause::kEvent, record.key)) {
        detail::repeat_event(core_, ring, activation.reads, record.key, record.time_ns,
                             record.skipped);
      }
      return;
    case Cause::kReply:
      static_cast<void>(core_.repeat_own(ring));
      return;
    case Cause::kMode:
      if (core_.repeat_posted(ring, record.cause, record.key)) {
        return;
      }
      if (auto body = step_to_repeat(core_, record)) {
        core_.repeat(ring, {.cause = record.cause, .body = std::move(body), .key = record.key});
        return;
      }
      static_cast<void>(core_.repeat_alarm(ring));
      return;
    case Cause::kParameter:
    case Cause::kJob:
    case Cause::kFault:
      static_cast<void>(core_.repeat_posted(ring, record.cause, record.key));
      return;
    case Cause::kConnect:
    case Cause::kMessage:
    case Cause::kExternal:
    case Cause::kRequest:
      return;
  }
}

}  // namespace fastcycle::standby
