#include "calls/client_core.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "broker/activation_check.h"
#include "calls/server_core.h"
#include "calls/serving.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/declare.h"
#include "component/service_topics.h"

namespace fastcycle::detail {
namespace {

constexpr std::size_t kFeedbackDepth = 64;  // The newest is what matters.

/// Describes the cycle in which the answer of `service` would wait for itself.
std::string way_round(const host::ComponentHost& application,
                      const std::vector<std::uint64_t>& path, std::uint64_t service) {
  std::string way;
  for (auto step = std::ranges::find(path, service); step != path.end(); ++step) {
    way += application.service_name(*step) + " → ";
  }
  return "its answer would wait for itself: " + way + application.service_name(service);
}

}  // namespace

ClientCore::ClientCore(ComponentCore& core, std::string its_service, std::size_t max_open)
    : ServiceEnd(std::move(its_service)), id(service_id(service)), core_(core), places_(max_open) {
  FASTCYCLE_ASSERT(max_open > 0, "a client may have at least one open call");
}

void ClientCore::declare(const google::protobuf::Message& request,
                         const google::protobuf::Message& reply,
                         const google::protobuf::Message* feedback) {
  is_declared = true;
  is_goal_client = feedback != nullptr;
  reply_ = &reply;
  feedback_ = feedback;
  // A reconstructed component must not change its existing topics: the application runs, and others
  // may create topics at the same time.
  const auto set_options = [this](const std::string& topic, const TopicOptions& options) {
    if (!core_.is_redeclaring) {
      core_.application.wiring().topics().set_options(topic, options);
    }
  };
  set_options(request_topic(service), kRequestTopicOptions);
  requests_ = &declare_publisher(core_, request_topic(service), request, nullptr, false);
  const auto listen = [this, &set_options](const std::string& topic,
                                           const google::protobuf::Message& type, std::size_t depth,
                                           auto take) {
    set_options(topic, kReplyTopicOptions);
    CallbackSubscription& subscription = declare_subscription(
        core_, topic, type, {.depth = depth},
        [this, take](Envelope& envelope, const google::protobuf::Message& payload) {
          (this->*take)(envelope, payload);
        });
    subscription.cause = Cause::kReply;
    subscription.outlives_faults = true;  // The last word on what was given up frees a place.
  };
  // Acceptance, and the result.
  listen(reply_topic(service, core_.name), reply, 2 * places_.size(), &ClientCore::take_reply);
  if (feedback != nullptr) {
    listen(feedback_topic(service, core_.name), *feedback, kFeedbackDepth,
           &ClientCore::take_feedback);
  }
  timer_ = &core_.add_timer({}, [this](const Tick&) { on_deadline(); },
                            {.name = service,
                             .label = "its callback for the reply of \"" + service + "\"",
                             .cause = Cause::kTimeout});
}

void ClientCore::check_types(config::Problems& problems, const google::protobuf::Message& request,
                             const google::protobuf::Message& reply,
                             const google::protobuf::Message* feedback) const {
  const auto descriptor = [](const google::protobuf::Message* message) {
    return message == nullptr ? nullptr : message->GetDescriptor();
  };
  if (descriptor(&requests_->default_instance) != descriptor(&request) ||
      descriptor(reply_) != descriptor(&reply) || descriptor(feedback_) != descriptor(feedback)) {
    problems.add(config::make_error(
        core_.description.place, "component \"" + core_.name + "\" calls the service \"" + service +
                                     "\" with two sets of types"));
  }
}

ClientCore::Place* ClientCore::find(std::uint64_t number) noexcept {
  Place& place = places_[number % places_.size()];
  return place.number == number && place.state != State::kFree ? &place : nullptr;
}

bool ClientCore::is_open(std::uint64_t number) const noexcept {
  const Place& place = places_[number % places_.size()];
  return place.number == number && place.state == State::kOpen;
}

Origin ClientCore::origin_of_call() const noexcept {
  const Origin& origin = *core_.publishing.origin;
  return origin.root != 0 ? origin : Origin{.taken = core_.publishing.now, .root = requests_->id};
}

std::uint64_t ClientCore::call(Envelope* request, const CallOptions& options,
                               ReplyCallback callback, GoalCallbacks goal) {
  if (!is_in_activation_of(core_.publishing)) [[unlikely]] {
    called_outside(core_.publishing, "a call of", service, "call services in a callback");
  }
  ++statistics_.calls;
  Ticket behalf = options.on_behalf_of != nullptr ? *options.on_behalf_of : core_.serving;
  if (options.is_independent || behalf.server == nullptr || !behalf.server->owes(behalf)) {
    behalf = {};
  }
  OwnReply refusal{.status = CallStatus::kOk,
                   .reason = {},
                   .origin = origin_of_call(),
                   .behalf = behalf,
                   .callback = std::move(callback)};
  if (core_.publishing.is_muted) {
    refusal.status = CallStatus::kCancelled;
    refusal.reason = "component \"" + core_.name + "\" is not active";
    return refuse(request, std::move(refusal));
  }
  if (!has_server) {
    refusal.status = CallStatus::kAbsent;
    refusal.reason = "no component serves it";
    return refuse(request, std::move(refusal));
  }
  head_.path.clear();
  if (behalf.server != nullptr) {
    head_.path = behalf.server->path_of(behalf);
    if (std::ranges::find(head_.path, id) != head_.path.end()) {
      refusal.status = CallStatus::kCycle;
      refusal.reason = way_round(core_.application, head_.path, id);
      return refuse(request, std::move(refusal));
    }
  }
  const auto place = std::ranges::find(places_, State::kFree, &Place::state);
  if (place == places_.end()) {
    refusal.status = CallStatus::kBusy;
    refusal.reason = fmt::format("{} calls are open, and no more may be", places_.size());
    return refuse(request, std::move(refusal));
  }
  const Duration deadline = options.deadline.value_or(Duration(0));
  const std::int64_t due_ns =
      options.deadline ? base::to_ns(core_.publishing.now + deadline) : base::kNever;
  // The number contains the place, too.
  const auto index = static_cast<std::uint64_t>(place - places_.begin());
  const std::uint64_t number = ++calls_ * places_.size() + index;
  *place = {.state = State::kOpen,
            .is_accepted = false,
            .number = number,
            .deadline_ns = due_ns,
            .deadline = deadline,
            .origin = refusal.origin,
            .behalf = behalf,
            .callback = std::move(refusal.callback),
            .goal = std::move(goal)};
  head_.number = number;
  head_.kind = CallHead::Kind::kRequest;
  head_.deadline_ns = options.deadline ? std::optional(due_ns) : std::nullopt;
  write_head(*request->own, head_);
  requests_->publish(request, {});
  if (options.deadline) {
    arm();
  }
  return number;
}

std::uint64_t ClientCore::refuse(Envelope* request, OwnReply reply) {
  requests_->return_loan(request);
  post(std::move(reply));
  return 0;
}

void ClientCore::post(OwnReply reply) {
  own_replies_.push_back(std::move(reply));
  core_.post_own(Cause::kReply, [this] { give_own_reply(); });
}

void ClientCore::give_own_reply() {
  // None, if the component stopped or was restarted meanwhile.
  if (own_replies_.empty()) {
    return;
  }
  const OwnReply reply = std::move(own_replies_.front());
  own_replies_.pop_front();
  give(reply, nullptr);
}

void ClientCore::give(const OwnReply& reply, Envelope* envelope) {
  ++statistics_.replies;
  const Serving serving(core_, reply.behalf);
  const OriginOf origin(core_.publishing, reply.origin);
  std::string error;
  if (reply.status != CallStatus::kOk) {
    error = fmt::format("\"{}\": {}{}{}", service, to_word(reply.status),
                        reply.reason.empty() ? "" : ", ", reply.reason);
  }
  reply.callback(reply.status, error, envelope);
}

void ClientCore::send(std::uint64_t number, CallHead::Kind kind) {
  Envelope* loan = requests_->loan(true);
  head_.number = number;
  head_.kind = kind;
  head_.deadline_ns.reset();
  head_.path.clear();
  write_head(*loan->own, head_);
  const Unmuted unmuted(core_.publishing);
  requests_->publish(loan, {});
}

/// Notifies the server that the caller waits no more; its answer frees the place.
void ClientCore::give_up(Place& place) {
  place.state = State::kGivenUp;
  place.deadline_ns = base::kNever;
  place.callback = nullptr;
  place.goal = {};
  send(place.number, CallHead::Kind::kGiveUp);
}

void ClientCore::cancel(std::uint64_t number) {
  if (!is_in_activation_of(core_.publishing)) [[unlikely]] {
    called_outside(core_.publishing, "Call::cancel() of a call of", service,
                   "cancel calls in a callback");
  }
  Place* place = find(number);
  if (place == nullptr || place->state != State::kOpen) {
    return;
  }
  if (is_goal_client) {
    send(number, CallHead::Kind::kCancel);  // Its server determines the result.
    return;
  }
  post({.status = CallStatus::kCancelled,
        .reason = {},
        .origin = place->origin,
        .behalf = place->behalf,
        .callback = std::move(place->callback)});
  give_up(*place);
  arm();
}

void ClientCore::take_reply(Envelope& envelope, const google::protobuf::Message& payload) {
  ReplyHead head;
  Place* place = read_head(payload, head) ? find(head.number) : nullptr;
  if (place == nullptr) {
    ++statistics_.ignored_replies;
    return;
  }
  if (head.is_accepted) {
    if (place->state == State::kOpen) {
      accept(*place);
    }
    return;
  }
  if (place->state == State::kGivenUp) {
    *place = {};
    statistics_.ignored_replies += head.status == CallStatus::kCancelled ? 0 : 1;
    return;
  }
  const OwnReply reply{.status = head.status,
                       .reason = std::move(head.reason),
                       .origin = envelope.info.origin,
                       .behalf = place->behalf,
                       .callback = std::move(place->callback)};
  const bool has_value = reply.status == CallStatus::kOk ||
                         (is_goal_client && (reply.status == CallStatus::kCancelled ||
                                             reply.status == CallStatus::kAborted));
  *place = {};
  arm();
  give(reply, has_value ? &envelope : nullptr);
}

void ClientCore::accept(Place& place) {
  if (!std::exchange(place.is_accepted, true) && place.goal.on_accepted) {
    const Serving serving(core_, place.behalf);
    const auto on_accepted = place.goal.on_accepted;  // It may end the goal.
    on_accepted();
  }
}

void ClientCore::take_feedback(Envelope& envelope, const google::protobuf::Message& payload) {
  ReplyHead head;
  Place* place = read_head(payload, head) ? find(head.number) : nullptr;
  if (place == nullptr || place->state != State::kOpen) {
    return;
  }
  accept(*place);
  if (place->state == State::kOpen && place->goal.on_feedback) {
    const Serving serving(core_, place->behalf);
    const auto on_feedback = place->goal.on_feedback;
    on_feedback(envelope, payload);
  }
}

void ClientCore::on_deadline() {
  const auto earliest = std::ranges::min_element(places_, {}, [](const Place& place) {
    return std::pair(place.state == State::kOpen ? place.deadline_ns : base::kNever, place.number);
  });
  if (earliest->state != State::kOpen ||
      earliest->deadline_ns > base::to_ns(core_.publishing.now)) {
    arm();
    return;
  }
  const OwnReply reply{
      .status = CallStatus::kLate,
      .reason = fmt::format("{} ms are over",
                            std::chrono::duration<double, std::milli>(earliest->deadline).count()),
      .origin = earliest->origin,
      .behalf = earliest->behalf,
      .callback = std::move(earliest->callback)};
  give_up(*earliest);
  arm();  // One reply in each activation.
  give(reply, nullptr);
}

void ClientCore::arm() {
  if (timer_ == nullptr) {
    return;  // The component waits for its reconstruction: no call is open.
  }
  std::int64_t due_ns = base::kNever;
  for (const Place& place : places_) {
    if (place.state == State::kOpen) {
      due_ns = std::min(due_ns, place.deadline_ns);
    }
  }
  if (due_ns == base::kNever) {
    timer_->due_ns = base::kNever;
  } else if (timer_->due_ns != due_ns) {
    core_.arm(*timer_, base::from_ns(due_ns));
  }
}

void ClientCore::end_all(CallStatus status, std::string_view reason) {
  // Callbacks may call again: these calls end alike. The number of rounds is limited.
  constexpr int kMaxRounds = 16;
  for (int round = 0; round < kMaxRounds; ++round) {
    bool had_any = false;
    while (!own_replies_.empty()) {
      had_any = true;
      give_own_reply();
    }
    for (Place& place : places_) {
      if (place.state == State::kOpen) {
        had_any = true;
        const OwnReply reply{.status = status,
                             .reason = std::string(reason),
                             .origin = place.origin,
                             .behalf = place.behalf,
                             .callback = std::move(place.callback)};
        give_up(place);
        give(reply, nullptr);
      }
    }
    if (!had_any) {
      break;
    }
  }
  arm();
}

void ClientCore::abandon(std::string_view) {
  timer_ = nullptr;  // It is destroyed with the object that declared it.
  own_replies_.clear();
  for (Place& place : places_) {
    if (place.state == State::kOpen) {
      give_up(place);
    }
  }
}

// ---- Functions for clients ----

PublisherCore& request_publisher(ClientCore& client) noexcept {
  return client.requests();
}
std::uint64_t call(ClientCore& client, Envelope* request, const CallOptions& options,
                   ReplyCallback callback, GoalCallbacks goal) {
  return client.call(request, options, std::move(callback), std::move(goal));
}
void cancel_call(ClientCore& client, std::uint64_t number) {
  client.cancel(number);
}
bool is_call_open(const ClientCore& client, std::uint64_t number) noexcept {
  return client.is_open(number);
}

}  // namespace fastcycle::detail
