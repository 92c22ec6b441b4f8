#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string_view>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "actuators.h"
#include "can/frame.pb.h"
#include "common/commonroad.h"
#include "common/frame_guard.h"
#include "common/lead_in.h"
#include "ego_model.h"
#include "referee.h"
#include "traffic.h"
#include "world/scene.pb.h"

namespace ads {

/// Simulates what is behind the vehicle's bus and in front of its sensors: the ego vehicle, the
/// traffic of a scenario, and a referee that detects collisions.
///
/// The world advances in steps of 10 ms from the application's start. The drive begins `settle_s`
/// later, with exactly the initial state of the scenario; before, all moving objects approach from
/// behind at constant speed: the ego vehicle along its lane, all others straight.
///
/// In:   `can/command`
/// Out:  `world/scene`, `can/state`
class World final : public fastcycle::Component {
 public:
  explicit World(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  // The driver's actions. With `kNone` no frames of the driver are sent.
  enum class DriverMode : std::uint8_t { kNone, kHandsOff, kSteers, kBrakes, kPressesButton };

  // The content of the files, loaded when the run starts.
  struct Drive {
    Drive(Scenario read, const Dbc& dbc, const EgoLimits& limits, const EgoDeviation& deviation,
          TrafficMode mode, double settle_s);
    Drive(const Drive&) = delete;
    Drive& operator=(const Drive&) = delete;

    const Scenario scenario;
    const double begin_s;  // The scenario time of the initial state.
    const LeadIn lead_in;
    const EgoState initial;
    const EgoDeviation deviation;
    EgoModel ego;
    Traffic traffic;
    Referee referee;
    const DbcMessage command;
    const DbcMessage state;
    FrameGuard command_guard;
    FrameGuard state_guard;
    std::optional<DbcMessage> driver;
    std::optional<FrameGuard> driver_guard;
  };

  [[nodiscard]] static EgoLimits read_limits(fastcycle::Context& context);
  [[nodiscard]] static Actuators::Options read_actuators(fastcycle::Context& context);

  void publish_driver();
  void on_command(const can::Frame& frame);
  void on_tick();
  // Advances by one step, to tick `tick_`.
  void go_on();
  void judge(double time_s);
  void end_when_over(double time_s);
  void publish_scene();
  void publish_state();
  void write_row(double time_s);
  void write_bodies(double time_s);
  // Since the drive began; negative before.
  [[nodiscard]] double drive_time_s() const;
  [[nodiscard]] fastcycle::Time time_of_tick() const;

  fastcycle::Param<fastcycle::Path> scenario_;
  fastcycle::Param<fastcycle::Path> dbc_;
  fastcycle::Param<fastcycle::Path> trajectory_;
  fastcycle::Param<fastcycle::Path> bodies_;
  fastcycle::Param<TrafficMode> mode_;
  fastcycle::Param<DriverMode> driver_;
  fastcycle::Param<double> driver_after_s_;
  fastcycle::Param<double> settle_s_;
  fastcycle::Param<double> linger_s_;
  fastcycle::Param<double> overtime_s_;
  fastcycle::Param<double> deviation_;
  fastcycle::Param<double> clutter_share_;
  fastcycle::Param<std::uint64_t> seed_;
  EgoLimits limits_;
  Actuators actuators_;

  fastcycle::Publisher<world::Scene> scenes_;
  fastcycle::Publisher<can::Frame> states_;
  fastcycle::Source source_;

  std::optional<Drive> drive_;
  std::vector<Body> clutter_;
  std::ofstream rows_;
  std::ofstream body_rows_;
  std::int64_t tick_ = 0;
  std::int64_t begin_tick_ = 0;
  bool is_over_ = false;
  std::size_t contacts_logged_ = 0;
  std::size_t reacting_max_ = 0;
  std::int64_t commands_ = 0;
  std::int64_t refused_ = 0;
  std::int64_t autonomous_ticks_ = 0;
};

}  // namespace ads
