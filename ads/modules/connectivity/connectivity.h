#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <fastcycle/fastcycle.h>

#include "connectivity/hazard.pb.h"
#include "link.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "supervision/state.pb.h"

namespace ads {

/// Why a hazard is rejected; empty if it is valid.
std::string error_in(const connectivity::Hazard& hazard, fastcycle::Time now);

/// The vehicle's connection to the outside world: forwards the mission and validated hazards, and
/// reports the vehicle's position.
///
/// In:   `localization/ego`, `supervision/state`, `connectivity/inbox`
/// Out:  `mission/initial_pose`, `mission/goal`, once; `connectivity/hazard`;
///       `connectivity/vehicle_report`, once a second
class Connectivity final : public fastcycle::Component {
 public:
  explicit Connectivity(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  void receive();
  void publish(const Mission& mission);
  void take(const connectivity::Hazard& hazard);
  void send_report();

  fastcycle::Param<fastcycle::Path> scenario_;
  fastcycle::Param<double> settle_s_;
  fastcycle::Param<double> position_stddev_m_;
  fastcycle::Param<double> heading_stddev_rad_;
  fastcycle::Param<double> speed_stddev_mps_;
  fastcycle::Param<connectivity::HazardPlan> hazard_plan_;
  fastcycle::Publisher<mission::InitialPose> initial_poses_;
  fastcycle::Publisher<mission::Goal> goals_;
  fastcycle::Publisher<connectivity::Hazard> hazards_;
  fastcycle::Publisher<connectivity::VehicleReport> reports_;
  fastcycle::Latest<localization::Ego> ego_;
  fastcycle::Latest<supervision::State> state_;
  fastcycle::Timer receive_timer_;

  std::unique_ptr<Link> link_;
  std::int64_t hazards_passed_on_ = 0;
  std::int64_t hazards_refused_ = 0;
};

}  // namespace ads
