#include "component/repeat_event.h"

#include <algorithm>
#include <string_view>

#include "base/clock.h"
#include "broker/quality.h"
#include "broker/topic.h"
#include "component/component_core.h"

namespace fastcycle::detail {

void repeat_event(ComponentCore& core, ActivationRing& ring,
                  std::span<const ReplayedReads::Entry> reads, std::uint64_t key,
                  std::int64_t time_ns, std::uint64_t skipped) {
  const auto recorded = std::ranges::find_if(
      reads, [](const auto& entry) { return entry.read.kind == ReadKind::kQosEvent; });
  if (recorded == reads.end()) {
    const auto& timers = core.timers();
    if (key < timers.size()) {
      core.repeat(ring, *timers[key], {.due = base::from_ns(time_ns), .skipped = skipped});
    }
    return;
  }
  const std::uint32_t place = recorded->read.place & ~Watch::kOffered;
  const Watch* watch = nullptr;
  std::string_view topic;
  if ((recorded->read.place & Watch::kOffered) != 0 && place < core.offered.size()) {
    watch = core.offered[place].get();
    topic = core.offered[place]->publisher.topic.name;
  } else if (place < core.subscriptions.callbacks().size()) {
    const CallbackSubscription& its = *core.subscriptions.callbacks()[place];
    watch = its.quality.get();
    topic = its.topic.name;
  }
  const auto event = WrittenEvent::read(recorded->text, topic);
  if (watch != nullptr && event) {
    core.repeat(ring, *watch, *event);
  }
}

}  // namespace fastcycle::detail
