#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "executor/peer_activity.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// What is done in one process, read by another.
///
/// @threads  Safe.
class ActivityOfProcess final : public detail::PeerActivity {
 public:
  /// `wire` outlives it, and its plan has workers.
  ActivityOfProcess(const segment::Wire& wire, segment::ProcessIndex process);

  [[nodiscard]] std::uint32_t incarnation() const override {
    return wire_.incarnation(process_).load(std::memory_order_acquire);
  }
  [[nodiscard]] const Rings& rings(std::uint32_t incarnation) const override {
    return rings_[segment::Wire::generation_of(incarnation)];
  }

 private:
  const segment::Wire& wire_;
  const segment::ProcessIndex process_;
  std::vector<std::unique_ptr<const detail::ReadRing>> reads_;
  std::array<Rings, segment::Segments::kGenerations> rings_;
};

}  // namespace fastcycle::processes
