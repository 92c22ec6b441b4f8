#include "inspect/taps.h"

#include <algorithm>
#include <string>
#include <utility>

#include "inspect/pause.h"

namespace fastcycle::inspect {
namespace {

constexpr std::size_t kMaxDepth = 64;
constexpr std::size_t kMinDepth = 2;       // For a user that wants only the newest message.
constexpr std::size_t kMinDepthOfAll = 4;  // 40 ms at 100 Hz.
constexpr std::uint64_t kBytes = std::uint64_t{1} << 20U;
constexpr std::uint64_t kBytesOfAll = std::uint64_t{16} << 20U;
constexpr const char* kTapName = "inspect";

class Nobody final : public detail::ReadyQueue {
 public:
  void enqueue(std::uint32_t) noexcept override {}
  void wake() noexcept override {}
  void prepare(std::uint32_t) noexcept override {}
};

}  // namespace

struct Tap::Reception {
  Reception(detail::Topic& topic, std::size_t depth, bool with_latched)
      : subscription(topic, inbox, kTapName, detail::Subscription::Kind::kTap,
                     SubscriberOptions{
                         .depth = depth,
                         .overflow = Overflow::kDropOldest,
                         .keep = topic.options.latched,
                         .history = with_latched ? std::nullopt : std::optional<std::size_t>(0)}) {
    inbox.attach(nobody, 0);
    for (const auto& publisher : topic.publishers) {
      lanes.push_back(detail::Topics::make_lane(*publisher, subscription));
    }
  }

