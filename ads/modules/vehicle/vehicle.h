#pragma once

#include <cstdint>
#include <optional>

#include <fastcycle/fastcycle.h>

#include "can/frame.pb.h"
#include "common/dbc.h"
#include "common/frame_guard.h"
#include "control/command.pb.h"
#include "supervision/state.pb.h"
#include "vehicle/driver.pb.h"
#include "vehicle/state.pb.h"

namespace ads {

/// The interface to the vehicle's bus: encodes commands as frames, and decodes frames to its state.
///
/// Commands are sent as autonomous only while supervision reports autonomous driving. If
/// supervision stops publishing in that time, only those of a minimal-risk stop are sent, until the
/// driver acts; without any the vehicle brakes by itself.
///
/// In:   `can/state`, `control/command`, `supervision/state`
/// Out:  `vehicle/state`, `can/command`; `vehicle/driver`, if the bus has DRIVER_INPUT
class Vehicle final : public fastcycle::Component {
 public:
  explicit Vehicle(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  // The messages of the bus, from its DBC file.
  struct Bus {
    explicit Bus(const Dbc& dbc);

    DbcMessage command;
    DbcMessage state;
    FrameGuard command_guard;
    FrameGuard state_guard;
    std::optional<DbcMessage> driver;  // Absent on some buses.
    std::optional<FrameGuard> driver_guard;
  };

  void on_frame(const can::Frame& frame);
  void on_driver(const can::Frame& frame);
  void on_command(const control::Command& command);
  void refuse(const can::Frame& frame, FrameGuard::Verdict verdict);

  fastcycle::Param<fastcycle::Path> dbc_;
  fastcycle::Param<double> supervision_age_max_s_;
  fastcycle::Param<double> driver_torque_nm_;
  fastcycle::Param<double> driver_brake_pedal_;
  fastcycle::Publisher<vehicle::State> states_;
  fastcycle::Publisher<vehicle::DriverInput> drivers_;
  fastcycle::Publisher<can::Frame> frames_;
  fastcycle::Latest<supervision::State> supervision_;

  std::optional<Bus> bus_;
  std::optional<fastcycle::Time> driver_acted_;
  std::optional<std::int64_t> command_ns_;  // Of the newest command.
  std::int64_t received_ = 0;
  std::int64_t refused_ = 0;
  std::int64_t refused_in_a_row_ = 0;
  std::int64_t driver_refused_ = 0;
  std::int64_t sent_ = 0;
  std::int64_t sent_autonomous_ = 0;
  std::int64_t withheld_ = 0;
  std::int64_t invalid_ = 0;
  std::int64_t repeated_ = 0;
};

}  // namespace ads
