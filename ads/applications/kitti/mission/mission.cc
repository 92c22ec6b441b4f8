#include <string>
#include <string_view>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "common/params.h"
#include "localization/ego.pb.h"
#include "mission/goal.pb.h"
#include "vehicle/state.pb.h"

namespace kitti {
namespace {

constexpr double kGoal_m = 3.0;
constexpr double kPlaceStddev_m = 0.5;
constexpr double kHeadingStddev_rad = 0.02;

}  // namespace

/// Stands for what a recorded drive does not have: a mission, and a bus. Nobody obeys commands.
///
/// In:   `localization/ego`
/// Out:  `mission/initial_pose` and `mission/goal` at the start; `vehicle/state` with each pose
class Mission final : public fastcycle::Component {
 public:
  explicit Mission(fastcycle::Context& context)
      : Component(context),
        begin_x_m_(ads::number_param(context, "begin_x_m", 0.0, -1e6, 1e6, "m",
                                     "Initial position of the vehicle")),
        begin_y_m_(ads::number_param(context, "begin_y_m", 0.0, -1e6, 1e6, "m",
                                     "Initial position of the vehicle")),
        begin_heading_rad_(ads::number_param(context, "begin_heading_rad", 0.0, -1e6, 1e6, "rad",
                                             "Initial heading")),
        goal_x_m_(ads::number_param(context, "goal_x_m", 0.0, -1e6, 1e6, "m", "Goal position")),
        goal_y_m_(ads::number_param(context, "goal_y_m", 0.0, -1e6, 1e6, "m", "Goal position")),
        poses_(context.create_publisher<mission::InitialPose>("mission/initial_pose")),
        goals_(context.create_publisher<mission::Goal>("mission/goal")),
        states_(context.create_publisher<vehicle::State>("vehicle/state")) {
    context.create_subscriber<localization::Ego>(
        "localization/ego", [this](const localization::Ego& ego) { publish_state(ego); });
  }

  void start() override {
    const std::int64_t now_ns = now().time_since_epoch().count();
    auto pose = poses_.loan();
    pose->mutable_header()->set_taken_ns(now_ns);
    pose->mutable_header()->set_frame("map");
    pose->set_x_m(begin_x_m_.get());
    pose->set_y_m(begin_y_m_.get());
    pose->set_heading_rad(begin_heading_rad_.get());
    pose->set_position_stddev_m(kPlaceStddev_m);
    pose->set_heading_stddev_rad(kHeadingStddev_rad);
    poses_.publish(std::move(pose));
    auto goal = goals_.loan();
    goal->mutable_header()->set_taken_ns(now_ns);
    goal->mutable_header()->set_frame("map");
    auto& rectangle = *goal->mutable_rectangle();
    rectangle.set_x_m(goal_x_m_.get());
    rectangle.set_y_m(goal_y_m_.get());
    rectangle.set_length_m(kGoal_m);
    rectangle.set_width_m(kGoal_m);
    goal->set_window_begin_ns(now_ns);
    goal->set_window_end_ns(now_ns + 3'600'000'000'000);
    goal->set_engage_ns(now_ns);
    goals_.publish(std::move(goal));
  }

 private:
  void publish_state(const localization::Ego& ego) {
    auto state = states_.loan();
    *state->mutable_header() = ego.header();
    state->mutable_header()->set_frame("vehicle");
    state->set_speed_mps(ego.speed_mps());
    state->set_acceleration_mps2(ego.acceleration_mps2());
    states_.publish(std::move(state));
  }

  fastcycle::Param<double> begin_x_m_;
  fastcycle::Param<double> begin_y_m_;
  fastcycle::Param<double> begin_heading_rad_;
  fastcycle::Param<double> goal_x_m_;
  fastcycle::Param<double> goal_y_m_;
  fastcycle::Publisher<mission::InitialPose> poses_;
  fastcycle::Publisher<mission::Goal> goals_;
  fastcycle::Publisher<vehicle::State> states_;
};

}  // namespace kitti

FASTCYCLE_COMPONENT(kitti::Mission)
