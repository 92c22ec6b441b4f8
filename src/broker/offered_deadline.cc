#include "broker/offered_deadline.h"

#include <algorithm>

#include "base/clock.h"
#include "broker/publisher_core.h"
#include "broker/topic.h"

namespace fastcycle::detail {

OfferedDeadline::OfferedDeadline(PublisherCore& its_publisher, Duration period)
    : publisher(its_publisher) {
  deadline_.set_period(period);
}

void OfferedDeadline::begin(std::int64_t now_ns) noexcept {
  begin_ns_ = now_ns;
  deadline_.begin(now_ns);
}

std::optional<QosEvent> OfferedDeadline::look(std::int64_t now_ns) noexcept {
  const std::int64_t newest_ns =
      std::max(begin_ns_, base::to_ns(publisher.read_last_publish_time()));
  const std::uint64_t periods = deadline_.look(newest_ns, now_ns);
  if (periods == 0) {
    return std::nullopt;
  }
  missed.add(periods);
  return QosEvent{.kind = QosKind::kDeadlineMissed,
                  .topic = publisher.topic.name,
                  .publisher = publisher.owner.name,
                  .count = missed.get(),
                  .since = base::from_ns(deadline_.last_ns())};
}

std::int64_t OfferedDeadline::next_look_ns() const noexcept {
  return deadline_.next_look_ns();
}

}  // namespace fastcycle::detail
