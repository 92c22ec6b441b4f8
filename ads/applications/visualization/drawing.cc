#include "drawing.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <string>

#include <fmt/format.h>

namespace ads {
namespace {

constexpr std::size_t kPointBytes = 16;
constexpr Rgba kEdge{.red = 0.55, .green = 0.57, .blue = 0.6};
constexpr Rgba kRoute{.red = 0.2, .green = 0.6, .blue = 0.3, .alpha = 0.6};
constexpr Rgba kEgo{.red = 0.12, .green = 0.4, .blue = 0.85};
constexpr double kTextHeight_m = 0.8;
constexpr double kHeadLength_m = 0.8;

Rgba color_of(const perception::Object& object) {
  // Not seen in the last sweep: pale.
  const double alpha = object.unseen_s() > 0.0 ? 0.3 : 0.7;
  switch (object.object_class()) {
    case perception::CAR:
      return {.red = 0.95, .green = 0.55, .blue = 0.1, .alpha = alpha};
    case perception::TRUCK:
      return {.red = 0.8, .green = 0.3, .blue = 0.1, .alpha = alpha};
    case perception::TWO_WHEELER:
      return {.red = 0.6, .green = 0.2, .blue = 0.7, .alpha = alpha};
    case perception::PEDESTRIAN:
      return {.red = 0.85, .green = 0.15, .blue = 0.4, .alpha = alpha};
    default:
      return {.red = 0.6, .green = 0.6, .blue = 0.6, .alpha = alpha};
  }
}

void add_field(const char* name, std::uint32_t offset,
               foxglove::PackedElementField::NumericType type, foxglove::PointCloud& cloud) {
  foxglove::PackedElementField& field = *cloud.add_fields();
  field.set_name(name);
  field.set_offset(offset);
  field.set_type(type);
}

foxglove::SceneEntity& add_entity(std::string id, const std::string& frame, std::int64_t time_ns,
                                  foxglove::SceneUpdate& update) {
  foxglove::SceneEntity& entity = *update.add_entities();
  set_time(time_ns, *entity.mutable_timestamp());
  entity.set_frame_id(frame);
  entity.set_id(std::move(id));
  return entity;
}

void add_line(const hd_map::Line& line, double thickness_px, const Rgba& color,
              foxglove::SceneEntity& entity) {
  foxglove::LinePrimitive& out = *entity.add_lines();
  out.set_type(foxglove::LinePrimitive::LINE_STRIP);
  set_pose(0.0, 0.0, 0.0, 0.0, *out.mutable_pose());
  out.set_thickness(thickness_px);
  out.set_scale_invariant(true);
  set_color(color, *out.mutable_color());
  for (int i = 0; i < std::min(line.x_m_size(), line.y_m_size()); ++i) {
    foxglove::Point3& point = *out.add_points();
    point.set_x(line.x_m(i));
    point.set_y(line.y_m(i));
  }
}

void add_object(const perception::Object& object, const std::string& frame, std::int64_t time_ns,
                foxglove::SceneUpdate& update) {
  foxglove::SceneEntity& entity =
      add_entity(fmt::format("object {}", object.id()), frame, time_ns, update);
  const Rgba color = color_of(object);

  foxglove::CubePrimitive& cube = *entity.add_cubes();
  set_pose(object.x_m(), object.y_m(), 0.5 * object.height_m(), object.heading_rad(),
           *cube.mutable_pose());
  cube.mutable_size()->set_x(object.length_m());
  cube.mutable_size()->set_y(object.width_m());
  cube.mutable_size()->set_z(object.height_m());
  set_color(color, *cube.mutable_color());
  if (object.object_class() == perception::UNKNOWN) {
    return;  // There are many in a street: walls and bushes.
  }

  if (std::abs(object.speed_mps()) > kHeadLength_m) {
    foxglove::ArrowPrimitive& arrow = *entity.add_arrows();
    const double heading_rad = object.heading_rad() + (object.speed_mps() < 0.0 ? M_PI : 0.0);
    set_pose(object.x_m(), object.y_m(), 0.5 * object.height_m(), heading_rad,
             *arrow.mutable_pose());
    arrow.set_shaft_length(std::abs(object.speed_mps()) - kHeadLength_m);
    arrow.set_shaft_diameter(0.2);
    arrow.set_head_length(kHeadLength_m);
    arrow.set_head_diameter(0.6);
    set_color(color, *arrow.mutable_color());
  }

  foxglove::TextPrimitive& text = *entity.add_texts();
  set_pose(object.x_m(), object.y_m(), object.height_m() + kTextHeight_m, 0.0,
           *text.mutable_pose());
  text.set_billboard(true);
  text.set_font_size(kTextHeight_m);
  set_color({.red = color.red, .green = color.green, .blue = color.blue}, *text.mutable_color());
  text.set_text(fmt::format("{} {} {:.1f} m/s", object.id(),
                            perception::ObjectClass_Name(object.object_class()),
                            object.speed_mps()));
}

}  // namespace

void set_time(std::int64_t time_ns, google::protobuf::Timestamp& timestamp) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  std::int64_t seconds = time_ns / kSecond_ns;
  std::int64_t rest_ns = time_ns % kSecond_ns;
  if (rest_ns < 0) {  // Nanoseconds count on, before 1970 as well.
    --seconds;
    rest_ns += kSecond_ns;
  }
  timestamp.set_seconds(seconds);
  timestamp.set_nanos(static_cast<std::int32_t>(rest_ns));
}

