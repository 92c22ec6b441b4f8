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

/// Takes the mission from a scenario and hazards from a plan; only counts the reports.
///
/// The initial pose is that of step 0, moved back to the start with constant speed along its lane
/// (`LeadIn`). Of several goals it uses the first; a goal that is a circle or a polygon is replaced
/// by a square inside it.
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
  std::vector<DueHazard> hazards_;  // In the order of their times.
  std::size_t next_hazard_ = 0;
  std::int64_t reports_ = 0;
};

/// The largest square along `heading_rad` around the mean of the polygon's corners whose corners
/// are inside; one of 0.1 m if that mean is outside.
Box square_inside(const std::vector<Eigen::Vector2d>& polygon_m, double heading_rad);

}  // namespace ads
