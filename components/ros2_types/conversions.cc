#include "ros2_types/conversions.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "foxglove/image.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "ros2/cdr.h"
#include "ros2_types/header.h"

namespace fastcycle::ros2 {
namespace {

using foxglove::PackedElementField;
using google::protobuf::Message;

constexpr std::size_t kFieldsMax = 1024;
constexpr std::size_t kFieldNameMax = 256;

void swap_bytes(char* data, std::size_t size, std::size_t each) {
  for (std::size_t at = 0; each > 1 && at + each <= size; at += each) {
    std::reverse(data + at, data + at + each);
  }
}

// ---- Clouds ----

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
      in.fail("fields.name", fmt::format("at most {} bytes", kFieldNameMax),
              fmt::format("{}", name.size()));
    }
    if (kind == 0 || kind > kNumericTypes.size()) {
      in.fail("fields.datatype", "1 to 8", fmt::format("{}", kind));
    }
    if (elements > kFieldsMax - static_cast<std::size_t>(cloud.fields_size())) {
      in.fail("fields", fmt::format("at most {}", kFieldsMax), "more");
    }
    const PackedElementField::NumericType type = kNumericTypes.at(kind - 1U);
    for (std::uint32_t element = 0; element < elements; ++element) {
      PackedElementField& field = *cloud.add_fields();
      field.set_name(elements == 1 ? name : fmt::format("{}_{}", name, element));
      field.set_type(type);
      const std::uint64_t its_offset = offset + element * std::uint64_t{size_of(type)};
      if (its_offset > UINT32_MAX) {
        in.fail("fields.offset", "one within a point", fmt::format("{}", its_offset));
      }
      field.set_offset(static_cast<std::uint32_t>(its_offset));
    }
  }
}

