#include "web/hub.h"

#include <algorithm>
#include <random>
#include <utility>

#include <fmt/format.h>

namespace fastcycle::web {
namespace {

namespace protocol = inspect::protocol;
using namespace std::chrono_literals;

constexpr auto kOverviewPeriod = 1000ms;
constexpr auto kTimePeriod = 50ms;
constexpr auto kParamsPeriod = 1000ms;
constexpr auto kLossesPeriod = 1000ms;

std::string random_id() {
  std::random_device device;
  return fmt::format("{:08x}{:08x}", device(), device());
}

}  // namespace

Hub::Hub(std::unique_ptr<inspect::Client> application, Options options)
    : application_(std::move(application)),
      options_(std::move(options)),
      publishable_{.topics = options_.publish, .except = {}},
      session_id_(random_id()) {
  find_topics();
  find_services();
}

Hub::~Hub() = default;

void Hub::find_topics() {
  protocol::Request request;
  request.mutable_overview();
  const protocol::Answer answer = application_->ask(std::move(request));
  is_simulated_ = answer.overview().clock() == "simulated";
  if (answer.overview().has_playback()) {
    playback_ = answer.overview().playback();
  }
  std::map<std::string, std::string> schemas;  // By type.
  for (const protocol::Topic& topic : answer.overview().topics()) {
    if (topic.type().empty()) {
      continue;
    }
    std::string& schema = schemas[topic.type()];
    if (schema.empty()) {
      protocol::Request one;
      one.mutable_topic()->set_topic(topic.name());
      schema = application_->ask(std::move(one)).topic().schema();
    }
    const auto id = static_cast<std::uint32_t>(channels_.size() + 1);
    channels_.push_back({.id = id, .topic = topic.name(), .type = topic.type(), .schema = schema});
    feeds_[id] = {.topic = topic.name(), .latched = topic.latched(), .kept = {}, .subscribers = {}};
  }
  take_overview(answer.overview());
}

void Hub::find_services() {
  if (!may("publish")) {
    return;
  }
  protocol::Request request;
  request.mutable_overview()->set_without_components(true);
  const protocol::Answer answer = application_->ask(std::move(request));
  for (const protocol::Service& service : answer.overview().services()) {
    if (!service.feedback_type().empty()) {
      continue;  // An action: it returns more than one answer.
    }
    protocol::Request one;
    one.mutable_topic()->set_topic(service.name());
    const protocol::Service whole = application_->ask(std::move(one)).topic().service();
    services_.push_back({.id = static_cast<std::uint32_t>(services_.size() + 1),
                         .name = service.name(),
                         .request_type = service.request_type(),
                         .request_schema = whole.request_schema(),
                         .reply_type = service.reply_type(),
                         .reply_schema = whole.reply_schema()});
  }
}

std::vector<std::string_view> Hub::capabilities() const {
  std::vector<std::string_view> all = {"parameters", "parametersSubscribe", "connectionGraph"};
  if (is_simulated_) {
    all.emplace_back("time");
  }
  if (playback_) {
    all.emplace_back("playbackControl");
  }
  if (may("publish")) {
    all.emplace_back("services");
    if (!options_.publish.empty()) {
      all.emplace_back("clientPublish");
    }
  }
  return all;
}

void Hub::remove(Listener& listener) {
  listeners_.erase(&listener);
  forget(listener);
}

void Hub::forget(const Asker& asker) {
  std::erase_if(asked_, [&](const auto& one) { return one.second.asker == &asker; });
}

void Hub::post(protocol::Request request, const Asker* asker, Take take) {
  const std::uint32_t id = application_->post(std::move(request));
  asked_[id] = {.asker = asker, .take = std::move(take)};
}

void Hub::ask(const Asker& asker, protocol::Request request, Take take) {
  post(std::move(request), &asker, std::move(take));
}

void Hub::read() {
  while (const auto answer = application_->take(0ms)) {
    take(*answer);
  }
}

void Hub::take(const protocol::Answer& answer) {
  if (answer.has_error() && answer.id() == 0) {
    throw inspect::ClientError(answer.error());  // The application ends the connection.
  }
  if (const auto stream = channel_of_stream_.find(answer.id());
      stream != channel_of_stream_.end()) {
    Feed& feed = feeds_[stream->second];
    if (answer.has_messages()) {
      take_messages(feed, answer.messages());
    } else if (answer.has_ended() || answer.has_error()) {
      if (feed.stream == answer.id()) {
        feed.stream = 0;
      }
      channel_of_stream_.erase(stream);
    }
    return;
  }
  if (answer.has_playback()) {
    take_playback(answer.playback());  // Not only the requester needs it.
  }
  const auto found = asked_.find(answer.id());
  if (found != asked_.end()) {
    const Take take = std::move(found->second.take);
    asked_.erase(found);
    take(answer);
  }
}

void Hub::take_messages(Feed& feed, const protocol::Messages& messages) {
  for (const protocol::Message& message : messages.messages()) {
    const auto shared = std::make_shared<const SharedMessage>(
        SharedMessage{.time_ns = message.publish_time_ns(), .payload = message.payload()});
    keep(feed, {.publisher = message.channel(), .message = shared});
    for (const auto& [listener, subscription] : feed.subscribers) {
      listener->take_message(subscription, shared);
    }
  }
  if (messages.lost() > 0) {
    for (const auto& [listener, subscription] : feed.subscribers) {
      listener->take_loss(subscription, messages.lost());
    }
  }
}

void Hub::keep(Feed& feed, Feed::Kept message) {
  if (feed.latched == 0) {
    return;
  }
  if (playback_ && playback_->can_seek()) {
    std::erase_if(feed.kept,
                  [&](const Feed::Kept& one) { return one.publisher == message.publisher; });
  }
  feed.kept.push_back(std::move(message));
  if (feed.kept.size() > feed.latched) {
    feed.kept.pop_front();
  }
}

void Hub::subscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel) {
  Feed& feed = feeds_[channel];
  feed.subscribers.emplace_back(&listener, subscription);
  if (feed.stream != 0) {
    for (const Feed::Kept& kept : feed.kept) {
      listener.take_message(subscription, kept.message);
    }
    return;
  }
  feed.kept.clear();
  protocol::Request request;
  request.mutable_stream()->set_topic(feed.topic);
  request.mutable_stream()->set_content(protocol::Stream::CONTENT_FULL);
  feed.stream = application_->post(std::move(request));
  channel_of_stream_[feed.stream] = channel;
}

