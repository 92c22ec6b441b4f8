#include "inspect/voice.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "broker/quality.h"
#include "calls/call_head.h"
#include "calls/server_core.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "component/service_topics.h"
#include "config/nearest.h"
#include "inspect/refusal.h"

namespace fastcycle::inspect {
namespace {

constexpr std::size_t kReplies = 4;  // One call of each service is open; others are late.

const google::protobuf::Message* instance_of(const detail::Topic& topic) {
  if (!topic.publishers.empty()) {
    return &topic.publishers.front()->default_instance;
  }
  const auto* type =
      google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(topic.type);
  return type == nullptr
             ? nullptr
             : google::protobuf::MessageFactory::generated_factory()->GetPrototype(type);
}

/// Whether a subscription monitors the rate, and would report this silent publisher as missing.
bool is_watched(const detail::Topic& topic) {
  return std::ranges::any_of(topic.subscriptions, [](const auto& subscription) {
    return subscription->quality != nullptr && subscription->quality->is_timed();
  });
}

/// Removes the part of a reply that only FastCycle reads.
void remove_head(google::protobuf::Message& message) {
  google::protobuf::UnknownFieldSet& fields =
      *message.GetReflection()->MutableUnknownFields(&message);
  for (int number = detail::kFirstHeadField; number <= detail::kLastHeadField; ++number) {
    fields.DeleteByNumber(number);
  }
}

/// `Voice::kName`, or the next unused name: a replayed recording may contain it.
std::string free_name(const host::Application& application) {
  std::string name = Voice::kName;
  while (std::ranges::any_of(application.components(),
                             [&](const auto& component) { return component->name == name; })) {
    name += '_';
  }
  return name;
}

}  // namespace

Voice::Voice(host::Application& application) : application_(application), replies_(kName) {
  owner_.name = free_name(application);
  owner_.clock = &application.clock();
  if (application.clock().is_simulated()) {
    owner_.stage = &stage_;
  }
}

void Voice::declare() {
  detail::Topics& topics = application_.topics();
  for (const auto& [name, topic] : topics.all()) {
    const bool is_own = name.starts_with(host::kOwnTopics);
    const google::protobuf::Message* instance = instance_of(*topic);
    if (!is_own && instance != nullptr && name.find(detail::kServiceMark) == std::string::npos &&
        !is_watched(*topic)) {
      publishers_[name] = &topics.add_publisher(name, owner_, *instance, nullptr, true);
    }
  }
  for (const auto& component : application_.components()) {
    for (const auto& end : component->servers) {
      auto& server = detail::ServerCore::of(*end);
      if (server.requests == nullptr) {
        continue;
      }
      Line& line = lines_[server.service];
      line.requests = &topics.add_publisher(detail::request_topic(server.service), owner_,
                                            *server.request_instance, nullptr, true);
      const auto publish = [&](const std::string& topic, const google::protobuf::Message& type) {
        topics.set_options(topic, detail::kReplyTopicOptions);
        detail::PublisherCore& publisher =
            topics.add_publisher(topic, component->publishing, type, nullptr, false);
        component->service_publishers.push_back(&publisher);
        return &publisher;
      };
      const std::string reply_topic = detail::reply_topic(server.service, owner_.name);
      detail::PublisherCore* replies = publish(reply_topic, *server.reply_instance);
      detail::PublisherCore* feedback =
          server.feedback_instance == nullptr
              ? nullptr
              : publish(detail::feedback_topic(server.service, owner_.name),
                        *server.feedback_instance);
      server.add_client(line.requests->id, *replies, feedback);
      replies_.add(*topics.find(reply_topic), kReplies, 0);
      line.replies = replies->id;
    }
  }
}

void Voice::open() {
  const auto open_one = [this](detail::PublisherCore& publisher) {
    const std::lock_guard lock(publisher.mutex());
    publisher.set_external_stage(application_.time().external_stage());
    publisher.set_external_open(true);
  };
  for (const auto& [name, publisher] : publishers_) {
    open_one(*publisher);
  }
  for (const auto& [service, line] : lines_) {
    open_one(*line.requests);
  }
}

void Voice::close() {
  const auto close_one = [](detail::PublisherCore& publisher) {
    const std::lock_guard lock(publisher.mutex());
    publisher.set_external_open(false);
  };
  for (const auto& [name, publisher] : publishers_) {
    close_one(*publisher);
  }
  for (const auto& [service, line] : lines_) {
    close_one(*line.requests);
  }
  replies_.take(
      [](const detail::Lane&, const detail::Lane::Head& head) { detail::release(head.envelope); });
}

detail::PublisherCore& Voice::publisher_of(const std::string& topic) const {
  const auto found = publishers_.find(topic);
  if (found != publishers_.end()) {
    return *found->second;
  }
  bool is_there = false;
  application_.look_at_topics(
      [&](const detail::Topics& topics) { is_there = topics.find(topic) != nullptr; });
  if (is_there) {
    const char* const why = topic.starts_with(host::kOwnTopics) ? "it is FastCycle's own"
                            : topic.find(detail::kServiceMark) != std::string::npos
                                ? "it is of a service"
                                : "a subscriber monitors each of its publishers (deadline, "
                                  "liveliness), and would report the tool as missing";
    throw Refusal(protocol::Error::KIND_REFUSED,
                  fmt::format("tools may not publish on \"{}\": {}", topic, why));
  }
  std::vector<std::string> known;
  for (const auto& [name, publisher] : publishers_) {
    known.push_back(name);
  }
  throw Refusal(protocol::Error::KIND_NOT_FOUND, fmt::format("there is no topic \"{}\"", topic),
                config::did_you_mean(config::nearest(topic, known)));
}

void Voice::publish(detail::PublisherCore& publisher, const std::string& serialized,
                    const std::function<void(google::protobuf::Message&)>& add) {
  // The message is validated before a loan is taken.
  const std::unique_ptr<google::protobuf::Message> message(publisher.default_instance.New());
  if (!message->ParseFromString(serialized)) {
    throw Refusal(protocol::Error::KIND_REFUSED,
                  fmt::format("what was sent is no {}", message->GetTypeName()));
  }
  add(*message);
  detail::Envelope* loan = detail::take_external_loan(publisher, true);
  message->GetReflection()->Swap(message.get(), loan->own);
  detail::publish_external(publisher, loan, application_.clock().now());
}

void Voice::publish(const std::string& topic, const std::string& serialized) {
  publish(publisher_of(topic), serialized, [](google::protobuf::Message&) {});
}

void Voice::call(const std::string& service, const std::string& serialized, std::int64_t timeout_ns,
                 Done done) {
  const auto found = lines_.find(service);
  if (found == lines_.end()) {
    std::vector<std::string> known;
    for (const auto& [name, line] : lines_) {
      known.push_back(name);
    }
    throw Refusal(protocol::Error::KIND_NOT_FOUND,
                  fmt::format("there is no service \"{}\"", service),
                  config::did_you_mean(config::nearest(service, known)));
  }
  Line& line = found->second;
  if (line.is_owed) {
    throw Refusal(protocol::Error::KIND_REFUSED,
                  fmt::format("a tool calls \"{}\" already, and has no answer yet", service));
  }
  detail::CallHead head;
  head.number = line.number + 1;
  head.deadline_ns = base::to_ns(application_.clock().now()) + timeout_ns;
  publish(*line.requests, serialized,
          [&](google::protobuf::Message& message) { detail::write_head(message, head); });
  line.number = head.number;
  line.end_ns = base::monotonic_ns() + timeout_ns;
  line.is_owed = true;
  line.done = std::move(done);
}

bool Voice::is_waiting() const noexcept {
  return std::ranges::any_of(lines_, [](const auto& entry) { return entry.second.is_owed; });
}

void Voice::look() {
  replies_.take([this](const detail::Lane& lane, const detail::Lane::Head& head) {
    take_reply(lane, *head.envelope);
    detail::release(head.envelope);
  });
  const std::int64_t now_ns = base::monotonic_ns();
  for (auto& [service, line] : lines_) {
    if (line.done && now_ns > line.end_ns) {
      protocol::Reply late;
      late.set_status("late");
      late.set_error(fmt::format("\"{}\" has not answered in time", service));
      std::exchange(line.done, {})(std::move(late));
    }
  }
}

void Voice::take_reply(const detail::Lane& lane, const detail::Envelope& envelope) {
  const auto found = std::ranges::find_if(
      lines_, [&](const auto& entry) { return entry.second.replies == lane.publisher; });
  detail::ReplyHead head;
  if (found == lines_.end() || !detail::read_head(*envelope.payload, head) || head.is_accepted ||
      head.number != found->second.number) {
    return;
  }
  Line& line = found->second;
  line.is_owed = false;
  if (!line.done) {
    return;  // It arrived too late.
  }
  protocol::Reply reply;
  reply.set_status(fastcycle::to_word(head.status));
  reply.set_error(to_utf8(head.reason));
  const std::unique_ptr<google::protobuf::Message> message(envelope.payload->New());
  message->CopyFrom(*envelope.payload);
  remove_head(*message);
  message->SerializePartialToString(reply.mutable_reply());
  std::exchange(line.done, {})(std::move(reply));
}

}  // namespace fastcycle::inspect
