#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include "fastcycle/service.h"

namespace fastcycle {

/// Options of one action server.
struct ActionServerOptions {
  /// Goals that may be open at once; one more is answered `kBusy`.
  std::size_t max_goals = 8;
  /// Called with `ServerGoal::number` when a goal shall end. If set, the component ends the goal
  /// itself: by `cancelled`, or by another result; it is also called if the client waits no more,
  /// when the goal is already closed. If not set, such a goal is cancelled at once.
  std::function<void(std::uint64_t number)> on_cancel = {};
};

/// A goal that a server works on, kept over as many activations as that takes. One that is
/// destroyed without a result ends as `kUnanswered`.
///
/// @threads  Confined to its component's activations.
/// @realtime Lending and publishing allocate nothing after warm-up.
template <Message Feedback, Message Result>
class ServerGoal {
 public:
  /// Constructed by FastCycle, for the callback that receives the goal.
  explicit ServerGoal(const detail::Ticket& ticket) : responder_(ticket) {}

  /// Identifies the goal within its server.
  [[nodiscard]] std::uint64_t number() const noexcept { return responder_.ticket().serial; }
  /// False once it has ended: by a result, or because the client waits no more.
  [[nodiscard]] bool is_active() const noexcept { return responder_.is_open(); }
  /// Whether it shall end: only `cancelled` remains to be called.
  [[nodiscard]] bool is_cancelled() const noexcept {
    return detail::is_cancelling(responder_.ticket());
  }
  /// The client's deadline, if it has one.
  [[nodiscard]] std::optional<Time> deadline() const noexcept { return responder_.deadline(); }

  /// Rejects the goal. @pre Called in the callback that received it.
  void reject(std::string_view reason) { responder_.reject(reason); }

  /// An empty feedback to fill in, also if the goal has ended.
  [[nodiscard]] Loan<Feedback> loan_feedback() const {
    FASTCYCLE_ASSERT(ticket().server != nullptr, "a goal that was moved from is none");
    return detail::LoanAccess::make<Feedback>(detail::feedback_publisher(responder_.ticket()));
  }
  /// Reports progress to the client. Does nothing if the goal has ended.
  void publish(Loan<Feedback> feedback) {
    detail::PublisherCore* lender = detail::LoanAccess::lender(feedback);
    detail::publish_feedback(responder_.ticket(), detail::LoanAccess::take(feedback), lender);
  }

  /// An empty result to fill in, also if the goal has ended.
  [[nodiscard]] Loan<Result> loan() const { return responder_.loan(); }
  /// Ends the goal as reached. If it has ended already, this and the next ones only count the call.
  void succeed(Loan<Result> result) { end(CallStatus::kOk, {}, std::move(result)); }
  /// As above, with a copy of `result`.
  void succeed(const Result& result) { responder_.answer(result); }
  /// Ends the goal as unreachable.
  void abort(std::string_view reason, Loan<Result> result) {
    end(CallStatus::kAborted, reason, std::move(result));
  }
  /// As above, with an empty result.
  void abort(std::string_view reason) {
    detail::answer(responder_.ticket(), CallStatus::kAborted, reason, nullptr, nullptr);
  }
  /// Ends the goal as cancelled by the client, with a partial result.
  void cancelled(Loan<Result> result) { end(CallStatus::kCancelled, {}, std::move(result)); }
  /// As above, with an empty result.
  void cancelled() {
    detail::answer(responder_.ticket(), CallStatus::kCancelled, {}, nullptr, nullptr);
  }

  /// For `CallOptions::on_behalf_of`: calls that this goal waits for.
  [[nodiscard]] const detail::Ticket& ticket() const noexcept { return responder_.ticket(); }

 private:
  void end(CallStatus status, std::string_view reason, Loan<Result> result) {
    detail::PublisherCore* lender = detail::LoanAccess::lender(result);
    detail::answer(responder_.ticket(), status, reason, detail::LoanAccess::take(result), lender);
  }

