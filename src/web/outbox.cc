#include "web/outbox.h"

#include <algorithm>
#include <utility>

#include "web/foxglove.h"

namespace fastcycle::web {

std::string Frame::wire_head() const {
  constexpr std::size_t kMaxOfOneByte = 125;
  constexpr std::size_t kMaxOfTwoBytes = 0xFFFF;
  const std::size_t bytes = size();
  std::string wire;
  wire += is_text ? '\x81' : '\x82';
  std::size_t width = 0;
  if (bytes <= kMaxOfOneByte) {
    wire += static_cast<char>(bytes);
  } else if (bytes <= kMaxOfTwoBytes) {
    wire += '\x7E';
    width = 2;
  } else {
    wire += '\x7F';
    width = 8;
  }
  while (width > 0) {
    --width;
    wire += static_cast<char>((bytes >> (8 * width)) & 0xFFU);
  }
  return wire;
}

void Outbox::put(Frame frame) {
  control_waiting_ += frame.size();
  control_.push_back(std::move(frame));
}

void Outbox::remove(std::uint32_t subscription) {
  const auto found = lanes_.find(subscription);
  if (found != lanes_.end()) {
    waiting_ -= found->second.waiting;
    lanes_.erase(found);
  }
}

void Outbox::drop_oldest(Lane& lane) {
  const std::size_t bytes = lane.messages.front()->payload.size();
  lane.messages.pop_front();
  lane.waiting -= bytes;
  waiting_ -= bytes;
  ++lane.lost;
}

void Outbox::put(std::uint32_t subscription, std::shared_ptr<const SharedMessage> message) {
  const auto found = lanes_.find(subscription);
  if (found == lanes_.end()) {
    return;
  }
  Lane& lane = found->second;
  const std::size_t bytes = message->payload.size();
  if (bytes >= options_.large_bytes) {
    while (!lane.messages.empty()) {
      drop_oldest(lane);
    }
  }
  lane.messages.push_back(std::move(message));
  lane.waiting += bytes;
  waiting_ += bytes;
  while (waiting_ > options_.bytes) {
    Lane* const victim = largest(2);
    if (victim == nullptr) {
      break;
    }
    drop_oldest(*victim);
  }
  // A message larger than the limit is sent alone, or not at all.
  while (waiting_ > 4 * options_.bytes && waiting_ != bytes) {
    drop_oldest(*largest(1));
  }
}

void Outbox::forget_messages() {
  for (auto& [subscription, lane] : lanes_) {
    lane.messages.clear();
    lane.waiting = 0;
  }
  waiting_ = 0;
}

Outbox::Lane* Outbox::largest(std::size_t count) {
  Lane* found = nullptr;
  for (auto& [subscription, lane] : lanes_) {
    if (lane.messages.size() >= count && (found == nullptr || lane.waiting > found->waiting)) {
      found = &lane;
    }
  }
  return found;
}

std::optional<Frame> Outbox::take() {
  if (!control_.empty()) {
    Frame frame = std::move(control_.front());
    control_.pop_front();
    control_waiting_ -= frame.size();
    return frame;
  }
  if (waiting_ == 0 &&
      std::ranges::all_of(lanes_, [](const auto& one) { return one.second.messages.empty(); })) {
    return std::nullopt;
  }
  auto next = lanes_.upper_bound(last_);
  for (;;) {
    if (next == lanes_.end()) {
      next = lanes_.begin();
    }
    if (!next->second.messages.empty()) {
      break;
    }
    ++next;
  }
  last_ = next->first;
  Lane& lane = next->second;
  Frame frame{.is_text = false, .head = {}, .message = std::move(lane.messages.front())};
  lane.messages.pop_front();
  lane.waiting -= frame.message->payload.size();
  waiting_ -= frame.message->payload.size();
  frame.head = foxglove::message_head(last_, frame.message->time_ns);
  return frame;
}

std::vector<Outbox::Loss> Outbox::take_losses() {
  std::vector<Loss> losses;
  for (auto& [subscription, lane] : lanes_) {
    if (lane.lost > 0) {
      losses.push_back({subscription, std::exchange(lane.lost, 0)});
    }
  }
  return losses;
}

}  // namespace fastcycle::web
