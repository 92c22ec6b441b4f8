#include "player.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "component/component_core.h"
#include "host/application.h"
#include "status/status.pb.h"

namespace fastcycle::operations {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxLate = 6;
constexpr std::size_t kMaxKept = 12;
constexpr std::size_t kMaxOwed = 4;
constexpr std::int64_t kRefusals = 200;  // That `kInsist` answers by one more call.

constexpr std::array<std::string_view, kOperations> kWords = {
    "publish", "forward", "keep",          "subscribe",      "unsubscribe",   "nest",
    "call",    "insist",  "cancel",        "send_goal",      "answer",        "arm",
    "disarm",  "offload", "change_params", "switch_mode",    "send_tiles",    "look",
    "say",     "renew",   "fault",         "fault_in_event", "fault_in_life", "fault_in_offload"};

/// How often each is drawn; what only happens in its own place is not drawn.
constexpr std::array<int, kOperations> kWeights = {24, 6, 8, 6, 6, 3, 10, 1, 3, 4, 6, 8,
                                                   4,  4, 1, 1, 6, 6, 3,  1, 0, 0, 0, 0};

}  // namespace

World g_world;

std::string_view to_word(Operation operation) noexcept {
  return kWords[static_cast<std::size_t>(operation)];
}

void World::begin(bool live) {
  is_live = live;
  is_wild = false;
  pings = 0;
  received.clear();
}

std::uint64_t World::total() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& count : done) {
    sum += count.load(std::memory_order_relaxed);
  }
  return sum;
}

Player::Player(Context& context)
    : Component(context),
      peers_(context.param<std::vector<std::string>>("peers")),
      modes_(context.param<std::vector<std::string>>("modes")),
      executors_(context.param<std::vector<std::string>>("executors")),
      wildness_(context.param<std::int64_t>("wildness")),
      gain_(context.param<std::int64_t>("gain",
                                        {.fallback = 1, .min = 0, .max = 9, .is_tunable = true})),
      name_(context.component_name()),
      out_(context.create_publisher<Int64Value>(
          name_ + "/out",
          {.deadline = 4ms, .on_event = [this](const QosEvent& event) { happened(event); }})),
      shared_(context.create_publisher<Int64Value>("shared")),
      shared_too_(context.create_publisher<Int64Value>("shared")),
      forwarded_(context.create_publisher<Int64Value>(name_ + "/forwarded")),
      tiles_(context.create_publisher<Int64Value>(name_ + "/tiles",
                                                  {.credits = 3, .on_credits = [this] {
                                                     operate();
                                                     send_tiles();
                                                   }})) {
  ++g_world.objects;
  try {
    declare_inputs();
    declare_services();
    declare_timers();
    context.on_change(gain_, [this] { operate(); });
    context.check_params([](const ProposedParams&) { return std::string(); });
    perhaps_throw(Operation::kFaultInLife, 500);
  } catch (...) {
    --g_world.objects;
    throw;
  }
}

Player::~Player() {
  --g_world.objects;
}

/// What a subscription asks for: the same each time that it is declared.
SubscriberOptions Player::options(std::size_t number) {
  SubscriberOptions its{
      .depth = 1 + number % 5,
      .overflow = number % 3 == 0 ? Overflow::kDropNewest : Overflow::kDropOldest};
  if (number % 2 == 0) {
    its.deadline = 3ms;
    its.liveliness = 5ms;
    its.on_event = [this](const QosEvent& event) { happened(event); };
  }
  if (number % 4 == 1) {
    its.lifespan = 1ms;
    its.on_event = [this](const QosEvent& event) { happened(event); };
  }
  return its;
}