void point_cloud_to_message(CdrReader& in, Message& to) {
  auto& out = dynamic_cast<foxglove::PointCloud&>(to);
  take_header(in, out);
  const std::uint64_t height = in.number<std::uint32_t>("height");
  const std::uint64_t width = in.number<std::uint32_t>("width");
  take_fields(in, out);
  const bool is_big_endian = in.boolean("is_bigendian");
  const std::uint64_t point_step = in.number<std::uint32_t>("point_step");
  const std::uint64_t row_step = in.number<std::uint32_t>("row_step");
  const auto data = in.bytes("data");
  in.boolean("is_dense");

  for (const PackedElementField& field : out.fields()) {
    if (field.offset() + std::uint64_t{size_of(field.type())} > point_step) {
      in.fail("fields", fmt::format("all within the {} bytes of a point", point_step),
              fmt::format("\"{}\" at {}", field.name(), field.offset()));
    }
  }
  const std::uint64_t row_bytes = width * point_step;
  const std::uint64_t stride = height > 1 ? row_step : row_bytes;
  // No product of two of these is beyond 64 bits.
  if (height > 0 && (stride < row_bytes || height * stride > data.size())) {
    in.fail("data",
            fmt::format("{} rows of {} bytes, each with {} points of {}", height, stride, width,
                        point_step),
            fmt::format("{} bytes", data.size()));
  }
  out.mutable_pose()->mutable_position();
  out.mutable_pose()->mutable_orientation()->set_w(1.0);
  out.set_point_stride(static_cast<std::uint32_t>(point_step));
  std::string& points = *out.mutable_data();
  const auto* const begin = reinterpret_cast<const char*>(data.data());
  if (row_bytes > 0) {
    points.reserve(height * row_bytes);
  }
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

bool is_moved(const foxglove::Pose& pose) {
  const foxglove::Vector3& at = pose.position();
  const foxglove::Quaternion& turn = pose.orientation();
  return at.x() != 0.0 || at.y() != 0.0 || at.z() != 0.0 || turn.x() != 0.0 || turn.y() != 0.0 ||
         turn.z() != 0.0;
}

/// Whether no coordinate of the number at `at` is infinite or not a number: its exponent has a
/// zero.
template <typename Bits>
bool is_finite(const char* at, Bits exponent) {
  Bits bits = 0;
  std::memcpy(&bits, at, sizeof bits);
  return (bits & exponent) != exponent;
}

/// What ROS calls dense: all points have finite coordinates. Messages here do not state it.
bool is_dense(const foxglove::PointCloud& cloud) {
  std::vector<std::size_t> singles;
  std::vector<std::size_t> doubles;
  for (const PackedElementField& field : cloud.fields()) {
    const bool is_coordinate = field.name() == "x" || field.name() == "y" || field.name() == "z";
    if (is_coordinate && field.offset() + size_of(field.type()) <= cloud.point_stride()) {
      if (field.type() == PackedElementField::FLOAT32) {
        singles.push_back(field.offset());
      } else if (field.type() == PackedElementField::FLOAT64) {
        doubles.push_back(field.offset());
      }
    }
  }
  const char* const end = cloud.data().data() + cloud.data().size();
  for (const char* point = cloud.data().data(); point < end; point += cloud.point_stride()) {
    const bool is_valid =
        std::ranges::all_of(singles,
                            [&](std::size_t offset) {
                              return is_finite<std::uint32_t>(point + offset, 0x7F80'0000);
                            }) &&
        std::ranges::all_of(doubles, [&](std::size_t offset) {
          return is_finite<std::uint64_t>(point + offset, 0x7FF0'0000'0000'0000);
        });
    if (!is_valid) {
      return false;
    }
  }
  return true;
}

void point_cloud_to_ros(const Message& from, CdrWriter& out) {
  const auto& in = dynamic_cast<const foxglove::PointCloud&>(from);
  if (is_moved(in.pose())) {
    out.fail("pose", "a cloud whose points lie in its frame", "a pose, which ROS has no place for");
  }
  const std::size_t stride = in.point_stride();
  const std::size_t size = in.data().size();
  if (stride == 0 ? size != 0 : size % stride != 0) {
    out.fail("data", fmt::format("points of {} bytes", stride), fmt::format("{} bytes", size));
  }
  const auto points = static_cast<std::uint32_t>(stride == 0 ? 0 : size / stride);
  put_header(in, out);
  out.number(std::uint32_t{1});
  out.number(points);
  out.count(static_cast<std::size_t>(in.fields_size()), "fields");
  for (const PackedElementField& field : in.fields()) {
    const auto* const kind = std::ranges::find(kNumericTypes, field.type());
    if (kind == kNumericTypes.end()) {
      out.fail("fields.datatype", "a known type of numbers", fmt::format("{}", int{field.type()}));
    }
    out.text(field.name(), "fields.name");
    out.number(field.offset());
    out.number(static_cast<std::uint8_t>(kind - kNumericTypes.begin() + 1));
    out.number(std::uint32_t{1});
  }
  out.boolean(false);
  out.number(in.point_stride());
  out.number(static_cast<std::uint32_t>(size));
  out.bytes(in.data(), "data");
  out.boolean(is_dense(in));
}

// ---- Pictures ----

void image_to_message(CdrReader& in, Message& to) {
  auto& out = dynamic_cast<foxglove::RawImage&>(to);
  take_header(in, out);
  out.set_height(in.number<std::uint32_t>("height"));
  out.set_width(in.number<std::uint32_t>("width"));
  out.set_encoding(in.text("encoding"));
  const bool is_big_endian = in.number<std::uint8_t>("is_bigendian") != 0;
  out.set_step(in.number<std::uint32_t>("step"));
  const auto data = in.bytes("data");
  if (std::uint64_t{out.height()} * out.step() > data.size()) {
    in.fail("data", fmt::format("{} rows of {} bytes", out.height(), out.step()),
            fmt::format("{} bytes", data.size()));
  }
  out.mutable_data()->assign(reinterpret_cast<const char*>(data.data()), data.size());
  if (is_big_endian) {
    const std::string& encoding = out.encoding();
    const std::size_t each = encoding.find("16") != std::string::npos   ? 2
                             : encoding.find("32") != std::string::npos ? 4
                                                                        : 1;
    // Row by row: rows may end with padding.
    std::string& pixels = *out.mutable_data();
    const std::size_t step = out.step() == 0 ? pixels.size() : out.step();
    for (std::size_t at = 0; step > 0 && at < pixels.size(); at += step) {
      const std::size_t row = std::min(step, pixels.size() - at);
      swap_bytes(pixels.data() + at, row, each);
    }
  }
}

void image_to_ros(const Message& from, CdrWriter& out) {
  const auto& in = dynamic_cast<const foxglove::RawImage&>(from);
  put_header(in, out);
  out.number(in.height());
  out.number(in.width());
  out.text(in.encoding(), "encoding");
  out.number(std::uint8_t{0});
  out.number(in.step());
  out.bytes(in.data(), "data");
}

void compressed_image_to_message(CdrReader& in, Message& to) {
  auto& out = dynamic_cast<foxglove::CompressedImage&>(to);
  take_header(in, out);
  std::string format = in.text("format");
  const auto data = in.bytes("data");
  // "rgb8; jpeg compressed bgr8". The bytes of "16UC1; compressedDepth png" are no plain picture:
  // they begin with a header.
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

void compressed_image_to_ros(const Message& from, CdrWriter& out) {
  const auto& in = dynamic_cast<const foxglove::CompressedImage&>(from);
  put_header(in, out);
  out.text(in.format(), "format");
  out.bytes(in.data(), "data");
}

// ---- Scans ----

template <typename Repeated>
void take_floats(CdrReader& in, std::string_view field, Repeated& out) {
  const std::uint32_t count = in.count(field, sizeof(float));
  out.Reserve(static_cast<int>(count));
  for (std::uint32_t i = 0; i < count; ++i) {
    out.Add(in.number<float>(field));
  }
}

template <typename Repeated>
void put_floats(const Repeated& values, std::string_view field, CdrWriter& out) {
  out.count(static_cast<std::size_t>(values.size()), field);
  for (const double value : values) {
    out.number(static_cast<float>(value));
  }
}

void laser_scan_to_message(CdrReader& in, Message& to) {
  auto& out = dynamic_cast<foxglove::LaserScan&>(to);
  take_header(in, out);
  const auto first_rad = in.number<float>("angle_min");
  in.number<float>("angle_max");
  const auto step_rad = in.number<float>("angle_increment");
  for (const char* field : {"time_increment", "scan_time", "range_min", "range_max"}) {
    in.number<float>(field);
  }
  take_floats(in, "ranges", *out.mutable_ranges());
  take_floats(in, "intensities", *out.mutable_intensities());
  out.mutable_pose()->mutable_position();
  out.mutable_pose()->mutable_orientation()->set_w(1.0);
  out.set_start_angle(first_rad);
  out.set_end_angle(first_rad + static_cast<double>(step_rad) * std::max(0, out.ranges_size() - 1));
}

void laser_scan_to_ros(const Message& from, CdrWriter& out) {
  const auto& in = dynamic_cast<const foxglove::LaserScan&>(from);
  if (is_moved(in.pose())) {
    out.fail("pose", "a scan whose origin is that of its frame",
             "a pose, which ROS has no place for");
  }
  put_header(in, out);
  out.number(static_cast<float>(in.start_angle()));
  out.number(static_cast<float>(in.end_angle()));
  const int steps = std::max(1, in.ranges_size() - 1);
  out.number(static_cast<float>((in.end_angle() - in.start_angle()) / steps));
  out.number(0.0F);                                    // Time from one beam to the next,
  out.number(0.0F);                                    // and of the whole scan: unknown.
  out.number(0.0F);                                    // No lower,
  out.number(std::numeric_limits<float>::infinity());  // and no upper limit of ranges.
  put_floats(in.ranges(), "ranges", out);
  put_floats(in.intensities(), "intensities", out);
}

}  // namespace

const Conversions& shipped_conversions() {
  static const Conversions conversions = {
      {"point_cloud", {.to_message = point_cloud_to_message, .to_ros = point_cloud_to_ros}},
      {"image", {.to_message = image_to_message, .to_ros = image_to_ros}},
      {"compressed_image",
       {.to_message = compressed_image_to_message, .to_ros = compressed_image_to_ros}},
      {"laser_scan", {.to_message = laser_scan_to_message, .to_ros = laser_scan_to_ros}},
      {"markers", {.to_message = markers_to_scene, .to_ros = scene_to_markers}}};
  return conversions;
}

}  // namespace fastcycle::ros2
