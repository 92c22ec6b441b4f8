#include "rosbag/ros_types.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include <fmt/format.h>

#include "foxglove/image.pb.h"
#include "foxglove/location.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "foxglove/pose.pb.h"
#include "motion/motion.pb.h"
#include "rosbag/cdr.h"

namespace fastcycle::rosbag {
namespace {

using foxglove::PackedElementField;
using Bytes = std::span<const std::byte>;

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::size_t kFieldsMax = 1024;
constexpr std::size_t kFieldNameMax = 256;
// Of a pose with its header: two numbers of 4 bytes, a text, seven of 8.
constexpr std::size_t kPoseBytes = 72;

struct Header {
  std::int64_t time_ns = 0;
  std::string frame;
};

Header read_header(CdrReader& in) {
  const auto seconds = in.number<std::int32_t>("header.stamp.sec");
  const auto rest_ns = in.number<std::uint32_t>("header.stamp.nanosec");
  return {.time_ns = seconds * kSecond_ns + rest_ns, .frame = in.text("header.frame_id")};
}

void set_time(std::int64_t time_ns, google::protobuf::Timestamp& out) {
  const std::int64_t rest_ns = (time_ns % kSecond_ns + kSecond_ns) % kSecond_ns;
  out.set_seconds((time_ns - rest_ns) / kSecond_ns);
  out.set_nanos(static_cast<std::int32_t>(rest_ns));
}

/// What every message of Foxglove begins with.
template <typename T>
void take_header(CdrReader& in, T& out) {
  Header header = read_header(in);
  set_time(header.time_ns, *out.mutable_timestamp());
  out.set_frame_id(std::move(header.frame));
}

template <typename T>
void take_own_header(CdrReader& in, T& out) {
  Header header = read_header(in);
  out.mutable_header()->set_taken_ns(header.time_ns);
  out.mutable_header()->set_frame(std::move(header.frame));
}

template <typename T>
void take_vector(CdrReader& in, std::string_view field, T& out) {
  out.set_x(in.number<double>(field));
  out.set_y(in.number<double>(field));
  out.set_z(in.number<double>(field));
}

template <typename T>
void take_rotation(CdrReader& in, std::string_view field, T& out) {
  take_vector(in, field, out);
  out.set_w(in.number<double>(field));
}

void take_pose(CdrReader& in, foxglove::Pose& out) {
  take_vector(in, "position", *out.mutable_position());
  take_rotation(in, "orientation", *out.mutable_orientation());
}

/// A fixed number of numbers.
template <typename Repeated>
void take_doubles(CdrReader& in, std::string_view field, int count, Repeated& out) {
  for (int i = 0; i < count; ++i) {
    out.Add(in.number<double>(field));
  }
}

template <typename Repeated>
void take_floats(CdrReader& in, std::string_view field, Repeated& out) {
  const std::uint32_t count = in.count(field, sizeof(float));
  for (std::uint32_t i = 0; i < count; ++i) {
    out.Add(in.number<float>(field));
  }
}

[[noreturn]] void fail(std::string_view field, const std::string& expected,
                       const std::string& found) {
  throw CdrError(fmt::format("{}: expected {}, found {}", field, expected, found));
}

void swap_bytes(char* data, std::size_t size, std::size_t each) {
  for (std::size_t at = 0; each > 1 && at + each <= size; at += each) {
    std::reverse(data + at, data + at + each);
  }
}

// ---- sensor_msgs ----

std::size_t size_of(PackedElementField::NumericType type) {
  switch (type) {
    case PackedElementField::UINT16:
    case PackedElementField::INT16:
      return 2;
    case PackedElementField::UINT32:
    case PackedElementField::INT32:
    case PackedElementField::FLOAT32:
      return 4;
    case PackedElementField::FLOAT64:
      return 8;
    default:
      return 1;
  }
}

/// Those of `sensor_msgs/PointField`, from 1 on.
constexpr std::array kNumericTypes = {PackedElementField::INT8,    PackedElementField::UINT8,
                                      PackedElementField::INT16,   PackedElementField::UINT16,
                                      PackedElementField::INT32,   PackedElementField::UINT32,
                                      PackedElementField::FLOAT32, PackedElementField::FLOAT64};

void take_fields(CdrReader& in, foxglove::PointCloud& cloud) {
  // A name, the offset, the kind, the count.
  const std::uint32_t count = in.count("fields", 13);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string name = in.text("fields.name");
    const auto offset = in.number<std::uint32_t>("fields.offset");
    const auto kind = in.number<std::uint8_t>("fields.datatype");
    const auto elements = std::max(1U, in.number<std::uint32_t>("fields.count"));
    if (name.size() > kFieldNameMax) {
      fail("fields.name", fmt::format("at most {} bytes", kFieldNameMax),
           fmt::format("{}", name.size()));
    }
    if (kind == 0 || kind > kNumericTypes.size()) {
      fail("fields.datatype", "1 to 8", fmt::format("{}", kind));
    }
    if (elements > kFieldsMax - static_cast<std::size_t>(cloud.fields_size())) {
      fail("fields", fmt::format("at most {}", kFieldsMax), "more");
    }
    const PackedElementField::NumericType type = kNumericTypes.at(kind - 1U);
    for (std::uint32_t element = 0; element < elements; ++element) {
      PackedElementField& field = *cloud.add_fields();
      field.set_name(elements == 1 ? name : fmt::format("{}_{}", name, element));
      field.set_type(type);
      const std::uint64_t its_offset = offset + element * std::uint64_t{size_of(type)};
      if (its_offset > UINT32_MAX) {
        fail("fields.offset", "one within a point", fmt::format("{}", its_offset));
      }
      field.set_offset(static_cast<std::uint32_t>(its_offset));
    }
  }
}

void convert_point_cloud(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::PointCloud&>(to);
  CdrReader in(message);
  take_header(in, out);
  const std::uint64_t height = in.number<std::uint32_t>("height");
  const std::uint64_t width = in.number<std::uint32_t>("width");
  take_fields(in, out);
  const bool is_big_endian = in.boolean("is_bigendian");
  const std::uint64_t point_step = in.number<std::uint32_t>("point_step");
  const std::uint64_t row_step = in.number<std::uint32_t>("row_step");
  const Bytes data = in.bytes("data");
  in.boolean("is_dense");
  in.end();

  for (const PackedElementField& field : out.fields()) {
    if (field.offset() + std::uint64_t{size_of(field.type())} > point_step) {
      fail("fields", fmt::format("all within the {} bytes of a point", point_step),
           fmt::format("\"{}\" at {}", field.name(), field.offset()));
    }
  }
  const std::uint64_t row_bytes = width * point_step;
  const std::uint64_t stride = height > 1 ? row_step : row_bytes;
  // No product of two of these is beyond 64 bits.
  if (height > 0 && (stride < row_bytes || height * stride > data.size())) {
    fail("data",
         fmt::format("{} rows of {} bytes, each with {} points of {}", height, stride, width,
                     point_step),
         fmt::format("{} bytes", data.size()));
  }
  out.mutable_pose()->mutable_position();
  out.mutable_pose()->mutable_orientation()->set_w(1.0);
  out.set_point_stride(static_cast<std::uint32_t>(point_step));
  std::string& points = *out.mutable_data();
  const auto* const begin = reinterpret_cast<const char*>(data.data());
  for (std::uint64_t row = 0; row < height && row_bytes > 0; ++row) {
    points.append(begin + row * stride, row_bytes);
  }
  if (is_big_endian) {
    for (std::size_t at = 0; point_step > 0 && at < points.size(); at += point_step) {
      for (const PackedElementField& field : out.fields()) {
        const std::size_t size = size_of(field.type());
        swap_bytes(points.data() + at + field.offset(), size, size);
      }
    }
  }
}

void convert_imu(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<motion::Imu&>(to);
  CdrReader in(message);
  take_own_header(in, out);
  take_rotation(in, "orientation", *out.mutable_orientation());
  take_doubles(in, "orientation_covariance", 9, *out.mutable_orientation_covariance());
  take_vector(in, "angular_velocity", *out.mutable_angular_rate_radps());
  take_doubles(in, "angular_velocity_covariance", 9, *out.mutable_angular_rate_covariance());
  take_vector(in, "linear_acceleration", *out.mutable_acceleration_mps2());
  take_doubles(in, "linear_acceleration_covariance", 9, *out.mutable_acceleration_covariance());
  in.end();
  // -1 in the first place says that this is not measured.
  if (out.orientation_covariance(0) == -1.0) {
    out.clear_orientation();
    out.clear_orientation_covariance();
  }
  if (out.angular_rate_covariance(0) == -1.0) {
    out.clear_angular_rate_radps();
    out.clear_angular_rate_covariance();
  }
  if (out.acceleration_covariance(0) == -1.0) {
    out.clear_acceleration_mps2();
    out.clear_acceleration_covariance();
  }
}

void convert_fix(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::LocationFix&>(to);
  CdrReader in(message);
  take_header(in, out);
  const auto add = [&out](const char* key, std::string value) {
    foxglove::KeyValuePair& pair = *out.add_metadata();
    pair.set_key(key);
    pair.set_value(std::move(value));
  };
  add("status", fmt::format("{}", in.number<std::int8_t>("status.status")));
  add("service", fmt::format("{}", in.number<std::uint16_t>("status.service")));
  out.set_latitude(in.number<double>("latitude"));
  out.set_longitude(in.number<double>("longitude"));
  out.set_altitude(in.number<double>("altitude"));
  take_doubles(in, "position_covariance", 9, *out.mutable_position_covariance());
  const auto type = in.number<std::uint8_t>("position_covariance_type");
  in.end();
  if (!foxglove::LocationFix::PositionCovarianceType_IsValid(type)) {
    fail("position_covariance_type", "0 to 3", fmt::format("{}", type));
  }
  out.set_position_covariance_type(
      static_cast<foxglove::LocationFix::PositionCovarianceType>(type));
}

void convert_image(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::RawImage&>(to);
  CdrReader in(message);
  take_header(in, out);
  out.set_height(in.number<std::uint32_t>("height"));
  out.set_width(in.number<std::uint32_t>("width"));
  out.set_encoding(in.text("encoding"));
  const bool is_big_endian = in.number<std::uint8_t>("is_bigendian") != 0;
  out.set_step(in.number<std::uint32_t>("step"));
  const Bytes data = in.bytes("data");
  in.end();
  if (std::uint64_t{out.height()} * out.step() > data.size()) {
    fail("data", fmt::format("{} rows of {} bytes", out.height(), out.step()),
         fmt::format("{} bytes", data.size()));
  }
  out.mutable_data()->assign(reinterpret_cast<const char*>(data.data()), data.size());
  if (is_big_endian) {
    const std::string& encoding = out.encoding();
    const std::size_t each = encoding.find("16") != std::string::npos   ? 2
                             : encoding.find("32") != std::string::npos ? 4
                                                                        : 1;
    swap_bytes(out.mutable_data()->data(), out.data().size(), each);
  }
}

void convert_compressed_image(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::CompressedImage&>(to);
  CdrReader in(message);
  take_header(in, out);
  std::string format = in.text("format");
  const Bytes data = in.bytes("data");
  in.end();
  // "rgb8; jpeg compressed bgr8". The bytes of "16UC1; compressedDepth png" are no picture: there
  // is a head before it.
  const bool has_head = format.find("compressedDepth") != std::string::npos;
  for (const auto& [word, name] :
       {std::pair{"jpeg", "jpeg"}, {"jpg", "jpeg"}, {"png", "png"}, {"webp", "webp"}}) {
    if (!has_head && format.find(word) != std::string::npos) {
      format = name;
      break;
    }
  }
  out.set_format(std::move(format));
  out.mutable_data()->assign(reinterpret_cast<const char*>(data.data()), data.size());
}

void convert_camera_info(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::CameraCalibration&>(to);
  CdrReader in(message);
  take_header(in, out);
  out.set_height(in.number<std::uint32_t>("height"));
  out.set_width(in.number<std::uint32_t>("width"));
  out.set_distortion_model(in.text("distortion_model"));
  const std::uint32_t count = in.count("d", sizeof(double));
  take_doubles(in, "d", static_cast<int>(count), *out.mutable_d());
  take_doubles(in, "k", 9, *out.mutable_k());
  take_doubles(in, "r", 9, *out.mutable_r());
  take_doubles(in, "p", 12, *out.mutable_p());
  for (const char* field :
       {"binning_x", "binning_y", "roi.x_offset", "roi.y_offset", "roi.height", "roi.width"}) {
    in.number<std::uint32_t>(field);
  }
  in.boolean("roi.do_rectify");
  in.end();
}

void convert_scan(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::LaserScan&>(to);
  CdrReader in(message);
  take_header(in, out);
  const auto first_rad = in.number<float>("angle_min");
  in.number<float>("angle_max");
  const auto step_rad = in.number<float>("angle_increment");
  for (const char* field : {"time_increment", "scan_time", "range_min", "range_max"}) {
    in.number<float>(field);
  }
  take_floats(in, "ranges", *out.mutable_ranges());
  take_floats(in, "intensities", *out.mutable_intensities());
  in.end();
  out.mutable_pose()->mutable_position();
  out.mutable_pose()->mutable_orientation()->set_w(1.0);
  out.set_start_angle(first_rad);
  out.set_end_angle(first_rad + static_cast<double>(step_rad) * std::max(0, out.ranges_size() - 1));
}

// ---- nav_msgs, geometry_msgs, tf2_msgs ----

void convert_odometry(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::Odometry&>(to);
  CdrReader in(message);
  take_header(in, out);
  out.set_child_frame_id(in.text("child_frame_id"));
  take_pose(in, *out.mutable_pose());
  take_doubles(in, "pose.covariance", 36, *out.mutable_pose_covariance());
  take_vector(in, "twist.linear", *out.mutable_linear_velocity());
  take_vector(in, "twist.angular", *out.mutable_angular_velocity());
  take_doubles(in, "twist.covariance", 36, *out.mutable_velocity_covariance());
  in.end();
}

void convert_path(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::PosesInFrame&>(to);
  CdrReader in(message);
  take_header(in, out);
  const std::uint32_t count = in.count("poses", kPoseBytes - 7);
  for (std::uint32_t i = 0; i < count; ++i) {
    (void)read_header(in);
    take_pose(in, *out.add_poses());
  }
  in.end();
}

void convert_pose(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::PoseInFrame&>(to);
  CdrReader in(message);
  take_header(in, out);
  take_pose(in, *out.mutable_pose());
  in.end();
}

void convert_twist(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<motion::Velocity&>(to);
  CdrReader in(message);
  take_own_header(in, out);
  take_vector(in, "twist.linear", *out.mutable_linear_mps());
  take_vector(in, "twist.angular", *out.mutable_angular_radps());
  in.end();
}

void convert_transforms(Bytes message, google::protobuf::Message& to) {
  auto& out = dynamic_cast<foxglove::FrameTransforms&>(to);
  CdrReader in(message);
  const std::uint32_t count = in.count("transforms", kPoseBytes - 7);
  for (std::uint32_t i = 0; i < count; ++i) {
    foxglove::FrameTransform& transform = *out.add_transforms();
    Header header = read_header(in);
    set_time(header.time_ns, *transform.mutable_timestamp());
    transform.set_parent_frame_id(std::move(header.frame));
    transform.set_child_frame_id(in.text("child_frame_id"));
    take_vector(in, "translation", *transform.mutable_translation());
    take_rotation(in, "rotation", *transform.mutable_rotation());
  }
  in.end();
}

template <typename T>
RosType type(std::string_view name, void (*convert)(Bytes, google::protobuf::Message&)) {
  return {.name = name, .prototype = &T::default_instance(), .convert = convert};
}

}  // namespace

