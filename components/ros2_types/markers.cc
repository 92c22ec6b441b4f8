// Markers, each a shape with an id in a namespace, and scenes, whose entities have an id and any
// number of shapes.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/duration.pb.h>

#include "foxglove/scene.pb.h"
#include "ros2_types/conversions.h"
#include "ros2_types/header.h"

namespace fastcycle::ros2 {
namespace {

enum Type : std::int32_t {
  kArrow = 0,
  kCube = 1,
  kSphere = 2,
  kCylinder = 3,
  kLineStrip = 4,
  kLineList = 5,
  kCubeList = 6,
  kSphereList = 7,
  kPoints = 8,
  kText = 9,
  kMesh = 10,
  kTriangles = 11,
  kArrowStrip = 12
};
enum Action : std::int32_t { kAdd = 0, kDelete = 2, kDeleteAll = 3 };

// Minimum sizes: of a marker without texts, points and colors; of a point; of a color.
constexpr std::size_t kMarkerBytes = 180;
constexpr std::size_t kPointBytes = 24;
constexpr std::size_t kColorBytes = 16;
// Of the length of an arrow without a given head length.
constexpr double kHeadShare = 0.23;

struct Point {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
};

struct Turn {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  double w = 1.0;
};

struct Color {
  float r = 0.0F;
  float g = 0.0F;
  float b = 0.0F;
  float a = 0.0F;
};

/// As on the wire, except textures and meshes, which scenes do not support.
struct Marker {
  google::protobuf::Timestamp time;
  std::string frame;
  std::string name_space;
  std::int32_t id = 0;
  std::int32_t type = kCube;
  std::int32_t action = kAdd;
  Point position;
  Turn turn;
  Point scale;
  Color color;
  std::int64_t lifetime_ns = 0;
  bool is_locked = false;
  std::vector<Point> points;
  std::vector<Color> colors;
  std::string text;
  std::string mesh;
};

Point read_point(CdrReader& in, std::string_view field) {
  Point point;
  in.number(field, point.x);
  in.number(field, point.y);
  in.number(field, point.z);
  return point;
}

Color read_color(CdrReader& in, std::string_view field) {
  Color color;
  in.number(field, color.r);
  in.number(field, color.g);
  in.number(field, color.b);
  in.number(field, color.a);
  return color;
}

Marker read_marker(CdrReader& in) {
  Marker marker;
  Header header = read_header(in);
  set_time(header.time_ns, marker.time);
  marker.frame = std::move(header.frame);
  marker.name_space = in.text("markers.ns");
  in.number("markers.id", marker.id);
  in.number("markers.type", marker.type);
  in.number("markers.action", marker.action);
  marker.position = read_point(in, "markers.pose.position");
  in.number("markers.pose.orientation", marker.turn.x);
  in.number("markers.pose.orientation", marker.turn.y);
  in.number("markers.pose.orientation", marker.turn.z);
  in.number("markers.pose.orientation", marker.turn.w);
  marker.scale = read_point(in, "markers.scale");
  marker.color = read_color(in, "markers.color");
  const std::int64_t seconds = in.number<std::int32_t>("markers.lifetime.sec");
  marker.lifetime_ns = seconds * kSecond_ns + in.number<std::uint32_t>("markers.lifetime.nanosec");
  marker.is_locked = in.boolean("markers.frame_locked");
  for (std::uint32_t left = in.count("markers.points", kPointBytes); left > 0; --left) {
    marker.points.push_back(read_point(in, "markers.points"));
  }
  for (std::uint32_t left = in.count("markers.colors", kColorBytes); left > 0; --left) {
    marker.colors.push_back(read_color(in, "markers.colors"));
  }
  (void)in.view("markers.texture_resource");
  (void)read_header(in);
  (void)in.view("markers.texture.format");
  (void)in.bytes("markers.texture.data");
  (void)in.raw("markers.uv_coordinates", std::size_t{in.count("markers.uv_coordinates", 8)} * 2,
               sizeof(float));
  marker.text = in.text("markers.text");
  marker.mesh = in.text("markers.mesh_resource");
  (void)in.view("markers.mesh_file.filename");
  (void)in.bytes("markers.mesh_file.data");
  (void)in.boolean("markers.mesh_use_embedded_materials");
  return marker;
}

void put_point(const Point& point, CdrWriter& out) {
  out.number(point.x);
  out.number(point.y);
  out.number(point.z);
}

void put_color(const Color& color, CdrWriter& out) {
  out.array(std::span<const float>(std::array{color.r, color.g, color.b, color.a}));
}

void write_marker(const Marker& marker, CdrWriter& out) {
  put_time(marker.time, out);
  out.text(marker.frame, "markers.header.frame_id");
  out.text(marker.name_space, "markers.ns");
  out.number(marker.id);
  out.number(marker.type);
  out.number(marker.action);
  put_point(marker.position, out);
  out.array(std::span<const double>(
      std::array{marker.turn.x, marker.turn.y, marker.turn.z, marker.turn.w}));
  put_point(marker.scale, out);
  put_color(marker.color, out);
  out.number(static_cast<std::int32_t>(marker.lifetime_ns / kSecond_ns));
  out.number(static_cast<std::uint32_t>(marker.lifetime_ns % kSecond_ns));
  out.boolean(marker.is_locked);
  out.count(marker.points.size(), "markers.points");
  for (const Point& point : marker.points) {
    put_point(point, out);
  }
  out.count(marker.colors.size(), "markers.colors");
  for (const Color& color : marker.colors) {
    put_color(color, out);
  }
  out.text("");  // A texture: its name,
  put_time({}, out);
  out.text("");
  out.text("");
  out.count(0);
  out.count(0);  // and its data.
  out.text(marker.text, "markers.text");
  out.text(marker.mesh, "markers.mesh_resource");
  out.text("");
  out.count(0);
  out.boolean(false);
}

// ---- Into a scene ----

void set_point(const Point& from, auto& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_z(from.z);
}

void set_color(const Color& from, foxglove::Color& to) {
  to.set_r(from.r);
  to.set_g(from.g);
  to.set_b(from.b);
  to.set_a(from.a);
}

void set_turn(const Turn& from, foxglove::Quaternion& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_z(from.z);
  to.set_w(from.w);
}

void set_pose(const Marker& marker, foxglove::Pose& pose) {
  set_point(marker.position, *pose.mutable_position());
  set_turn(marker.turn, *pose.mutable_orientation());
}

/// A point of a marker, in its frame.
Point placed(const Marker& marker, const Point& point) {
  const Turn& q = marker.turn;
  // Twice the cross product of axis and point.
  const Point t{2.0 * (q.y * point.z - q.z * point.y), 2.0 * (q.z * point.x - q.x * point.z),
                2.0 * (q.x * point.y - q.y * point.x)};
  return {marker.position.x + point.x + q.w * t.x + q.y * t.z - q.z * t.y,
          marker.position.y + point.y + q.w * t.y + q.z * t.x - q.x * t.z,
          marker.position.z + point.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

Color color_of(const Marker& marker, std::size_t point) {
  return marker.colors.size() == marker.points.size() && !marker.colors.empty()
             ? marker.colors[point]
             : marker.color;
}

void add_arrow(const Marker& marker, const Point& from, const Point& to,
               foxglove::SceneEntity& entity) {
  const Point along{to.x - from.x, to.y - from.y, to.z - from.z};
  const double length = std::hypot(along.x, along.y, along.z);
  const double head = marker.scale.z > 0.0 ? std::min(marker.scale.z, length) : kHeadShare * length;
  foxglove::ArrowPrimitive& arrow = *entity.add_arrows();
  set_point(from, *arrow.mutable_pose()->mutable_position());
  // The shortest rotation from +x to the arrow's direction; half a turn about z if it points back.
  Turn turn{0.0, -along.z, along.y, length + along.x};
  const double size = std::hypot(std::hypot(turn.y, turn.z), turn.w);
  turn = size > 1e-12 * length && length > 0.0
             ? Turn{0.0, turn.y / size, turn.z / size, turn.w / size}
             : Turn{0.0, 0.0, length > 0.0 ? 1.0 : 0.0, length > 0.0 ? 0.0 : 1.0};
  set_turn(turn, *arrow.mutable_pose()->mutable_orientation());
  arrow.set_shaft_length(length - head);
  arrow.set_head_length(head);
  arrow.set_shaft_diameter(marker.scale.x);
  arrow.set_head_diameter(marker.scale.y);
  set_color(marker.color, *arrow.mutable_color());
}

void add_arrows(const Marker& marker, foxglove::SceneEntity& entity) {
  for (std::size_t i = 0; i + 1 < marker.points.size(); ++i) {
    add_arrow(marker, placed(marker, marker.points[i]), placed(marker, marker.points[i + 1]),
              entity);
  }
  if (!marker.points.empty()) {
    return;
  }
  foxglove::ArrowPrimitive& arrow = *entity.add_arrows();
  set_pose(marker, *arrow.mutable_pose());
  arrow.set_shaft_length((1.0 - kHeadShare) * marker.scale.x);
  arrow.set_head_length(kHeadShare * marker.scale.x);
  arrow.set_shaft_diameter(0.5 * marker.scale.y);
  arrow.set_head_diameter(marker.scale.y);
  set_color(marker.color, *arrow.mutable_color());
}

void add_solid(const Marker& marker, auto& solid) {
  set_pose(marker, *solid.mutable_pose());
  set_point(marker.scale, *solid.mutable_size());
  set_color(marker.color, *solid.mutable_color());
}

/// Adds the same shape at each point.
void add_solids(const Marker& marker, auto add) {
  for (std::size_t i = 0; i < marker.points.size(); ++i) {
    auto& solid = add();
    set_point(placed(marker, marker.points[i]), *solid.mutable_pose()->mutable_position());
    set_turn(marker.turn, *solid.mutable_pose()->mutable_orientation());
    set_point(marker.scale, *solid.mutable_size());
    set_color(color_of(marker, i), *solid.mutable_color());
  }
}

void add_points(const Marker& marker, auto& shape) {
  set_pose(marker, *shape.mutable_pose());
  for (const Point& point : marker.points) {
    set_point(point, *shape.add_points());
  }
  set_color(marker.color, *shape.mutable_color());
  if (marker.colors.size() == marker.points.size()) {
    for (const Color& color : marker.colors) {
      set_color(color, *shape.add_colors());
    }
  }
}

void add_shape(const Marker& marker, foxglove::SceneEntity& entity) {
  switch (marker.type) {
    case kArrow:
    case kArrowStrip:
      add_arrows(marker, entity);
      return;
    case kCube:
      add_solid(marker, *entity.add_cubes());
      return;
    case kSphere:
      add_solid(marker, *entity.add_spheres());
      return;
    case kCylinder: {
      foxglove::CylinderPrimitive& cylinder = *entity.add_cylinders();
      add_solid(marker, cylinder);
      cylinder.set_bottom_scale(1.0);
      cylinder.set_top_scale(1.0);
      return;
    }
    case kLineStrip:
    case kLineList: {
      foxglove::LinePrimitive& line = *entity.add_lines();
      add_points(marker, line);
      line.set_type(marker.type == kLineStrip ? foxglove::LinePrimitive::LINE_STRIP
                                              : foxglove::LinePrimitive::LINE_LIST);
      line.set_thickness(marker.scale.x);
      return;
    }
    case kCubeList:
    case kPoints:
      add_solids(marker, [&]() -> auto& { return *entity.add_cubes(); });
      return;
    case kSphereList:
      add_solids(marker, [&]() -> auto& { return *entity.add_spheres(); });
      return;
    case kText: {
      foxglove::TextPrimitive& text = *entity.add_texts();
      set_pose(marker, *text.mutable_pose());
      text.set_billboard(true);
      text.set_font_size(marker.scale.z);
      set_color(marker.color, *text.mutable_color());
      text.set_text(marker.text);
      return;
    }
    case kTriangles:
      add_points(marker, *entity.add_triangles());
      return;
    default: {
      // A mesh, or an unknown type: at least its presence is recorded.
      foxglove::KeyValuePair& pair = *entity.add_metadata();
      pair.set_key("mesh_resource");
      pair.set_value(marker.mesh);
    }
  }
}

std::string entity_id(const Marker& marker) {
  return fmt::format("{}/{}", marker.name_space, marker.id);
}

// ---- Out of a scene ----

Point point_of(const auto& from) {
  return {from.x(), from.y(), from.z()};
}

Color color_of(const foxglove::Color& from) {
  return {static_cast<float>(from.r()), static_cast<float>(from.g()), static_cast<float>(from.b()),
          static_cast<float>(from.a())};
}

/// Writes the markers of one scene.
class Markers {
 public:
  void add(const foxglove::SceneEntityDeletion& deletion) {
    Marker marker = named(deletion.id());
    marker.time = deletion.timestamp();
    marker.action = deletion.type() == foxglove::SceneEntityDeletion::ALL ? kDeleteAll : kDelete;
    all_.push_back(std::move(marker));
  }

  void add(const foxglove::SceneEntity& entity) {
    next_ = named(entity.id());
    next_.time = entity.timestamp();
    next_.frame = entity.frame_id();
    next_.lifetime_ns = entity.lifetime().seconds() * kSecond_ns + entity.lifetime().nanos();
    next_.is_locked = entity.frame_locked();
    const int shapes = entity.arrows_size() + entity.cubes_size() + entity.spheres_size() +
                       entity.cylinders_size() + entity.lines_size() + entity.triangles_size() +
                       entity.texts_size();
    if (shapes > 1) {
      next_.name_space = entity.id();
      next_.id = 0;
    }
    for (const foxglove::ArrowPrimitive& arrow : entity.arrows()) {
      Marker& marker = begin(kArrow, arrow);
      marker.scale = {arrow.shaft_length() + arrow.head_length(), arrow.head_diameter(),
                      arrow.head_diameter()};
    }
    for (const foxglove::CubePrimitive& cube : entity.cubes()) {
      begin(kCube, cube).scale = point_of(cube.size());
    }
    for (const foxglove::SpherePrimitive& sphere : entity.spheres()) {
      begin(kSphere, sphere).scale = point_of(sphere.size());
    }
    for (const foxglove::CylinderPrimitive& cylinder : entity.cylinders()) {
      begin(kCylinder, cylinder).scale = point_of(cylinder.size());
    }
    for (const foxglove::LinePrimitive& line : entity.lines()) {
      const bool is_list = line.type() == foxglove::LinePrimitive::LINE_LIST;
      Marker& marker = begin(is_list ? kLineList : kLineStrip, line);
      marker.scale = {line.thickness(), 0.0, 0.0};
      take_points(line, marker);
      if (line.type() == foxglove::LinePrimitive::LINE_LOOP && !marker.points.empty()) {
        marker.points.push_back(marker.points.front());
        if (!marker.colors.empty()) {
          marker.colors.push_back(marker.colors.front());
        }
      }
    }
    for (const foxglove::TriangleListPrimitive& triangles : entity.triangles()) {
      Marker& marker = begin(kTriangles, triangles);
      marker.scale = {1.0, 1.0, 1.0};
      take_points(triangles, marker);
    }
    for (const foxglove::TextPrimitive& text : entity.texts()) {
      Marker& marker = begin(kText, text);
      marker.scale = {0.0, 0.0, text.font_size()};
      marker.text = text.text();
    }
  }

  void write(CdrWriter& out) const {
    out.count(all_.size(), "markers");
    for (const Marker& marker : all_) {
      write_marker(marker, out);
    }
  }

 private:
  /// Splits the result of `entity_id`; any other id is a namespace.
  static Marker named(const std::string& id) {
    Marker marker;
    marker.name_space = id;
    const std::size_t slash = id.rfind('/');
    if (slash != std::string::npos) {
      std::int32_t number = 0;
      const char* const end = id.data() + id.size();
      const auto [read, error] = std::from_chars(id.data() + slash + 1, end, number);
      if (error == std::errc() && read == end && slash + 1 < id.size()) {
        marker.name_space.resize(slash);
        marker.id = number;
      }
    }
    return marker;
  }

  Marker& begin(Type type, const auto& shape) {
    Marker& marker = all_.emplace_back(next_);
    next_.id = static_cast<std::int32_t>(static_cast<std::uint32_t>(next_.id) + 1);
    marker.type = type;
    marker.position = point_of(shape.pose().position());
    const foxglove::Quaternion& turn = shape.pose().orientation();
    if (shape.pose().has_orientation()) {
      marker.turn = {turn.x(), turn.y(), turn.z(), turn.w()};
    }
    marker.color = color_of(shape.color());
    return marker;
  }

  static void take_points(const auto& shape, Marker& marker) {
    const auto take = [&](int i) {
      marker.points.push_back(point_of(shape.points(i)));
      if (shape.colors_size() == shape.points_size()) {
        marker.colors.push_back(color_of(shape.colors(i)));
      }
    };
    if (shape.indices_size() == 0) {
      for (int i = 0; i < shape.points_size(); ++i) {
        take(i);
      }
    }
    for (const std::uint32_t index : shape.indices()) {
      if (index < static_cast<std::uint32_t>(shape.points_size())) {
        take(static_cast<int>(index));
      }
    }
  }

  std::vector<Marker> all_;
  Marker next_;
};

}  // namespace

void markers_to_scene(CdrReader& in, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::SceneUpdate&>(to);
  const std::uint32_t count = in.count("markers", kMarkerBytes);
  for (std::uint32_t i = 0; i < count; ++i) {
    const Marker marker = read_marker(in);
    if (marker.action == kDelete || marker.action == kDeleteAll) {
      foxglove::SceneEntityDeletion& deletion = *out.add_deletions();
      *deletion.mutable_timestamp() = marker.time;
      deletion.set_type(marker.action == kDelete ? foxglove::SceneEntityDeletion::MATCHING_ID
                                                 : foxglove::SceneEntityDeletion::ALL);
      deletion.set_id(entity_id(marker));
      continue;
    }
    foxglove::SceneEntity& entity = *out.add_entities();
    *entity.mutable_timestamp() = marker.time;
    entity.set_frame_id(marker.frame);
    entity.set_id(entity_id(marker));
    entity.mutable_lifetime()->set_seconds(marker.lifetime_ns / kSecond_ns);
    entity.mutable_lifetime()->set_nanos(
        static_cast<std::int32_t>(marker.lifetime_ns % kSecond_ns));
    entity.set_frame_locked(marker.is_locked);
    add_shape(marker, entity);
  }
}

void scene_to_markers(const google::protobuf::Message& from, CdrWriter& out) {
  const auto& in = dynamic_cast<const foxglove::SceneUpdate&>(from);
  Markers markers;
  for (const foxglove::SceneEntityDeletion& deletion : in.deletions()) {
    markers.add(deletion);
  }
  for (const foxglove::SceneEntity& entity : in.entities()) {
    markers.add(entity);
  }
  markers.write(out);
}

}  // namespace fastcycle::ros2