void Player::declare_inputs() {
  Context& context = this->context();
  std::size_t number = 0;
  for (const std::string& peer : peers_.get()) {
    context.create_subscriber<Int64Value>(peer + "/out", options(number++),
                                          [this](const Int64Value& message) { received(message); });
    context.create_subscriber<Int64Value>(peer + "/forwarded", options(number++),
                                          [this](const Sample<Int64Value>& sample) {
                                            kept_.push_back(sample);
                                            received(*sample);
                                          });
    context.create_subscriber<Int64Value>(peer + "/tiles", {.depth = 3},
                                          [this](const Int64Value& message) { received(message); });
    latest_.push_back(context.create_latest<Int64Value>(peer + "/out"));
    history_.push_back(
        context.create_history<Int64Value>(peer + "/forwarded", {.depth = 5, .span = 20ms}));
  }
  if (peers_.get().size() >= 2) {
    const std::string one = peers_.get()[0] + "/out";
    const std::string two = peers_.get()[1] + "/out";
    context.create_synchronizer<Int64Value, Int64Value>(
        {one, two}, {.policy = SyncPolicy::kApproximate, .max_difference = 5ms},
        [this](const Int64Value& message, const Int64Value&) { received(message); });
  }
  context.create_subscriber<Int64Value>("shared", {.depth = 4, .keep = kMaxKept},
                                        [this](const Sample<Int64Value>& sample) {
                                          kept_.push_back(sample);
                                          received(*sample);
                                        });
  context.create_subscriber<Int64Value>("driven", {.depth = 4},
                                        [this](const Int64Value& message) { received(message); });
  context.create_subscriber<Int64Value>("driven_freely", {.depth = 2},
                                        [this](const Int64Value& message) { received(message); });
  context.create_subscriber<Int64Value>("ping", {.depth = 1}, [this](const Int64Value& ping) {
    g_world.received.at(name_) = static_cast<std::uint64_t>(ping.value());
  });
}

void Player::declare_services() {
  Context& context = this->context();
  context.create_service<Int64Value, Int64Value>(
      name_ + "/serve", {.depth = kMaxOwed},
      [this](const Int64Value&, Responder<Int64Value> responder) {
        serve_request(std::move(responder));
      });
  context.create_action_server<Int64Value, Int64Value, Int64Value>(
      name_ + "/act",
      {.max_goals = 2,
       .on_cancel =
           [this](std::uint64_t) {
             operate();
             work_on_goals();
           }},
      [this](const Int64Value&, Goal goal) { serve_goal(std::move(goal)); });
  for (const std::string& peer : peers_.get()) {
    clients_.push_back(
        context.create_client<Int64Value, Int64Value>(peer + "/serve", {.max_open = 3}));
    action_clients_.push_back(context.create_action_client<Int64Value, Int64Value, Int64Value>(
        peer + "/act", {.max_open = 2}));
  }
}

void Player::declare_timers() {
  context().create_timer({.period = 2ms}, [this] {
    operate();
    work_on_goals();
  });
  for (int i = 0; i < 3; ++i) {
    timers_.push_back(context().create_timer([this] { operate(); }));
  }
}

void Player::start() {
  perhaps_throw(Operation::kFaultInLife, 200);
  operate();
}

void Player::activate() {
  perhaps_throw(Operation::kFaultInLife, 200);
  operate();
}

void Player::deactivate() {
  operate();
  perhaps_throw(Operation::kFaultInLife, 100);
}

void Player::stop() {
  operate();
  perhaps_throw(Operation::kFaultInLife, 20);
}

const std::string& Player::any(const std::vector<std::string>& names) {
  return names[chance(names.size())];
}

bool Player::wants(Operation operation, std::uint64_t one_in) {
  const auto place = static_cast<std::size_t>(operation);
  if (!g_world.is_wild || !g_world.is_allowed[place] || chance(one_in) != 0) {
    return false;
  }
  g_world.done[place].fetch_add(1, std::memory_order_relaxed);
  return true;
}

void Player::perhaps_throw(Operation operation, std::uint64_t one_in) {
  if (wants(operation, one_in)) {
    throw std::runtime_error(std::string(to_word(operation)));
  }
}