void set_color(const Rgba& color, foxglove::Color& out) {
  out.set_r(color.red);
  out.set_g(color.green);
  out.set_b(color.blue);
  out.set_a(color.alpha);
}

void set_pose(double x_m, double y_m, double z_m, double heading_rad, foxglove::Pose& pose) {
  foxglove::Vector3& position = *pose.mutable_position();
  position.set_x(x_m);
  position.set_y(y_m);
  position.set_z(z_m);
  foxglove::Quaternion& orientation = *pose.mutable_orientation();
  orientation.set_z(std::sin(0.5 * heading_rad));
  orientation.set_w(std::cos(0.5 * heading_rad));
}

void set_transform(std::string_view parent, std::string_view child, std::int64_t time_ns,
                   const foxglove::Pose& pose, foxglove::FrameTransform& transform) {
  set_time(time_ns, *transform.mutable_timestamp());
  transform.set_parent_frame_id(std::string(parent));
  transform.set_child_frame_id(std::string(child));
  *transform.mutable_translation() = pose.position();
  *transform.mutable_rotation() = pose.orientation();
}

void draw_sweep(const lidar::Sweep& sweep, const PlaneMotion& motion, int every,
                foxglove::PointCloud& cloud) {
  using foxglove::PackedElementField;
  set_time(sweep.header().taken_ns() + sweep.duration_ns(), *cloud.mutable_timestamp());
  cloud.set_frame_id(sweep.header().frame());
  set_pose(0.0, 0.0, 0.0, 0.0, *cloud.mutable_pose());
  cloud.set_point_stride(kPointBytes);
  add_field("x", 0, PackedElementField::FLOAT32, cloud);
  add_field("y", 4, PackedElementField::FLOAT32, cloud);
  add_field("z", 8, PackedElementField::FLOAT32, cloud);
  add_field("intensity", 12, PackedElementField::UINT8, cloud);
  add_field("ring", 13, PackedElementField::UINT8, cloud);

  const std::string& points = sweep.points();
  std::string& data = *cloud.mutable_data();
  data.clear();
  data.reserve(points.size() / static_cast<std::size_t>(every) + kPointBytes);
  const double mount_m = sweep.mount_forward_m();
  double cosine = 1.0;
  double sine = 0.0;
  double forward_m = 0.0;
  double left_m = 0.0;
  int known_time = -1;
  std::int64_t returns = 0;
  for (std::size_t at = 0; at + kPointBytes <= points.size(); at += kPointBytes) {
    std::array<float, 3> place;
    std::memcpy(place.data(), points.data() + at, sizeof place);
    const bool is_return = place[0] != 0.0F || place[1] != 0.0F || place[2] != 0.0F;
    if (!is_return || !std::isfinite(place[0]) || !std::isfinite(place[1]) ||
        !std::isfinite(place[2]) || returns++ % every != 0) {
      continue;
    }
    std::uint16_t time = 0;
    std::memcpy(&time, points.data() + at + 12, sizeof time);
    if (time != known_time) {  // All rings of a column have one time.
      known_time = time;
      const double before_s =
          (time / 65536.0 - 1.0) * static_cast<double>(sweep.duration_ns()) * 1e-9;
      const double turned_rad = motion.yaw_rate_radps * before_s;
      cosine = std::cos(turned_rad);
      sine = std::sin(turned_rad);
      forward_m = motion.speed_mps * before_s * std::cos(0.5 * turned_rad);
      left_m = motion.speed_mps * before_s * std::sin(0.5 * turned_rad);
    }
    const double x_m = place[0] + mount_m;
    const double y_m = place[1];
    std::array<char, kPointBytes> out{};
    place[0] = static_cast<float>(forward_m + cosine * x_m - sine * y_m - mount_m);
    place[1] = static_cast<float>(left_m + sine * x_m + cosine * y_m);
    std::memcpy(out.data(), place.data(), sizeof place);
    out[12] = points[at + 15];
    out[13] = points[at + 14];
    data.append(out.data(), out.size());
  }
}

