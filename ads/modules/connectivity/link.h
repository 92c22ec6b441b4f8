#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "connectivity/hazard.pb.h"
#include "mission/goal.pb.h"

namespace ads {

struct Mission {
  mission::InitialPose initial_pose;
  mission::Goal goal;
};

inline fastcycle::Duration duration_of(double value_s) {
  return std::chrono::duration_cast<fastcycle::Duration>(std::chrono::duration<double>(value_s));
}

/// Connects the vehicle to the outside world: a dispatcher that assigns missions, and other parties
/// that warn of hazards and receive the vehicle's reports. Times in its messages are on the
/// application's clock.
///
/// @threads  Confined to its component's activations.
class Link {
 public:
  Link() = default;
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  virtual ~Link() = default;

  /// A mission not returned before.
  virtual std::optional<Mission> receive_mission(fastcycle::Time now) = 0;
  /// The hazards not returned before.
  virtual std::vector<connectivity::Hazard> receive_hazards(fastcycle::Time now) = 0;
  /// When to receive next; none if that is unknown.
  [[nodiscard]] virtual std::optional<fastcycle::Time> next_due() const = 0;
  virtual void send(const connectivity::VehicleReport& report) = 0;
};

}  // namespace ads