void Player::operate() {
  if (!g_world.is_wild) {
    return;
  }
  int sum = 0;
  for (std::size_t place = 0; place < kOperations; ++place) {
    sum += g_world.is_allowed[place] ? kWeights[place] : 0;
  }
  auto left = static_cast<int>(chance(static_cast<std::uint64_t>(sum)));
  for (std::size_t place = 0; place < kOperations; ++place) {
    left -= g_world.is_allowed[place] ? kWeights[place] : 0;
    if (left < 0) {
      g_world.done[place].fetch_add(1, std::memory_order_relaxed);
      perform(static_cast<Operation>(place));
      break;
    }
  }
  if (static_cast<std::int64_t>(chance(1000)) < wildness_.get()) {
    perhaps_throw(Operation::kFault, 1);
  }
}

void Player::perform(Operation operation) {
  switch (operation) {
    case Operation::kPublish:
      return publish(gain_.get());
    case Operation::kForward:
      return forward();
    case Operation::kKeep:
      return keep();
    case Operation::kSubscribe:
      return subscribe();
    case Operation::kUnsubscribe:
      return unsubscribe();
    case Operation::kNest:
      return nest();
    case Operation::kCall:
      return call(false);
    case Operation::kInsist:
      refusals_left_ = kRefusals;
      return call(true);
    case Operation::kCancel:
      if (!calls_.empty()) {
        calls_[chance(calls_.size())].cancel();
      }
      return;
    case Operation::kSendGoal:
      return send_goal();
    case Operation::kAnswer:
      return answer();
    case Operation::kArm:
      return timers_[chance(timers_.size())].arm_at(now() +
                                                    std::chrono::microseconds(chance(3000)));
    case Operation::kDisarm:
      return timers_[chance(timers_.size())].cancel();
    case Operation::kOffload:
      return offload();
    case Operation::kChangeParams:
      return change_params();
    case Operation::kSwitchMode:
      if (!modes_.get().empty()) {
        context().switch_mode(any(modes_.get()), "by chance");
      }
      return;
    case Operation::kSendTiles:
      return send_tiles();
    case Operation::kLook:
      return look();
    case Operation::kSay:
      return say();
    case Operation::kRenew:
      return renew();
    case Operation::kFault:
    case Operation::kFaultInEvent:
    case Operation::kFaultInLife:
    case Operation::kFaultInOffload:
    case Operation::kCount:
      return;
  }
}

void Player::received(const Int64Value&) {
  while (kept_.size() > kMaxKept) {
    kept_.pop_front();
  }
  if (g_world.is_wild && chance(3) == 0) {
    operate();
  }
}

void Player::happened(const QosEvent&) {
  if (chance(4) == 0) {
    operate();
  }
  perhaps_throw(Operation::kFaultInEvent, 60);
}

void Player::publish(std::int64_t value) {
  const auto to = chance(4);
  Publisher<Int64Value>& publisher = to == 0 ? shared_ : to == 1 ? shared_too_ : out_;
  auto loan = chance(8) == 0 ? publisher.loan_uncleared() : publisher.loan();
  loan->set_value(value);
  if (chance(16) != 0) {  // Else the loan is given back.
    publisher.publish(std::move(loan));
  }
}

void Player::forward() {
  if (!kept_.empty() && chance(2) == 0) {
    forwarded_.publish(kept_[chance(kept_.size())]);
  } else if (!latest_.empty()) {
    if (const auto newest = latest_[chance(latest_.size())].get()) {
      forwarded_.publish(newest);
    }
  }
}

void Player::keep() {
  if (chance(4) == 0) {
    kept_.clear();
  } else if (!latest_.empty()) {
    if (auto newest = latest_[chance(latest_.size())].get()) {
      kept_.push_back(std::move(newest));
    }
  }
}

