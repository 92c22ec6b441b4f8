#include "processes/activity.h"

#include "component/time_driver.h"

namespace fastcycle::processes {

static_assert(detail::PeerActivity::kReadable == segment::Segments::kGenerations);

ActivityOfProcess::ActivityOfProcess(const ProcessPlan& process_plan, const segment::Wire& wire,
                                     segment::ProcessIndex process)
    : plan_(process_plan),
      wire_(wire),
      process_(process),
      worker_names_(host::worker_names(process_plan.description_in(process))) {
  const segment::WirePlan& plan = wire.plan();
  for (std::uint32_t incarnation = 1; incarnation <= rings_.size(); ++incarnation) {
    Rings& rings = rings_[segment::Wire::generation_of(incarnation)];
    for (unsigned worker = 0; worker < plan.workers[process]; ++worker) {
      rings.workers.push_back(&wire.ring(process, incarnation, worker));
    }
    for (std::size_t component = 0; component < plan.reads.size(); ++component) {
      const bool is_on_standby = plan.reads_on_standby[component].process == process;
      if (plan.reads[component].process == process || is_on_standby) {
        reads_.push_back(wire.reads(process, component, incarnation));
        rings.reads.push_back(reads_.back().get());
      } else {
        rings.reads.push_back(nullptr);
      }
    }
  }
}

std::int64_t ActivityOfProcess::pid() const {
  const std::uint32_t now = incarnation();
  return now == 0 ? 0
                  : wire_.stage(process_, now, plan_.pid_word()).load(std::memory_order_acquire);
}

}  // namespace fastcycle::processes
