#include "processes/activity.h"

namespace fastcycle::processes {

static_assert(detail::PeerActivity::kReadable == segment::Segments::kGenerations);

ActivityOfProcess::ActivityOfProcess(const segment::Wire& wire, segment::ProcessIndex process)
    : wire_(wire), process_(process) {
  const segment::WirePlan& plan = wire.plan();
  for (std::uint32_t incarnation = 1; incarnation <= rings_.size(); ++incarnation) {
    Rings& rings = rings_[segment::Wire::generation_of(incarnation)];
    for (unsigned worker = 0; worker < plan.workers[process]; ++worker) {
      rings.workers.push_back(&wire.ring(process, incarnation, worker));
    }
    for (std::size_t component = 0; component < plan.reads.size(); ++component) {
      if (plan.reads[component].process == process) {
        reads_.push_back(wire.reads(component, incarnation));
        rings.reads.push_back(reads_.back().get());
      } else {
        rings.reads.push_back(nullptr);
      }
    }
  }
}

}  // namespace fastcycle::processes
