#pragma once

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

/// What joins the vehicle with the world outside: a dispatcher who gives missions, others who warn
/// of hazards and hear where the vehicle is. Times in its messages are on the application's clock.
///
/// @threads  Confined to its component's activations.
class Link {
 public:
  Link() = default;
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;
  virtual ~Link() = default;

  /// A mission that was not received before.
  virtual std::optional<Mission> receive_mission(fastcycle::Time now) = 0;
  /// The hazards that were not received before.
  virtual std::vector<connectivity::Hazard> receive_hazards(fastcycle::Time now) = 0;
  /// When something is to be received next; none if it is not known.
  [[nodiscard]] virtual std::optional<fastcycle::Time> next_due() const = 0;
  virtual void send(const connectivity::VehicleReport& report) = 0;
};

}  // namespace ads
