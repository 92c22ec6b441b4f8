#include "calls/server_core.h"

#include <algorithm>
#include <exception>
#include <utility>

#include <fmt/format.h>

#include "broker/activation_check.h"
#include "calls/serving.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/service_topics.h"

namespace fastcycle::detail {

ServerCore::ServerCore(ComponentCore& its_core, std::string its_service, std::size_t depth)
    : ServiceEnd(std::move(its_service)), core(its_core), id(service_id(service)), owed_(depth) {
  FASTCYCLE_ASSERT(depth > 0, "a service may owe at least one answer");
}

void ServerCore::declare(ServerSpec spec) {
  is_declared = true;
  request_instance = &spec.request;
  reply_instance = &spec.reply;
  feedback_instance = spec.feedback;
  defers_ = spec.defers;
  callback_ = std::move(spec.callback);
  on_cancel_ = std::move(spec.on_cancel);
}

void ServerCore::listen(std::size_t depth) {
  Topics& topics = core.application.wiring().topics();
  const std::string topic = request_topic(service);
  topics.set_options(topic, kRequestTopicOptions);
  requests = &core.subscribe(topics.get(topic, core.name, *request_instance), {.depth = depth},
                             [this](Envelope& envelope, const google::protobuf::Message& payload) {
                               take(envelope, payload);
                             });
  requests->cause = Cause::kRequest;
  requests->outlives_faults = true;
}

void ServerCore::add_client(PublisherId its_requests, PublisherCore& replies,
                            PublisherCore* feedback) {
  clients_.push_back({its_requests, &replies, feedback});
}

void ServerCore::take(Envelope& envelope, const google::protobuf::Message& payload) {
  head_ = {.path = std::move(head_.path)};
  head_.path.clear();
  const auto client = std::ranges::find(clients_, envelope.info.publisher, &Client::id);
  if (client == clients_.end() || !read_head(payload, head_)) {
    return;  // Of a damaged recording.
  }
  if (head_.kind == CallHead::Kind::kRequest) {
    take_request(*client, envelope, payload);
  } else {
    take_cancel(*client);
  }
}

void ServerCore::take_request(const Client& client, Envelope& envelope,
                              const google::protobuf::Message& payload) {
  if (core.state != ComponentCore::State::kActive) {
    const char* why = core.state == ComponentCore::State::kFailed       ? "has failed"
                      : core.state == ComponentCore::State::kRestarting ? "is being restarted"
                                                                        : "is not active";
    reply(client,
          {.number = head_.number,
           .status = CallStatus::kAbsent,
           .reason = "component \"" + core.name + "\", which serves it, " + why},
          nullptr);
    return;
  }
  const auto owed = std::ranges::find(owed_, std::uint64_t{0}, &Owed::serial);
  if (owed == owed_.end()) {
    reply(client,
          {.number = head_.number,
           .status = CallStatus::kBusy,
           .reason = fmt::format("component \"{}\" owes {} answers, and takes no more requests",
                                 core.name, owed_.size())},
          nullptr);
    return;
  }
  owed->serial = ++serials_;
  owed->client = &client;
  owed->number = head_.number;
  owed->deadline_ns = head_.deadline_ns;
  owed->is_cancelling = false;
  owed->is_dropped = false;
  owed->origin = envelope.info.origin;
  owed->trails.assign(envelope.trails, envelope.trails + core.root_count());
  owed->path = head_.path;
  owed->path.push_back(id);
  const Ticket ticket{this, static_cast<std::size_t>(owed - owed_.begin()), owed->serial};
  // A server that answers at once has no calls that its answer waits for.
  const Serving serving(core, defers_ ? ticket : Ticket());
  callback_(envelope, payload, ticket);
  if (feedback_instance != nullptr && owes(ticket)) {
    ReplyHead accepted;
    accepted.number = owed->number;
    accepted.is_accepted = true;
    reply(client, accepted, nullptr);
  }
}

void ServerCore::take_cancel(const Client& client) {
  const auto owed = std::ranges::find_if(owed_, [&](const Owed& one) {
    return one.serial != 0 && one.client == &client && one.number == head_.number;
  });
  if (owed == owed_.end()) {
    return;  // The answer is under way.
  }
  const Ticket ticket{this, static_cast<std::size_t>(owed - owed_.begin()), owed->serial};
  const bool is_given_up = head_.kind == CallHead::Kind::kGiveUp;
  owed->is_cancelling = true;
  if (is_given_up || !on_cancel_) {
    answer(ticket, CallStatus::kCancelled, {}, nullptr, nullptr);
  }
  if (on_cancel_) {
    const Serving serving(core, ticket);
    on_cancel_(ticket.serial);
  }
}

bool ServerCore::owes(const Ticket& ticket) const noexcept {
  return owed_[ticket.index].serial == ticket.serial;
}
bool ServerCore::is_cancelling(const Ticket& ticket) const noexcept {
  return !owes(ticket) || owed_[ticket.index].is_cancelling;
}
std::optional<Time> ServerCore::deadline_of(const Ticket& ticket) const noexcept {
  const Owed& owed = owed_[ticket.index];
  return owes(ticket) && owed.deadline_ns ? std::optional(base::from_ns(*owed.deadline_ns))
                                          : std::nullopt;
}
const std::vector<std::uint64_t>& ServerCore::path_of(const Ticket& ticket) const noexcept {
  return owed_[ticket.index].path;
}
const ServerCore::Client& ServerCore::client_of(const Ticket& ticket) const noexcept {
  return owes(ticket) ? *owed_[ticket.index].client : clients_.front();
}
PublisherCore& ServerCore::replies_of(const Ticket& ticket) const noexcept {
  return *client_of(ticket).replies;
}
PublisherCore& ServerCore::feedback_of(const Ticket& ticket) const noexcept {
  return *client_of(ticket).feedback;
}

void ServerCore::reply(const Client& client, const ReplyHead& head, Envelope* message) {
  Envelope* loan = message != nullptr ? message : client.replies->loan(true);
  write_head(*loan->own, head);
  const Unmuted unmuted(core.publishing);
  client.replies->publish(loan, {});
}

void ServerCore::answer(const Ticket& ticket, CallStatus status, std::string_view reason,
                        Envelope* message, PublisherCore* lender) noexcept {
  if (!owes(ticket)) {
    if (message != nullptr) {
      ++late_answers_;
      lender->return_loan(message);
    }
    return;
  }
  Owed& owed = owed_[ticket.index];
  const bool is_quiet = !core.publishing.is_in_activation() || std::uncaught_exceptions() > 0;
  if (status == CallStatus::kUnanswered && is_quiet) {
    drop(owed);
    return;
  }
  if (!is_in_activation_of(core.publishing)) [[unlikely]] {
    called_outside(core.publishing, "an answer of", service, "answer in a callback");
  }
  if (message != nullptr && lender != owed.client->replies) [[unlikely]] {
    broke_contract(core.publishing,
                   "an answer of \"" + service + "\" was lent by the responder of another request",
                   "answer with what its own responder's loan() gave");
  }
  const OriginOf origin(core.publishing, owed.origin,
                        owed.trails.empty() ? nullptr : owed.trails.data());
  owed.serial = 0;
  reply(*owed.client,
        {.number = owed.number,
         .status = status,
         .is_accepted = false,
         .reason = std::string(reason)},
        message);
}

/// An exception becomes the reason, if it is a fault, which is known only after this. A test may
/// destroy a responder between activations.
void ServerCore::drop(Owed& owed) {
  owed.is_dropped = true;
  core.post(
      Cause::kFault, [this] { answer_dropped(); },
      core.publishing.is_in_activation() ? &core : nullptr);
}

void ServerCore::answer_dropped() {
  for (std::size_t index = 0; index < owed_.size(); ++index) {
    if (owed_[index].serial != 0 && owed_[index].is_dropped) {
      answer({this, index, owed_[index].serial}, CallStatus::kUnanswered,
             "the server let go of the request without an answer", nullptr, nullptr);
    }
  }
}

void ServerCore::publish_feedback(const Ticket& ticket, Envelope* feedback, PublisherCore* lender) {
  if (!owes(ticket)) {
    lender->return_loan(feedback);
    return;
  }
  Owed& owed = owed_[ticket.index];
  if (lender != owed.client->feedback) [[unlikely]] {
    broke_contract(core.publishing, "feedback of \"" + service + "\" was lent by another goal",
                   "publish what the goal's own loan gave");
  }
  write_head(*feedback->own, ReplyHead{.number = owed.number});
  lender->publish(feedback, {});
}

void ServerCore::end_all(CallStatus status, std::string_view reason) {
  for (std::size_t index = 0; index < owed_.size(); ++index) {
    if (owed_[index].serial != 0) {
      answer({this, index, owed_[index].serial}, status, reason, nullptr, nullptr);
    }
  }
}

void ServerCore::abandon(std::string_view what) {
  end_all(CallStatus::kFaulted, "component \"" + core.name + "\": " + std::string(what));
}

// ---- Functions for responders ----

bool is_owed(const Ticket& ticket) noexcept {
  return ticket.server != nullptr && ticket.server->owes(ticket);
}
bool is_cancelling(const Ticket& ticket) noexcept {
  return ticket.server == nullptr || ticket.server->is_cancelling(ticket);
}
std::optional<Time> deadline_of(const Ticket& ticket) noexcept {
  return ticket.server == nullptr ? std::nullopt : ticket.server->deadline_of(ticket);
}
PublisherCore& reply_publisher(const Ticket& ticket) noexcept {
  return ticket.server->replies_of(ticket);
}
PublisherCore& feedback_publisher(const Ticket& ticket) noexcept {
  return ticket.server->feedback_of(ticket);
}
void answer(const Ticket& ticket, CallStatus status, std::string_view reason, Envelope* reply,
            PublisherCore* lender) noexcept {
  if (ticket.server != nullptr) {
    ticket.server->answer(ticket, status, reason, reply, lender);
  } else if (reply != nullptr) {
    lender->return_loan(reply);
  }
}
void publish_feedback(const Ticket& ticket, Envelope* feedback, PublisherCore* lender) {
  if (ticket.server != nullptr) {
    ticket.server->publish_feedback(ticket, feedback, lender);
  } else {
    lender->return_loan(feedback);
  }
}

}  // namespace fastcycle::detail