void Player::subscribe() {
  if (late_.size() >= kMaxLate) {
    return;
  }
  std::string topic = fmt::format("late/{}", chance(8));  // Published by nobody.
  if (chance(3) != 0) {
    topic = chance(4) == 0 || peers_.get().empty() ? "shared" : any(peers_.get()) + "/out";
  }
  late_.emplace_back(context().create_subscriber<Int64Value>(
      topic, options(chance(8)), [this](const Int64Value& message) { received(message); }));
}

void Player::unsubscribe() {
  if (!late_.empty()) {
    const auto place = static_cast<std::ptrdiff_t>(chance(late_.size()));
    Subscriber ended = std::move(late_[static_cast<std::size_t>(place)]);
    late_.erase(late_.begin() + place);
  }
}

void Player::nest() {
  if (late_.size() >= kMaxLate || peers_.get().empty()) {
    return;
  }
  const std::string& inner_topic = any(peers_.get());
  auto inner = std::make_shared<Subscriber>(context().create_subscriber<Int64Value>(
      inner_topic + "/out", options(chance(8)),
      [this](const Int64Value& message) { received(message); }));
  late_.emplace_back(context().create_subscriber<Int64Value>(
      "shared", {.depth = 2},
      [this, inner = std::move(inner)](const Int64Value& message) { received(message); }));
}

void Player::call(bool insists) {
  if (clients_.empty()) {
    return;
  }
  Client<Int64Value, Int64Value>& client = clients_[chance(clients_.size())];
  CallOptions its;
  if (chance(2) == 0) {
    its.deadline = std::chrono::microseconds(chance(3000));
  }
  its.is_independent = chance(3) == 0;
  auto request = client.loan();
  request->set_value(1);
  Call made = client.call(std::move(request), its, [this, insists](const Reply<Int64Value>& reply) {
    take_reply(reply, insists);
  });
  calls_.push_back(made);
  if (calls_.size() > 8) {
    calls_.pop_front();
  }
}

void Player::take_reply(const Reply<Int64Value>& reply, bool insists) {
  if (reply.ok() && chance(4) == 0) {
    kept_.push_back(reply.sample());
  }
  if (insists && !reply.ok() && g_world.is_wild && refusals_left_-- > 0) {
    call(true);
    return;
  }
  operate();
}

void Player::send_goal() {
  if (action_clients_.empty()) {
    return;
  }
  auto& client = action_clients_[chance(action_clients_.size())];
  GoalOptions<Int64Value> its{.on_accepted = [this] { operate(); },
                              .on_feedback = [this](const Int64Value&) { operate(); }};
  if (chance(2) == 0) {
    its.call.deadline = std::chrono::microseconds(chance(8000));
  }
  auto goal = client.loan();
  goal->set_value(2);
  Call sent =
      client.send(std::move(goal), std::move(its), [this](const Reply<Int64Value>&) { operate(); });
  calls_.push_back(sent);
}

void Player::serve_request(Responder<Int64Value> responder) {
  operate();
  switch (chance(6)) {
    case 0:
      responder.reject("by chance");
      break;
    case 1:
      break;  // It is let go of.
    case 2:
    case 3:
      owed_.push_back(std::move(responder));
      break;
    default: {
      auto reply = responder.loan();
      reply->set_value(2);
      responder.answer(std::move(reply));
    }
  }
  if (chance(16) == 0) {
    operate();
  }
}

void Player::answer() {
  if (owed_.empty()) {
    return;
  }
  Responder<Int64Value> responder = std::move(owed_.front());
  owed_.pop_front();
  if (chance(4) != 0) {
    Int64Value value;
    value.set_value(3);
    responder.answer(value);
  }
}

void Player::serve_goal(Goal goal) {
  operate();
  if (chance(4) == 0) {
    goal.reject("by chance");
  } else {
    goals_.push_back(std::move(goal));
  }
}

