#include "dds_gateway/services.h"

#include <chrono>
#include <exception>
#include <string_view>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "ros2/names.h"
#include "ros2/type_hash.h"

namespace fastcycle::dds_gateway {
ServiceCrossing::ServiceCrossing(Context& context, ServiceSettings settings,
                                 ros2::KnownTypes& types, Report report)
    : core_(context.core()),
      settings_(std::move(settings)),
      report_(std::move(report)),
      request_(types.find(settings_.type + "_Request", settings_.request)),
      reply_(types.find(settings_.type + "_Response", settings_.reply)) {
  if (settings_.is_in) {
    client_ = &detail::create_client(context.core(), settings_.service, request_.prototype(),
                                     reply_.prototype(), nullptr, settings_.depth);
    return;
  }
  detail::create_server(
      context.core(), settings_.service,
      {.request = request_.prototype(),
       .reply = reply_.prototype(),
       .depth = settings_.depth,
       .defers = true,
       .callback = [this](detail::Envelope&, const google::protobuf::Message& request,
                          const detail::Ticket& ticket) { ask_there(request, ticket); }});
}

void ServiceCrossing::open(Participant& participant, Arrival arrival) {
  const auto endpoint = [&](const ros2::Converter& type, Role role, bool is_reader) {
    return Endpoint{
        .topic = role == Role::kRequests ? ros2::dds_request_topic(settings_.ros)
                                         : ros2::dds_reply_topic(settings_.ros),
        .type = ros2::dds_type(type.definition().name),
        .user_data = ros2::type_user_data(ros2::type_hash(type.definition())),
        .qos = {.is_reliable = true, .is_transient_local = false, .depth = settings_.depth},
        .is_reader = is_reader,
        .role = role};
  };
  Endpoint requests = endpoint(request_, Role::kRequests, settings_.is_in);
  Endpoint replies = endpoint(reply_, Role::kReplies, !settings_.is_in);
  const std::string id = participant.service_user_data(!settings_.is_in);
  requests.user_data.insert(0, id);
  replies.user_data.insert(0, id);
  reader_ = participant.create_reader(
      settings_.is_in ? requests : replies,
      [arrival = std::move(arrival)](std::span<const std::byte> message, const SampleInfo& info) {
        arrival(info.request, message);
      });
  writer_ = participant.create_writer(settings_.is_in ? replies : requests);
}

void ServiceCrossing::close() {
  reader_.reset();
  writer_.reset();
}

void ServiceCrossing::take(const Identity& request, std::span<const std::byte> message) {
  if (settings_.is_in) {
    ask_here(request, message);
  } else {
    answer_here(request, message);
  }
}

void ServiceCrossing::ask_here(const Identity& request, std::span<const std::byte> message) {
  ++asked;
  detail::PublisherCore& lender = detail::request_publisher(*client_);
  detail::Envelope* const loan = detail::take_loan(lender, true);
  try {
    request_.to_message(message, *loan->own);
  } catch (const ros2::CdrError& error) {
    detail::return_loan(lender, loan);
    fail(error.what());
    return;
  }
  detail::call(*client_, loan, {},
               [this, request](CallStatus status, std::string_view error, detail::Envelope* reply) {
                 // ROS 2 cannot report a failed call: the client there waits for its own timeout.
                 if (status != CallStatus::kOk || reply == nullptr) {
                   fail(std::string(error));
                   return;
                 }
                 try {
                   ros2::Buffer serialized;
                   reply_.to_ros(*reply->payload, serialized);
                   if (writer_ != nullptr) {
                     await_reader();
                     writer_->write_reply(serialized, request);
                   }
                   ++answered;
                 } catch (const std::runtime_error& exception) {
                   fail(exception.what());
                 }
               },
               {});
}

// A client sends a request as soon as it has found the server; the server may find the client
// later, and a reply without a reader is lost. Middlewares of ROS 2 wait for it too, 0.1 s. A
// client that never reads is awaited once, until there was a reader: the thread also serves others.
void ServiceCrossing::await_reader() {
  constexpr std::chrono::milliseconds kLimit{250};
  const auto end = std::chrono::steady_clock::now() + kLimit;
  while (writer_->matched() == 0 && awaits_readers_) {
    awaits_readers_ = std::chrono::steady_clock::now() < end;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  awaits_readers_ = awaits_readers_ || writer_->matched() > 0;
}

void ServiceCrossing::ask_there(const google::protobuf::Message& request,
                                const detail::Ticket& ticket) {
  ++asked;
  std::erase_if(waiting_, [](const auto& one) { return !detail::is_owed(one.second); });
  const auto refuse = [&](const std::string& why) {
    fail(why);
    detail::answer(ticket, CallStatus::kRejected, why, nullptr, nullptr);
  };
  ros2::Buffer serialized;
  try {
    request_.to_ros(request, serialized);
  } catch (const std::runtime_error& error) {
    refuse(error.what());
    return;
  }
  // If a recorded run is executed again, the request has its recorded number.
  constexpr std::string_view kRequest = "request";
  const auto then = detail::take_observed(core_, kRequest);
  const Sent sent = then ? detail::from_observed<Sent>(*then) : send(serialized);
  if (!then) {
    detail::keep_observed(core_, kRequest, detail::to_observed(sent));
  }
  if (sent.what == Sent::What::kNobodyServes) {
    refuse(fmt::format("no node of ROS 2 serves {}", settings_.ros));
  } else if (sent.what == Sent::What::kNotTaken) {
    refuse(fmt::format("the network did not take the request to {}", settings_.ros));
  } else {
    asker_ = sent.identity.asker;
    waiting_[sent.identity.number] = ticket;
  }
}

ServiceCrossing::Sent ServiceCrossing::send(ros2::Buffer& request) {
  // Both ends: a reply without a reader is lost.
  if (writer_ == nullptr || writer_->matched() == 0 || reader_->matched() == 0) {
    return {.what = Sent::What::kNobodyServes, .identity = {}};
  }
  try {
    return {.what = Sent::What::kGone,
            .identity = writer_->write_request(request, reader_->guid())};
  } catch (const EngineError&) {
    return {.what = Sent::What::kNotTaken, .identity = {}};
  }
}

void ServiceCrossing::answer_here(const Identity& request, std::span<const std::byte> message) {
  const auto found = waiting_.find(request.number);
  if (request.asker != asker_ || found == waiting_.end()) {
    return;  // Of another client; or timed out.
  }
  const detail::Ticket ticket = found->second;
  waiting_.erase(found);
  if (!detail::is_owed(ticket)) {
    return;
  }
  detail::PublisherCore& lender = detail::reply_publisher(ticket);
  detail::Envelope* const loan = detail::take_loan(lender, true);
  try {
    reply_.to_message(message, *loan->own);
  } catch (const ros2::CdrError& error) {
    detail::return_loan(lender, loan);
    fail(error.what());
    detail::answer(ticket, CallStatus::kRejected, error.what(), nullptr, nullptr);
    return;
  }
  detail::answer(ticket, CallStatus::kOk, {}, loan, &lender);
  ++answered;
}

void ServiceCrossing::fail(const std::string& why) {
  ++failed;
  report_(fmt::format("{}: {}", settings_.ros, why));
}

}  // namespace fastcycle::dds_gateway