  Nobody nobody;
  detail::Inbox inbox;
  detail::Subscription subscription;
  std::vector<std::shared_ptr<detail::Lane>> lanes;  ///< In the order of the publishers.
  bool is_leaving = false;
};

Tap::Tap(host::Application& application, detail::Topic& its_topic)
    : topic(its_topic), application_(application) {
  std::uint64_t bytes = 0;
  for (const auto& publisher : topic.publishers) {
    bytes = std::max(bytes, publisher->prototype_bytes());
  }
  receive(bytes == 0 ? kMinDepth : depth_for(bytes, false));
}

Tap::~Tap() {
  forget();
}

std::size_t Tap::depth_for(std::uint64_t bytes, bool wants_each) noexcept {
  const std::uint64_t most = wants_each ? kBytesOfAll : kBytes;
  return std::clamp<std::size_t>(most / std::max<std::uint64_t>(bytes, 1),
                                 wants_each ? kMinDepthOfAll : kMinDepth, kMaxDepth);
}

void Tap::receive(std::size_t depth) {
  const auto old = receptions_.empty() ? nullptr : receptions_.back();
  const auto fresh = std::make_shared<Reception>(topic, depth, old == nullptr);
  receptions_.push_back(fresh);
  depth_ = depth;
  if (old != nullptr) {
    old->is_leaving = true;
  }
  for (std::size_t i = 0; i < topic.publishers.size(); ++i) {
    detail::PublisherCore& publisher = *topic.publishers[i];
    // Nothing is published in between: the new lane continues where the old one ends.
    application_.beside(publisher, [&publisher, fresh, old, i] {
      publisher.connect(fresh->lanes[i], fresh->inbox);
      if (old != nullptr) {
        publisher.disconnect(*old->lanes[i]);
      }
    });
  }
}

void Tap::leave() {
  const auto last = receptions_.back();
  last->is_leaving = true;
  for (std::size_t i = 0; i < topic.publishers.size(); ++i) {
    detail::PublisherCore& publisher = *topic.publishers[i];
    application_.beside(publisher,
                        [&publisher, last, i] { publisher.disconnect(*last->lanes[i]); });
  }
}

bool Tap::has_left() const noexcept {
  return std::ranges::all_of(receptions_, [](const auto& reception) {
    return reception->is_leaving && std::ranges::all_of(reception->lanes, [](const auto& lane) {
             return lane->is_left_by_publisher.load();
           });
  });
}

void Tap::cut() {
  for (const auto& reception : receptions_) {
    for (std::size_t i = 0; i < reception->lanes.size(); ++i) {
      topic.publishers[i]->disconnect(*reception->lanes[i]);
      reception->lanes[i]->drain();
    }
  }
  forget();
}

void Tap::forget() {
  for (const Kept& kept : kept_) {
    detail::release(kept.envelope);
  }
  kept_.clear();
}

void Tap::add(TapUser& user, bool wants_each) {
  for (const Kept& kept : kept_) {
    user.take(*kept.publisher, *kept.envelope);
  }
  users_.push_back({&user, wants_each});
  look_for_depth();
}

void Tap::remove(TapUser& user) noexcept {
  std::erase_if(users_, [&](const User& other) { return other.user == &user; });
}

void Tap::look_for_depth() {
  std::uint64_t bytes = message_bytes_;
  for (const auto& publisher : topic.publishers) {
    bytes = std::max(bytes, publisher->prototype_bytes());
  }
  if (bytes == 0) {
    return;  // No message was received yet.
  }
  const bool wants_each =
      std::ranges::any_of(users_, [](const User& user) { return user.wants_each; });
  const std::size_t depth = depth_for(bytes, wants_each);
  const bool is_settled = receptions_.size() == 1;
  if (is_settled && depth > depth_) {
    receive(depth);
  }
}

void Tap::take() {
  for (std::size_t i = 0; i < receptions_.size(); ++i) {
    take_from(*receptions_[i]);
  }
  // A reception that its publishers have left receives nothing more: its last messages were just
  // taken.
  while (receptions_.size() > 1 &&
         std::ranges::all_of(receptions_.front()->lanes, [](const auto& lane) {
           return lane->is_left_by_publisher.load() && lane->queued() == 0;
         })) {
    receptions_.pop_front();
  }
  look_for_depth();
}

void Tap::take_from(Reception& reception) {
  for (std::size_t i = 0; i < reception.lanes.size(); ++i) {
    detail::Lane& lane = *reception.lanes[i];
    detail::Lane::Head head;
    for (std::size_t count = 0; count < lane.options.depth && lane.peek(head); ++count) {
      if (!lane.pop(head)) {
        continue;
      }
      lane.delivered.add();
      hand(*topic.publishers[i], *head.envelope);
      detail::release(head.envelope);
    }
  }
}

void Tap::hand(const detail::PublisherCore& publisher, detail::Envelope& envelope) {
  if (message_bytes_ == 0) {
    message_bytes_ = envelope.payload->SpaceUsedLong();
  }
  before_newest_ = newest_;
  newest_ = envelope.info.publish_time;
  for (const User& user : users_) {
    user.user->take(publisher, envelope);
  }
  if (topic.options.latched > 0) {
    keep(publisher, envelope);
  }
}

void Tap::keep(const detail::PublisherCore& publisher, detail::Envelope& envelope) {
  detail::retain(envelope);
  kept_.push_back({&publisher, &envelope});
  if (kept_.size() > topic.options.latched) {
    detail::release(kept_.front().envelope);
    kept_.pop_front();
  }
}

void Taps::provide() {
  for (const auto& [name, topic] : application_.topics().all()) {
    for (const auto& publisher : topic->publishers) {
      const std::uint64_t bytes = publisher->prototype_bytes();
      publisher->provide_for({.depth = Tap::depth_for(bytes, true)}, topic->options.latched);
    }
  }
}

Tap& Taps::get(detail::Topic& topic) {
  auto& tap = taps_[&topic];
  if (tap == nullptr) {
    tap = std::make_unique<Tap>(application_, topic);
  }
  return *tap;
}

void Taps::look() {
  for (auto next = taps_.begin(); next != taps_.end();) {
    Tap& tap = *next->second;
    if (tap.is_used()) {
      tap.take();
      ++next;
      continue;
    }
    tap.leave();
    bytes_[&tap.topic] = tap.message_bytes();
    leaving_.push_back(std::move(next->second));
    next = taps_.erase(next);
  }
  for (const auto& tap : leaving_) {
    tap->take();
  }
  std::erase_if(leaving_, [](const auto& tap) { return tap->has_left(); });
}

std::chrono::nanoseconds Taps::wait_for_pause(Time now, std::chrono::nanoseconds period) const {
  const Tap* last = nullptr;
  for (const auto& [topic, tap] : taps_) {
    if (last == nullptr || tap->newest() > last->newest()) {
      last = tap.get();
    }
  }
  if (last == nullptr) {
    return period;
  }
  return inspect::wait_for_pause(last->newest() - last->before_newest(), now - last->newest(),
                                 period);
}

std::uint64_t Taps::message_bytes(const detail::Topic& topic) const {
  if (const auto found = taps_.find(&topic); found != taps_.end()) {
    return found->second->message_bytes();
  }
  const auto known = bytes_.find(&topic);
  return known == bytes_.end() ? 0 : known->second;
}

void Taps::cut() {
  for (const auto& [topic, tap] : taps_) {
    tap->cut();
  }
  for (const auto& tap : leaving_) {
    tap->cut();
  }
  taps_.clear();
  leaving_.clear();
}

}  // namespace fastcycle::inspect