std::span<const RosType> ros_types() {
  static const std::array kTypes = {
      type<foxglove::PointCloud>("sensor_msgs/msg/PointCloud2", convert_point_cloud),
      type<motion::Imu>("sensor_msgs/msg/Imu", convert_imu),
      type<foxglove::LocationFix>("sensor_msgs/msg/NavSatFix", convert_fix),
      type<foxglove::RawImage>("sensor_msgs/msg/Image", convert_image),
      type<foxglove::CompressedImage>("sensor_msgs/msg/CompressedImage", convert_compressed_image),
      type<foxglove::CameraCalibration>("sensor_msgs/msg/CameraInfo", convert_camera_info),
      type<foxglove::LaserScan>("sensor_msgs/msg/LaserScan", convert_scan),
      type<foxglove::Odometry>("nav_msgs/msg/Odometry", convert_odometry),
      type<foxglove::PosesInFrame>("nav_msgs/msg/Path", convert_path),
      type<foxglove::PoseInFrame>("geometry_msgs/msg/PoseStamped", convert_pose),
      type<motion::Velocity>("geometry_msgs/msg/TwistStamped", convert_twist),
      type<foxglove::FrameTransforms>("tf2_msgs/msg/TFMessage", convert_transforms)};
  return kTypes;
}

const RosType* find_ros_type(std::string_view name) {
  std::string full(name);
  if (const std::size_t slash = full.find('/');
      slash != std::string::npos && slash == full.rfind('/')) {
    full.insert(slash, "/msg");
  }
  const auto found = std::ranges::find(ros_types(), full, &RosType::name);
  return found == ros_types().end() ? nullptr : &*found;
}

}  // namespace fastcycle::rosbag