void Player::work_on_goals() {
  if (goals_.empty()) {
    return;
  }
  Goal goal = std::move(goals_.front());
  goals_.pop_front();
  if (!goal.is_active()) {
    return;
  }
  if (goal.is_cancelled()) {
    goal.cancelled();
  } else if (chance(3) == 0) {
    goal.succeed(goal.loan());
  } else if (chance(8) == 0) {
    goal.abort("by chance");
  } else {
    goal.publish(goal.loan_feedback());
    goals_.push_back(std::move(goal));
  }
}

void Player::offload() {
  const bool throws = wants(Operation::kFaultInOffload, 30);
  Sample<Int64Value> sample = kept_.empty() ? Sample<Int64Value>() : kept_.back();
  context().offload(
      any(executors_.get()),
      [throws, sample = std::move(sample)] {
        if (sample && sample->value() < 0) {
          throw std::logic_error("no message has a value below zero");
        }
        if (throws) {
          throw std::runtime_error("fault_in_offload");
        }
      },
      [this] { operate(); });
}

void Player::change_params() {
  const std::string& other = peers_.get().empty() || chance(2) == 0 ? name_ : any(peers_.get());
  context().change_params({{other + ".gain", std::to_string(chance(11))},
                           {name_ + ".gain", std::to_string(chance(10))}},
                          [this](const ParamsResult&) { operate(); });
}

void Player::send_tiles() {
  while (g_world.is_wild && tiles_.credits() > 0 && chance(8) != 0) {
    auto tile = tiles_.loan();
    tile->set_value(4);
    tiles_.publish(std::move(tile));
  }
}

void Player::look() {
  for (const auto& view : latest_) {
    if (const auto newest = view.get(); newest && newest->value() < 0) {
      throw std::logic_error("no message has a value below zero");
    }
  }
  for (const auto& view : history_) {
    if (view.size() > 0 && view[chance(view.size())]->value() < 0) {
      throw std::logic_error("no message has a value below zero");
    }
  }
}

void Player::say() {
  health(chance(2) == 0 ? Health::kOk : Health::kDegraded, fmt::format("reason {}", chance(4)));
  if (chance(50) == 0) {
    log().info("{} said something", name_);
  }
  report("said", static_cast<std::int64_t>(chance(100)));
}

void Player::renew() {
  if (peers_.get().empty()) {
    return;
  }
  detail::ComponentCore& own = context().core();
  const std::string& peer = any(peers_.get());
  const auto& application = static_cast<const host::Application&>(own.application);
  for (const auto& component : application.components()) {
    if (component->name == peer) {
      component->post(
          detail::Cause::kMode, [core = component.get()] { static_cast<void>(core->renew()); },
          &own);
    }
  }
}

Driver::Driver(Context& context)
    : Component(context),
      count_(context.param<std::int64_t>("count")),
      with_credits_(context.create_external_publisher<Int64Value>("driven", {.credits = 4})),
      without_(context.create_external_publisher<Int64Value>("driven_freely")) {
  context.create_thread("driver", [this](const std::stop_token& stop) { drive(stop); });
}

void Driver::drive(const std::stop_token& stop) {
  const Time taken_at{};
  for (std::int64_t i = 1; !stop.stop_requested() && (count_.get() == 0 || i <= count_.get());
       ++i) {
    if (i % 7 == 0) {
      auto loan = without_.loan();
      loan->set_value(i);
      if (i % 21 != 0) {
        without_.publish(std::move(loan), taken_at);
      }
      std::this_thread::sleep_for(100us);
    } else if (with_credits_.wait_for_credit(stop)) {
      auto loan = with_credits_.loan();
      loan->set_value(i);
      with_credits_.publish(std::move(loan), taken_at);
    }
  }
}

Pinger::Pinger(Context& context)
    : Component(context), ping_(context.create_publisher<Int64Value>("ping")) {
  context.create_subscriber<status::Status>("fastcycle/status", [](const status::Status&) {});
}

void Pinger::serve() {
  auto ping = ping_.loan();
  ping->set_value(static_cast<std::int64_t>(++g_world.pings));
  ping_.publish(std::move(ping));
}

}  // namespace fastcycle::operations