void Hub::unsubscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel) {
  Feed& feed = feeds_[channel];
  std::erase(feed.subscribers, std::pair(&listener, subscription));
  if (feed.subscribers.empty() && feed.stream != 0) {
    application_->end(feed.stream);
    feed.stream = 0;  // Messages in flight are discarded.
  }
}

const foxglove::Channel* Hub::find_channel(std::uint32_t id) const {
  return id == 0 || id > channels_.size() ? nullptr : &channels_[id - 1];
}

const foxglove::Channel* Hub::find_channel(std::string_view topic) const {
  const auto found = std::ranges::find(channels_, topic, &foxglove::Channel::topic);
  return found == channels_.end() ? nullptr : &*found;
}

const foxglove::Service* Hub::find_service(std::uint32_t id) const {
  return id == 0 || id > services_.size() ? nullptr : &services_[id - 1];
}

const archive::MessageType& Hub::type_of(const std::string& name, const std::string& schema) {
  std::unique_ptr<archive::MessageType>& type = types_[name];
  if (type == nullptr) {
    type = std::make_unique<archive::MessageType>(
        mcap::Schema{.id = 1, .name = name, .encoding = "protobuf", .data = schema});
  }
  return *type;
}

bool Hub::may(std::string_view word) const {
  return std::ranges::find(application_->welcome().allow(), word) !=
         application_->welcome().allow().end();
}

bool Hub::may_publish(const std::string& topic) const {
  return may("publish") && !options_.publish.empty() && publishable_.wants(topic);
}

void Hub::take_overview(const protocol::Overview& overview) {
  foxglove::Graph graph;
  for (const protocol::Topic& topic : overview.topics()) {
    for (const protocol::Publisher& publisher : topic.publishers()) {
      graph.published[topic.name()].insert(publisher.component());
    }
    for (const protocol::Subscriber& subscriber : topic.subscribers()) {
      if (subscriber.kind() != "tap") {
        graph.subscribed[topic.name()].insert(subscriber.component());
      }
    }
  }
  for (const protocol::Service& service : overview.services()) {
    graph.services[service.name()].insert(service.component());
  }
  if (graph == graph_) {
    return;
  }
  for (Listener* listener : listeners_) {
    if (listener->wants_graph()) {
      listener->take_graph(graph, graph_);
    }
  }
  graph_ = std::move(graph);
}

void Hub::take_playback(const protocol::Playback& playback) {
  const protocol::Playback before = std::exchange(playback_, playback).value_or(playback);
  const bool did_seek = before.seeks() != playback.seeks();
  if (did_seek) {
    for (auto& [channel, feed] : feeds_) {
      feed.kept.clear();  // Of another time; the present ones are sent again.
    }
  }
  if (did_seek || before.status() != playback.status() || before.speed() != playback.speed() ||
      before.problem() != playback.problem()) {
    for (Listener* listener : listeners_) {
      listener->take_playback(playback, did_seek);
    }
  }
}

void Hub::look(std::chrono::steady_clock::time_point now) {
  const auto wants = [&](const auto& what) { return std::ranges::any_of(listeners_, what); };
  const auto is_due = [&](auto& next, auto period) {
    if (now < next) {
      return false;
    }
    next = now + period;
    return true;
  };
  if (!asks_overview_ && wants([](const Listener* one) { return one->wants_graph(); }) &&
      is_due(next_overview_, kOverviewPeriod)) {
    asks_overview_ = true;
    protocol::Request request;
    request.mutable_overview()->set_without_components(true);
    post(std::move(request), nullptr, [this](const protocol::Answer& answer) {
      asks_overview_ = false;
      if (answer.has_overview()) {
        take_overview(answer.overview());
      }
    });
  }
  if (is_simulated_ && !asks_time_ && !listeners_.empty() && is_due(next_time_, kTimePeriod)) {
    asks_time_ = true;
    protocol::Request request;
    request.mutable_overview()->set_without_components(true);
    request.mutable_overview()->set_without_topics(true);
    post(std::move(request), nullptr, [this](const protocol::Answer& answer) {
      asks_time_ = false;
      if (answer.overview().has_playback()) {
        take_playback(answer.overview().playback());
      }
      for (Listener* listener : listeners_) {
        listener->take_time(answer.overview().now_ns());
      }
    });
  }
  if (!asks_params_ && wants([](const Listener* one) { return one->wants_params(); }) &&
      is_due(next_params_, kParamsPeriod)) {
    asks_params_ = true;
    protocol::Request request;
    request.mutable_params();
    post(std::move(request), nullptr, [this](const protocol::Answer& answer) {
      asks_params_ = false;
      for (Listener* listener : listeners_) {
        listener->take_params(answer.params());
      }
    });
  }
  if (is_due(next_losses_, kLossesPeriod)) {
    for (Listener* listener : listeners_) {
      listener->report_losses();
    }
  }
}

}  // namespace fastcycle::web
