#include "dds_gateway/clock_exchange.h"

#include <algorithm>
#include <random>
#include <utility>

#include "dds_gateway/wire_time.h"
#include "ros2/cdr.h"
#include "ros2/error.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr Duration kForgotten = 10s;

std::uint64_t random_number() {
  std::random_device device;
  std::uint64_t number = 0;
  while (number == 0) {
    number = std::uint64_t{device()} << 32U | device();
  }
  return number;
}

Endpoint endpoint_of(bool is_reader, const std::string& user_data) {
  return {.topic = kClockTopic,
          .type = ros2::dds_type(kRoundTripType),
          .user_data = user_data,
          .qos = {.is_reliable = false, .is_transient_local = false, .depth = 100},
          .is_reader = is_reader};
}

}  // namespace

/// As fastcycle_msgs/msg/RoundTrip.
struct ClockExchange::Message {
  std::uint64_t asker = 0;
  std::uint64_t answerer = 0;
  Time asked{};
  Time came{};
  Time answered{};
  Duration to_system{};
  std::string node = {};
};

ClockExchange::ClockExchange(Participant& participant, const base::Clock& clock, std::string node,
                             const std::string& user_data, ClockSource source)
    : clock_(clock), node_(std::move(node)), source_(source), id_(random_number()) {
  writer_ = participant.create_writer(endpoint_of(false, user_data));
  reader_ = participant.create_reader(
      endpoint_of(true, user_data),
      [this](std::span<const std::byte> message, const SampleInfo& info) { take(message, info); });
}

std::chrono::milliseconds ClockExchange::ask() {
  const Time now = clock_.now();
  const Duration since = now - asked_;
  if (since < kPeriod) {
    return std::chrono::ceil<std::chrono::milliseconds>(kPeriod - since);
  }
  answers_ = 0;
  asked_ = now;
  send({.asker = id_, .asked = clock_.now()});
  return kPeriod;
}

void ClockExchange::take(std::span<const std::byte> bytes, const SampleInfo& info) {
  Message message;
  try {
    ros2::CdrReader in(bytes, kRoundTripType);
    const auto read_time = [&](const char* field) { return read_wire_time(in, field); };
    in.number("asker", message.asker);
    in.number("answerer", message.answerer);
    message.asked = read_time("asked_ns");
    message.came = read_time("came_ns");
    message.answered = read_time("answered_ns");
    message.to_system = Duration(std::clamp(in.number<std::int64_t>("to_system_ns"),
                                            -kWireTimeMax_ns / 2, kWireTimeMax_ns / 2));
    message.node = in.text("node");
    in.end();
  } catch (const ros2::CdrError&) {
    return;  // The clock cannot be identified.
  }
  const Time came = clock_.at_monotonic(info.came.count());
  if (message.answerer == 0 && message.asker != id_) {
    answer(message, came);
  } else if (message.answerer != 0 && message.asker == id_) {
    learn(message, came);
  }
}

void ClockExchange::answer(const Message& question, Time came) {
  if (answers_ == kAnswersMax) {
    return;
  }
  ++answers_;
  send({.asker = question.asker,
        .answerer = id_,
        .asked = question.asked,
        .came = came,
        .answered = clock_.now(),
        .to_system = to_system(),
        .node = node_});
}

void ClockExchange::learn(const Message& answer, Time back) {
  constexpr std::size_t kNameMax = 256;
  const Duration since_asked = back - answer.asked;
  if (since_asked < Duration(0) || since_asked > kForgotten || answer.node.size() > kNameMax) {
    return;  // It answers no pending request.
  }
  const std::lock_guard lock(mutex_);
  std::erase_if(peers_,
                [&](const auto& peer) { return back - peer.second.last_received > kForgotten; });
  if (peers_.size() >= kPeersMax && !peers_.contains(answer.answerer)) {
    return;
  }
  Peer& peer = peers_[answer.answerer];
  peer.difference.add(
      {.asked = answer.asked, .came = answer.came, .answered = answer.answered, .back = back});
  peer.node = answer.node;
  peer.to_system = answer.to_system;
  peer.last_received = back;
}

void ClockExchange::send(const Message& message) {
  ros2::Buffer bytes;
  ros2::CdrWriter writer(bytes, kRoundTripType);
  writer.number(message.asker);
  writer.number(message.answerer);
  writer.number(base::to_ns(message.asked));
  writer.number(base::to_ns(message.came));
  writer.number(base::to_ns(message.answered));
  writer.number(message.to_system.count());
  writer.text(message.node);
  writer.end();
  try {
    writer_->write(bytes);
  } catch (const EngineError&) {
    // The next request follows soon.
  }
}

Duration ClockExchange::to_system() const {
  return std::chrono::system_clock::now().time_since_epoch() - clock_.now().time_since_epoch();
}

ClockPeer ClockExchange::look_at(const Peer& peer, Time now) const {
  ClockPeer seen{.node = peer.node, .estimate = *peer.difference.at(now), .system_apart = {}};
  const Duration by_system = to_system() - peer.to_system;
  const Duration apart = std::chrono::abs(by_system - seen.estimate.ahead);
  seen.system_apart = std::max(Duration(0), apart - seen.estimate.bound);
  if (source_ == ClockSource::kSystem) {
    seen.estimate.ahead = by_system;
  }
  return seen;
}

std::optional<Duration> ClockExchange::ahead(std::uint64_t clock) const {
  const std::lock_guard lock(mutex_);
  const auto found = peers_.find(clock);
  if (found == peers_.end() || !found->second.difference.at(clock_.now())) {
    return {};
  }
  return look_at(found->second, clock_.now()).estimate.ahead;
}

std::vector<ClockPeer> ClockExchange::peers() const {
  const Time now = clock_.now();
  std::vector<ClockPeer> all;
  const std::lock_guard lock(mutex_);
  for (const auto& [id, peer] : peers_) {
    if (now - peer.last_received < kForgotten && peer.difference.at(now)) {
      all.push_back(look_at(peer, now));
    }
  }
  return all;
}

}  // namespace fastcycle::dds_gateway
