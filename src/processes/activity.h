#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "executor/peer_activity.h"
#include "processes/process_plan.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// The activity of one process, read by another.
///
/// @threads  Safe.
class ActivityOfProcess final : public detail::PeerActivity {
 public:
  /// The plan, which specifies the recorded activity, and `wire` must outlive it.
  ActivityOfProcess(const ProcessPlan& plan, const segment::Wire& wire,
                    segment::ProcessIndex process);

  [[nodiscard]] const std::string& name() const override { return plan_.name(process_); }
  [[nodiscard]] const std::vector<std::string>& worker_names() const override {
    return worker_names_;
  }
  [[nodiscard]] std::int64_t pid() const override;
  [[nodiscard]] std::uint32_t incarnation() const override {
    return wire_.incarnation(process_).load(std::memory_order_acquire);
  }
  [[nodiscard]] const Rings& rings(std::uint32_t incarnation) const override {
    return rings_[segment::Wire::generation_of(incarnation)];
  }

 private:
  const ProcessPlan& plan_;
  const segment::Wire& wire_;
  const segment::ProcessIndex process_;
  std::vector<std::string> worker_names_;
  std::vector<std::unique_ptr<const detail::ReadRing>> reads_;
  std::array<Rings, segment::Segments::kGenerations> rings_;
};

}  // namespace fastcycle::processes
