#include "broker/quality.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "base/clock.h"
#include "broker/publishing_component.h"
#include "broker/topic.h"
#include "fastcycle/assert.h"

namespace fastcycle::detail {
namespace {

/// So that sums of times stay within their range.
constexpr Duration kLongest = std::chrono::hours(24 * 365);

std::optional<Duration> checked(std::optional<Duration> span) noexcept {
  FASTCYCLE_ASSERT(!span || *span > Duration(0),
                   "a deadline, a lifespan and a lease are longer than nothing");
  return span ? std::optional(std::min(*span, kLongest)) : std::nullopt;
}

std::optional<Duration> shorter(std::optional<Duration> a, std::optional<Duration> b) noexcept {
  return a && b ? std::min(*a, *b) : a ? a : b;
}

}  // namespace

void Watch::set_callback(const QosCallback& callback) {
  callback_ = callback ? std::make_shared<const QosCallback>(callback) : nullptr;
  has_callback_ = callback_ != nullptr;
}

void Deadline::set_period(std::optional<Duration> period) noexcept {
  period_ = checked(period);
}

void Deadline::begin(std::int64_t now_ns) noexcept {
  last_ns_ = now_ns;
  missed_in_a_row_ = 0;
}

std::uint64_t Deadline::look(std::int64_t newest_ns, std::int64_t now_ns) noexcept {
  if (newest_ns > last_ns_) {
    begin(newest_ns);
  }
  if (!period_ || now_ns <= last_ns_) {
    return 0;
  }
  const auto missed = static_cast<std::uint64_t>((now_ns - last_ns_ - 1) / period_->count());
  return missed > missed_in_a_row_ ? missed - std::exchange(missed_in_a_row_, missed) : 0;
}

std::int64_t Deadline::next_look_ns() const noexcept {
  return period_ ? last_ns_ + static_cast<std::int64_t>(missed_in_a_row_ + 1) * period_->count() + 1
                 : base::kNever;
}

Quality::Quality(const Topic& topic, const SubscriberOptions& options) : topic_(topic) {
  set(options);
}

bool Quality::is_asked_for(const Topic& topic, const SubscriberOptions& options) noexcept {
  return topic.options.lifespan || options.lifespan || options.deadline || options.liveliness ||
         options.on_event;
}

void Quality::set(const SubscriberOptions& options) {
  deadline_.set_period(options.deadline);
  lifespan_ = checked(shorter(options.lifespan, topic_.options.lifespan));
  lease_ = checked(options.liveliness);
  set_callback(options.on_event);
}

void Quality::add(std::shared_ptr<const Lane> lane, std::string_view component) {
  sources_.push_back({.lane = std::move(lane), .component = component});
}

void Quality::end() noexcept {
  sources_.clear();
  deadline_.set_period(std::nullopt);
  lease_.reset();
}

void Quality::begin(std::int64_t now_ns) noexcept {
  begin_ns_ = now_ns;
  deadline_.begin(now_ns);
}

std::int64_t Quality::last_alive_ns(const Source& source) const noexcept {
  return std::max({begin_ns_, source.alive_ns, source.lane->newest_ns()});
}

/// When the newest message of all was published; what a full queue refused counts as of now.
std::int64_t Quality::newest_ns(std::int64_t now_ns) noexcept {
  std::int64_t newest_ns = begin_ns_;
  std::uint64_t refused = 0;
  for (const Source& source : sources_) {
    newest_ns = std::max(newest_ns, source.lane->newest_ns());
    if (source.lane->options.overflow == Overflow::kDropNewest) {
      refused += source.lane->overflowed.get();
    }
  }
  return refused > std::exchange(refused_, refused) ? now_ns : newest_ns;
}

std::optional<QosEvent> Quality::look(std::int64_t now_ns) noexcept {
  if (deadline_.period()) {
    if (const std::uint64_t missed = deadline_.look(newest_ns(now_ns), now_ns); missed > 0) {
      deadlines_missed.add(missed);
      return QosEvent{.kind = QosKind::kDeadlineMissed,
                      .topic = topic_.name,
                      .count = deadlines_missed.get(),
                      .since = base::from_ns(deadline_.last_ns())};
    }
  }
  if (lease_) {
    for (Source& source : sources_) {
      const std::int64_t last_alive = last_alive_ns(source);
      if (!source.is_lost && now_ns - last_alive > lease_->count()) {
        return lose(source, "silent", last_alive, last_alive);
      }
    }
  }
  return std::nullopt;
}

std::int64_t Quality::next_look_ns() const noexcept {
  std::int64_t next_ns = deadline_.next_look_ns();
  for (const Source& source : sources_) {
    if (lease_ && !source.is_lost) {
      next_ns = std::min(next_ns, last_alive_ns(source) + lease_->count() + 1);
    }
  }
  return next_ns;
}

Quality::Source* Quality::find(const Lane& lane) noexcept {
  const auto found =
      std::ranges::find(sources_, &lane, [](const Source& source) { return source.lane.get(); });
  return found == sources_.end() ? nullptr : &*found;
}

bool Quality::is_expired(std::int64_t published_ns, std::int64_t now_ns) const noexcept {
  return lifespan_ && now_ns - published_ns > lifespan_->count();
}

Quality::Verdict Quality::judge(const Lane& lane, const Lane::Head& head, std::int64_t now_ns,
                                QosEvent& event) noexcept {
  if (Source* source = find(lane)) {
    if (source->is_lost && head.time_ns > source->lost_ns) {
      event = gain(*source, "publishes", now_ns);
      return Verdict::kReport;
    }
    if (source->sequence != 0 && head.sequence > source->sequence + 1) {
      messages_lost.add(head.sequence - source->sequence - 1);
      source->sequence = head.sequence - 1;
      event = {.kind = QosKind::kMessageLost,
               .topic = topic_.name,
               .publisher = source->component,
               .count = messages_lost.get(),
               .since = base::from_ns(now_ns)};
      return Verdict::kReport;
    }
  }
  if (!is_expired(head.time_ns, now_ns)) {
    return Verdict::kDeliver;
  }
  event = {.kind = QosKind::kMessageExpired,
           .topic = topic_.name,
           .count = expired.get() + 1,
           .since = base::from_ns(head.time_ns)};
  return Verdict::kExpired;
}

void Quality::took(const Lane& lane, const Lane::Head& head) noexcept {
  if (Source* source = find(lane)) {
    source->sequence = head.sequence;
  }
}

void Quality::forget_gaps() noexcept {
  for (Source& source : sources_) {
    source.sequence = 0;
  }
}

QosEvent Quality::lose(Source& source, std::string_view reason, std::int64_t lost_ns,
                       std::int64_t since_ns) noexcept {
  source.is_lost = true;
  source.lost_ns = lost_ns;
  liveliness_lost.add();
  return {.kind = QosKind::kLivelinessLost,
          .topic = topic_.name,
          .publisher = source.component,
          .reason = reason,
          .count = liveliness_lost.get(),
          .since = base::from_ns(since_ns)};
}

QosEvent Quality::gain(Source& source, std::string_view reason, std::int64_t since_ns) noexcept {
  source.is_lost = false;
  source.alive_ns = since_ns;
  liveliness_gained.add();
  return {.kind = QosKind::kLivelinessGained,
          .topic = topic_.name,
          .publisher = source.component,
          .reason = reason,
          .count = liveliness_gained.get(),
          .since = base::from_ns(since_ns)};
}

std::optional<QosEvent> Quality::on_liveliness(PublisherId publisher, bool is_alive,
                                               std::string_view reason,
                                               std::int64_t now_ns) noexcept {
  for (Source& source : sources_) {
    if (source.lane->publisher == publisher && source.is_lost == is_alive) {
      return is_alive ? gain(source, reason, now_ns) : lose(source, reason, now_ns, now_ns);
    }
  }
  return std::nullopt;
}

void Watch::keep(const PublishingComponent& component, const QosEvent& event) const noexcept {
  if (component.reads != nullptr) {
    component.learned(ReadKind::kQosEvent, WrittenEvent::write(event), place);
  }
}

std::string WrittenEvent::write(const QosEvent& event) {
  return fmt::format("{} {} {}\n{}\n{}", static_cast<unsigned>(event.kind), event.count,
                     base::to_ns(event.since), event.reason, event.publisher);
}

std::optional<QosEvent> WrittenEvent::read(std::string_view text, std::string_view topic) {
  std::uint64_t kind = 0;
  std::uint64_t count = 0;
  std::int64_t since_ns = 0;
  const char* place = text.data();
  const char* const end = text.data() + text.size();
  const auto take = [&](auto& number, char separator) {
    const auto [next, error] = std::from_chars(place, end, number);
    const bool is_number = error == std::errc() && next != end && *next == separator;
    place = is_number ? next + 1 : end;
    return is_number;
  };
  if (!take(kind, ' ') || !take(count, ' ') || !take(since_ns, '\n') ||
      kind > static_cast<std::uint64_t>(QosKind::kMessageLost)) {
    return std::nullopt;
  }
  const std::string_view words(place, static_cast<std::size_t>(end - place));
  const std::size_t line = words.find('\n');
  if (line == std::string_view::npos) {
    return std::nullopt;
  }
  return QosEvent{.kind = static_cast<QosKind>(kind),
                  .topic = topic,
                  .publisher = words.substr(line + 1),
                  .reason = words.substr(0, line),
                  .count = count,
                  .since = base::from_ns(since_ns)};
}

}  // namespace fastcycle::detail