  Responder<Result> responder_;
};

/// Options of one goal.
template <Message Feedback>
struct GoalOptions {
  CallOptions call = {};                   ///< Deadline and other options of the call.
  std::function<void()> on_accepted = {};  ///< At most once, before any feedback.
  /// Called with each feedback, in order.
  std::function<void(const Feedback& feedback)> on_feedback = {};
};

/// Sends goals to an action: a long-running call with feedback that can be cancelled.
///
///     auto goal = parker_.loan();
///     parking_ = parker_.send(std::move(goal), {.on_feedback = [this](const Progress& p) {…}},
///                             [this](const Reply<Parked>& result) {…});
///     …
///     parking_.cancel();
///
/// Every goal ends in exactly one result, as every call in one reply. `Call::cancel` requests the
/// server to stop: the result states whether it did (`kCancelled`), or had finished before.
///
/// @threads  Confined to its component's activations.
template <Message Goal, Message Feedback, Message Result>
class ActionClient {
 public:
  /// Constructed by `Context::create_action_client`.
  explicit ActionClient(detail::ClientCore& core) : core_(&core) {}

  /// Borrows an empty goal to fill in.
  [[nodiscard]] Loan<Goal> loan() {
    return detail::LoanAccess::make<Goal>(detail::request_publisher(*core_));
  }

  /// Sends `goal`; `on_result` is called once.
  ///
  /// @pre  `goal` was borrowed from this client.
  template <ReplyHandler<Result> F>
  Call send(Loan<Goal> goal, GoalOptions<Feedback> options, F on_result) {
    FASTCYCLE_ASSERT(detail::LoanAccess::lender(goal) == &detail::request_publisher(*core_),
                     "a goal is sent by the client that lent it");
    detail::GoalCallbacks callbacks;
    callbacks.on_accepted = std::move(options.on_accepted);
    if (options.on_feedback) {
      callbacks.on_feedback = [on_feedback = std::move(options.on_feedback)](
                                  detail::Envelope&, const google::protobuf::Message& payload) {
        on_feedback(static_cast<const Feedback&>(payload));
      };
    }
    return {*core_,
            detail::call(
                *core_, detail::LoanAccess::take(goal), options.call,
                [on_result = std::move(on_result)](CallStatus status, std::string_view error,
                                                   detail::Envelope* envelope) mutable {
                  on_result(Reply<Result>(status, error, envelope));
                },
                std::move(callbacks))};
  }

 private:
  detail::ClientCore* core_;
};

template <Message Goal, Message Feedback, Message Result>
ActionClient<Goal, Feedback, Result> Context::create_action_client(std::string_view name) {
  return create_action_client<Goal, Feedback, Result>(name, ClientOptions{});
}

template <Message Goal, Message Feedback, Message Result>
ActionClient<Goal, Feedback, Result> Context::create_action_client(std::string_view name,
                                                                   const ClientOptions& options) {
  return ActionClient<Goal, Feedback, Result>(
      detail::create_client(core_, name, Goal::default_instance(), Result::default_instance(),
                            &Feedback::default_instance(), options.max_open));
}

template <Message Goal, Message Feedback, Message Result, typename F>
void Context::create_action_server(std::string_view name, F on_goal) {
  create_action_server<Goal, Feedback, Result>(name, ActionServerOptions{}, std::move(on_goal));
}

template <Message Goal, Message Feedback, Message Result, typename F>
void Context::create_action_server(std::string_view name, const ActionServerOptions& options,
                                   F on_goal) {
  static_assert(std::invocable<F&, const Goal&, ServerGoal<Feedback, Result>>,
                "an action server is f(const Goal&, ServerGoal<Feedback, Result>)");
  FASTCYCLE_REFUSE_COPIED_MESSAGE(F);
  detail::create_server(
      core_, name,
      {.request = Goal::default_instance(),
       .reply = Result::default_instance(),
       .feedback = &Feedback::default_instance(),
       .depth = options.max_goals,
       .defers = true,
       .callback =
           [on_goal = std::move(on_goal)](detail::Envelope&, const google::protobuf::Message& goal,
                                          detail::Ticket ticket) mutable {
             on_goal(static_cast<const Goal&>(goal), ServerGoal<Feedback, Result>(ticket));
           },
       .on_cancel = options.on_cancel});
}

}  // namespace fastcycle