void draw_objects(const perception::Objects& objects, foxglove::SceneUpdate& update) {
  const std::int64_t time_ns = objects.header().taken_ns();
  foxglove::SceneEntityDeletion& deletion = *update.add_deletions();
  set_time(time_ns, *deletion.mutable_timestamp());
  deletion.set_type(foxglove::SceneEntityDeletion::ALL);
  for (const perception::Object& object : objects.objects()) {
    add_object(object, objects.header().frame(), time_ns, update);
  }
}

void draw_lanes(const hd_map::Tile& tile, foxglove::SceneUpdate& update) {
  foxglove::SceneEntity& entity =
      add_entity("lanes", tile.header().frame(), tile.header().taken_ns(), update);
  for (const hd_map::Lane& lane : tile.lanes()) {
    add_line(lane.left(), 1.5, kEdge, entity);
    add_line(lane.right(), 1.5, kEdge, entity);
  }
}

void draw_route(const hd_map::Route& route, foxglove::SceneUpdate& update) {
  foxglove::SceneEntity& entity =
      add_entity("route", route.header().frame(), route.header().taken_ns(), update);
  add_line(route.reference(), 5.0, kRoute, entity);
}

void draw_trajectory(const planning::Trajectory& trajectory, std::string_view frame,
                     std::int64_t time_ns, foxglove::PosesInFrame& poses) {
  set_time(time_ns, *poses.mutable_timestamp());
  poses.set_frame_id(std::string(frame));
  for (const planning::TrajectoryPoint& point : trajectory.points()) {
    set_pose(point.x_m(), point.y_m(), 0.0, point.heading_rad(), *poses.add_poses());
  }
}

void draw_vehicle(std::string_view frame, std::int64_t time_ns, const BoxSize& size,
                  foxglove::SceneUpdate& update) {
  foxglove::SceneEntity& entity = add_entity("vehicle", std::string(frame), time_ns, update);
  entity.set_frame_locked(true);
  foxglove::CubePrimitive& cube = *entity.add_cubes();
  set_pose(0.0, 0.0, 0.5 * size.height_m, 0.0, *cube.mutable_pose());
  cube.mutable_size()->set_x(size.length_m);
  cube.mutable_size()->set_y(size.width_m);
  cube.mutable_size()->set_z(size.height_m);
  set_color(kEgo, *cube.mutable_color());
}

void draw_fix(const GeodeticPosition& position, double stddev_m, std::string_view frame,
              std::int64_t time_ns, foxglove::LocationFix& fix) {
  set_time(time_ns, *fix.mutable_timestamp());
  fix.set_frame_id(std::string(frame));
  fix.set_latitude(position.latitude_deg);
  fix.set_longitude(position.longitude_deg);
  fix.set_altitude(position.altitude_m);
  if (stddev_m > 0.0) {
    fix.set_position_covariance_type(foxglove::LocationFix::APPROXIMATED);
    for (int i = 0; i < 9; ++i) {
      // The height is not measured.
      fix.add_position_covariance(i == 0 || i == 4 ? stddev_m * stddev_m : 0.0);
    }
  }
}

}  // namespace ads
