#pragma once

#include <cstddef>
#include <cstdint>

#include "common/commonroad.h"
#include "link.h"

namespace ads {

struct ScenarioLinkOptions {
  fastcycle::Duration settle{};  ///< From the application's start to step 0.
  double position_stddev_m = 0.5;
  double heading_stddev_rad = 0.02;
  double speed_stddev_mps = 0.5;
  double centre_to_rear_axle_m = 1.29;
};

/// The mission is that of a scenario; hazards come as planned; reports are only counted.
///
/// The initial pose is that of step 0, rolled back to the start with constant speed, along its lane
/// (`LeadIn`). Of several goals it is the first; a goal that is a circle or a polygon is told by a
/// square inside of it.
class ScenarioLink final : public Link {
 public:
  ScenarioLink(const Scenario& scenario, connectivity::HazardPlan hazards, fastcycle::Time start,
               const ScenarioLinkOptions& options);

  std::optional<Mission> receive_mission(fastcycle::Time now) override;
  std::vector<connectivity::Hazard> receive_hazards(fastcycle::Time now) override;
  [[nodiscard]] std::optional<fastcycle::Time> next_due() const override;
  void send(const connectivity::VehicleReport& report) override;

  [[nodiscard]] std::int64_t reports() const { return reports_; }

 private:
  struct DueHazard {
    fastcycle::Time due{};
    connectivity::Hazard hazard;
  };

  std::optional<Mission> mission_;
  std::vector<DueHazard> hazards_;  // In the order in which they come.
  std::size_t next_hazard_ = 0;
  std::int64_t reports_ = 0;
};

/// The largest square along `heading_rad` around the middle of the polygon's corners that has its
/// corners inside; one of 0.1 m if the middle is outside.
Box square_inside(const std::vector<Eigen::Vector2d>& polygon_m, double heading_rad);

}  // namespace ads
