#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/geodesy.h"
#include "foxglove/location.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "foxglove/pose.pb.h"
#include "foxglove/scene.pb.h"
#include "hd_map/map.pb.h"
#include "lidar/sweep.pb.h"
#include "perception/objects.pb.h"
#include "planning/plan.pb.h"

namespace ads {

/// Converts messages of the ADS for display in other tools. Each function fills an empty message.
///
/// @threads  Safe.

struct Rgba {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
  double alpha = 1.0;
};

/// The vehicle's motion: along its heading, and about its centre.
struct PlaneMotion {
  double speed_mps = 0.0;
  double yaw_rate_radps = 0.0;
};

struct BoxSize {
  double length_m = 0.0;
  double width_m = 0.0;
  double height_m = 0.0;
};

void set_time(std::int64_t time_ns, google::protobuf::Timestamp& timestamp);
void set_color(const Rgba& color, foxglove::Color& out);
/// In the plane, rotated counter-clockwise from +x.
void set_pose(double x_m, double y_m, double z_m, double heading_rad, foxglove::Pose& pose);
void set_transform(std::string_view parent, std::string_view child, std::int64_t time_ns,
                   const foxglove::Pose& pose, foxglove::FrameTransform& transform);

/// Every `every`-th finite return of a sweep, relative to the sensor's pose at the end of the turn,
/// compensated for the motion during it. x, y, z, intensity and ring.
void draw_sweep(const lidar::Sweep& sweep, const PlaneMotion& motion, int every,
                foxglove::PointCloud& cloud);
/// Draws all objects, replacing those of the previous message: a box, the distance covered in one
/// second, the class.
void draw_objects(const perception::Objects& objects, foxglove::SceneUpdate& update);
/// Both edges of each lane, as the entity "lanes".
void draw_lanes(const hd_map::Tile& tile, foxglove::SceneUpdate& update);
/// The line along the route to the goal, as the entity "route".
void draw_route(const hd_map::Route& route, foxglove::SceneUpdate& update);
void draw_trajectory(const planning::Trajectory& trajectory, std::string_view frame,
                     std::int64_t time_ns, foxglove::PosesInFrame& poses);
/// A box on the ground that moves with `frame`.
void draw_vehicle(std::string_view frame, std::int64_t time_ns, const BoxSize& size,
                  foxglove::SceneUpdate& update);
/// With one standard deviation per axis; unknown if it is not above 0.
void draw_fix(const GeodeticPosition& position, double stddev_m, std::string_view frame,
              std::int64_t time_ns, foxglove::LocationFix& fix);

}  // namespace ads
