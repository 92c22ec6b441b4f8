#include "ros2_types/known_types.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "foxglove/image.pb.h"
#include "foxglove/location.pb.h"
#include "foxglove/point_cloud.pb.h"
#include "foxglove/pose.pb.h"
#include "motion/motion.pb.h"
#include "ros2/error.h"
#include "ros2/json_form.h"

namespace fastcycle::ros2 {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Writes CDR in either order of bytes.
class Cdr {
 public:
  explicit Cdr(bool is_big = false) : is_big_(is_big) { bytes_ = {0, is_big ? '\0' : '\1', 0, 0}; }

  template <typename T>
  Cdr& put(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) {
      bytes_.push_back('\0');
    }
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (is_big_) {
      std::reverse(raw, raw + sizeof(T));
    }
    bytes_.insert(bytes_.end(), raw, raw + sizeof(T));
    return *this;
  }
  Cdr& u32(std::uint32_t value) { return put(value); }
  Cdr& doubles(std::initializer_list<double> values) {
    for (const double value : values) {
      put(value);
    }
    return *this;
  }
  Cdr& zeros(int count) {
    for (int i = 0; i < count; ++i) {
      put(0.0);
    }
    return *this;
  }
  Cdr& text(const std::string& text) {
    u32(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back('\0');
    return *this;
  }
  Cdr& blob(const std::string& blob) {
    u32(static_cast<std::uint32_t>(blob.size()));
    bytes_.insert(bytes_.end(), blob.begin(), blob.end());
    return *this;
  }
  Cdr& header(const std::string& frame) { return put(std::int32_t{12}).u32(345).text(frame); }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return std::as_bytes(std::span(bytes_));
  }

 private:
  bool is_big_;
  std::vector<char> bytes_;
};

template <typename T>
T converted(std::string_view type, const Cdr& message) {
  T out;
  KnownTypes types;
  types.find(type).to_message(message.bytes(), out);
  return out;
}

Cdr cloud(std::uint32_t height, std::uint32_t width, std::uint32_t row_step,
          const std::string& data, bool is_big_data = false) {
  Cdr cdr;
  cdr.header("lidar").u32(height).u32(width).u32(2);
  cdr.text("x").u32(0).put(std::uint8_t{7}).u32(1);
  cdr.text("ring").u32(4).put(std::uint8_t{4}).u32(2);
  cdr.put(std::uint8_t{is_big_data}).u32(8).u32(row_step).blob(data).put(std::uint8_t{1});
  return cdr;
}

TEST(KnownTypes, RowsOfACloudAreJoined) {
  const auto out = converted<foxglove::PointCloud>("sensor_msgs/msg/PointCloud2",
                                                   cloud(2, 1, 12, "AAAABBBB....CCCCDDDD...."));

  EXPECT_EQ(out.data(), "AAAABBBBCCCCDDDD");
  EXPECT_EQ(out.point_stride(), 8U);
  EXPECT_EQ(out.frame_id(), "lidar");
  EXPECT_EQ(out.timestamp().seconds(), 12);
  EXPECT_EQ(out.timestamp().nanos(), 345);
  ASSERT_EQ(out.fields_size(), 3);
  EXPECT_EQ(out.fields(0).type(), foxglove::PackedElementField::FLOAT32);
  EXPECT_EQ(out.fields(2).name(), "ring_1");
  EXPECT_EQ(out.fields(2).type(), foxglove::PackedElementField::UINT16);
  EXPECT_EQ(out.fields(2).offset(), 6U);
}

TEST(KnownTypes, NumbersOfACloudBecomeLittleEndian) {
  const auto out = converted<foxglove::PointCloud>("sensor_msgs/msg/PointCloud2",
                                                   cloud(1, 1, 8, "abcdefgh", true));

  EXPECT_EQ(out.data(), "dcbafehg");
}

TEST(KnownTypes, ACloudIsDenseIfItsCoordinatesAreFinite) {
  KnownTypes types;
  const Converter& converter = types.find("sensor_msgs/msg/PointCloud2");
  const auto is_dense = [&](const std::string& data) {
    foxglove::PointCloud ours;
    Buffer written;
    converter.to_message(cloud(1, static_cast<std::uint32_t>(data.size() / 8), 0, data).bytes(),
                         ours);
    converter.to_ros(ours, written);
    return to_json(types.definitions().find("sensor_msgs/msg/PointCloud2"), written.bytes())
        .at("is_dense")
        .get<bool>();
  };
  const std::string finite("\0\0\x80\x3F\xFF\xFF\xFF\xFF", 8);
  const std::string infinite("\0\0\x80\x7F\0\0\0\0", 8);
  const std::string not_a_number("\0\0\xC0\xFF\0\0\0\0", 8);

  EXPECT_TRUE(is_dense(finite + finite));
  EXPECT_TRUE(is_dense(""));
  EXPECT_FALSE(is_dense(finite + infinite));
  EXPECT_FALSE(is_dense(not_a_number + finite));
}

TEST(KnownTypes, CloudsThatLieAreErrors) {
  const auto convert = [](const Cdr& message) {
    return [message] { converted<foxglove::PointCloud>("sensor_msgs/msg/PointCloud2", message); };
  };

  EXPECT_THAT(convert(cloud(2, 1, 4, "AAAABBBBCCCCDDDD")),
              ThrowsMessage<CdrError>(HasSubstr("data: expected 2 rows of 4 bytes")));
  EXPECT_THAT(convert(cloud(0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF, "A")),
              ThrowsMessage<CdrError>(HasSubstr("data: expected 4294967295 rows")));
  EXPECT_THAT(convert(cloud(1, 3, 0, "AAAABBBB")), ThrowsMessage<CdrError>(HasSubstr("data:")));
}

TEST(KnownTypes, ImuTellsWhatIsNotMeasured) {
  Cdr cdr(true);
  cdr.header("imu").doubles({0, 0, 0, 1}).doubles({-1}).zeros(8);
  cdr.doubles({1, 2, 3}).zeros(9).doubles({4, 5, 6}).zeros(9);

  const auto out = converted<motion::Imu>("sensor_msgs/msg/Imu", cdr);

  EXPECT_FALSE(out.has_orientation());
  EXPECT_EQ(out.angular_rate_radps().z(), 3.0);
  EXPECT_EQ(out.acceleration_mps2().x(), 4.0);
  EXPECT_EQ(out.header().taken_ns(), 12'000'000'345);
  EXPECT_EQ(out.acceleration_covariance_size(), 9);
}

TEST(KnownTypes, FixKeepsItsCovariance) {
  Cdr cdr;
  cdr.header("gps").put(std::int8_t{-1}).put(std::uint16_t{1});
  cdr.doubles({49.0, 8.4, 115.0, 4.0}).zeros(8).put(std::uint8_t{2});

  const auto out = converted<foxglove::LocationFix>("sensor_msgs/NavSatFix", cdr);

  EXPECT_EQ(out.longitude(), 8.4);
  EXPECT_EQ(out.position_covariance(0), 4.0);
  EXPECT_EQ(out.position_covariance_type(), foxglove::LocationFix::DIAGONAL_KNOWN);
  EXPECT_EQ(out.metadata(0).value(), "-1");
}

TEST(KnownTypes, PicturesKeepTheirBytes) {
  Cdr raw;
  raw.header("camera").u32(1).u32(2).text("mono16").put(std::uint8_t{1}).u32(4).blob("abcd");
  Cdr packed;
  packed.header("camera").text("rgb8; jpeg compressed bgr8").blob("JPEG");

  EXPECT_EQ(converted<foxglove::RawImage>("sensor_msgs/msg/Image", raw).data(), "badc");
  const auto out = converted<foxglove::CompressedImage>("sensor_msgs/msg/CompressedImage", packed);
  EXPECT_EQ(out.format(), "jpeg");
  EXPECT_EQ(out.data(), "JPEG");
}

TEST(KnownTypes, DepthBehindAHeadIsNotCalledAPicture) {
  Cdr packed;
  packed.header("camera").text("16UC1; compressedDepth png").blob("twelve bytesPNG");

  const auto out = converted<foxglove::CompressedImage>("sensor_msgs/msg/CompressedImage", packed);

  EXPECT_EQ(out.format(), "16UC1; compressedDepth png");
  EXPECT_EQ(out.data(), "twelve bytesPNG");
}

TEST(KnownTypes, CameraHasItsMatrices) {
  Cdr cdr;
  cdr.header("camera").u32(375).u32(1242).text("plumb_bob").u32(1).doubles({0.5});
  cdr.zeros(9).zeros(9).doubles({700}).zeros(11);
  cdr.u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).put(std::uint8_t{0});

  const auto out = converted<foxglove::CameraCalibration>("sensor_msgs/msg/CameraInfo", cdr);

  EXPECT_EQ(out.width(), 1242U);
  EXPECT_THAT(out.d(), ElementsAre(0.5));
  EXPECT_EQ(out.p(0), 700.0);
  EXPECT_EQ(out.p_size(), 12);
}

TEST(KnownTypes, ScanEndsWhereItsLastRangeIs) {
  Cdr cdr;
  cdr.header("laser").put(-1.0F).put(9.0F).put(0.5F).put(0.0F).put(0.1F).put(0.0F).put(30.0F);
  cdr.u32(3).put(1.0F).put(2.0F).put(3.0F).u32(0);

  const auto out = converted<foxglove::LaserScan>("sensor_msgs/msg/LaserScan", cdr);

  EXPECT_EQ(out.start_angle(), -1.0);
  EXPECT_EQ(out.end_angle(), 0.0);
  EXPECT_THAT(out.ranges(), ElementsAre(1.0, 2.0, 3.0));
}

TEST(KnownTypes, OdometryPosesTwistsAndTransformsKeepTheirFrames) {
  Cdr odometry;
  odometry.header("odom").text("base").doubles({1, 2, 3, 0, 0, 0, 1}).zeros(36);
  odometry.doubles({4, 5, 6, 7, 8, 9}).zeros(36);
  Cdr pose;
  pose.header("map").doubles({1, 2, 3, 0, 0, 0, 1});
  Cdr twist;
  twist.header("base").doubles({4, 5, 6, 7, 8, 9});
  Cdr path;
  path.header("map").u32(2).header("map").doubles({1, 2, 3, 0, 0, 0, 1});
  path.header("map").doubles({2, 2, 3, 0, 0, 0, 1});
  Cdr transforms;
  transforms.u32(1).header("base").text("lidar").doubles({1, 0, 1.8, 0, 0, 0, 1});

  const auto moved = converted<foxglove::Odometry>("nav_msgs/msg/Odometry", odometry);
  EXPECT_EQ(moved.child_frame_id(), "base");
  EXPECT_EQ(moved.pose().orientation().w(), 1.0);
  EXPECT_EQ(moved.angular_velocity().z(), 9.0);
  EXPECT_EQ(
      converted<foxglove::PoseInFrame>("geometry_msgs/msg/PoseStamped", pose).pose().position().y(),
      2.0);
  EXPECT_EQ(converted<motion::Velocity>("geometry_msgs/msg/TwistStamped", twist).linear_mps().z(),
            6.0);
  EXPECT_EQ(converted<foxglove::PosesInFrame>("nav_msgs/msg/Path", path).poses(1).position().x(),
            2.0);
  const auto frames = converted<foxglove::FrameTransforms>("tf2_msgs/msg/TFMessage", transforms);
  EXPECT_EQ(frames.transforms(0).parent_frame_id(), "base");
  EXPECT_EQ(frames.transforms(0).child_frame_id(), "lidar");
  EXPECT_EQ(frames.transforms(0).translation().z(), 1.8);
}

TEST(KnownTypes, EveryMessageThatIsCutOffIsAnError) {
  KnownTypes types;
  for (const Mapping& mapping : types.mappings().all()) {
    const Converter& type = types.find(mapping.ros, mapping.message);
    const std::unique_ptr<google::protobuf::Message> out(type.prototype().New());
    const Cdr cdr;
    EXPECT_THROW(type.to_message(cdr.bytes(), *out), CdrError) << mapping.ros;
    EXPECT_THROW(type.to_message(cdr.bytes().first(3), *out), CdrError) << mapping.ros;
  }
}

TEST(KnownTypes, ATypeWithoutAMappingBecomesNothingUnlessOneSaysWhat) {
  KnownTypes types;

  EXPECT_EQ(types.try_find("geometry_msgs/msg/Vector3"), nullptr);
  EXPECT_EQ(types.try_find(""), nullptr);
  EXPECT_EQ(&types.find("geometry_msgs/msg/Vector3", "motion.Vector").prototype(),
            &motion::Vector::default_instance());
}

TEST(KnownTypes, ErrorsOfAMappingAreReported) {
  KnownTypes types;
  const auto add = [&](const std::string& mapping) {
    return [&types, mapping] {
      types.mappings().add("{\"mappings\": [" + mapping + "]}", "mine.json");
      types.find("sensor_msgs/msg/Imu");
    };
  };

  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu"})"),
              ThrowsMessage<MappingError>(
                  HasSubstr("mine.json: /mappings/0/message: expected a text, found null")));
  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu", "message": "motion.Imu", "field": {}})"),
              ThrowsMessage<MappingError>(HasSubstr("/mappings/0/field: there is no such key")));
  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu", "message": "motion.Imus"})"),
              ThrowsMessage<MappingError>(HasSubstr("there is no message motion.Imus")));
  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu", "message": "motion.Imu",
                      "fields": {"speed": "header"}})"),
              ThrowsMessage<MappingError>(HasSubstr("there is no field \"speed\"")));
  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu", "message": "motion.Imu",
                      "fields": {"orientation": "speed"}})"),
              ThrowsMessage<MappingError>(HasSubstr("there is no field \"speed\" in motion.Imu")));
  EXPECT_THAT(add(R"({"ros": "sensor_msgs/msg/Imu", "message": "motion.Imu",
                      "fields": {"orientation": "header.frame"}})"),
              ThrowsMessage<MappingError>(HasSubstr("orientation (geometry_msgs/msg/Quaternion) "
                                                    "cannot become common.Header.frame")));
}

TEST(KnownTypes, UnitsAndFramesAreConvertedBothWays) {
  KnownTypes types;
  types.mappings().add(R"({"mappings": [
    {"ros": "geometry_msgs/msg/PointStamped", "message": "gnss_test.Unused"},
    {"ros": "geometry_msgs/msg/PointStamped", "message": "foxglove.FrameTransform",
     "fields": {"header.frame_id": {"to": "parent_frame_id", "names": {"map_enu": "map"}},
                "header.stamp": "timestamp",
                "point.x": {"to": "translation.x", "scale": 0.01},
                "point.y": {"to": "translation.y", "scale": 2, "offset": 1},
                "point.z": {"value": 7}}}]})",
                       "units.json");
  const Converter& converter =
      types.find("geometry_msgs/msg/PointStamped", "foxglove.FrameTransform");
  Cdr cdr;
  cdr.header("map_enu").doubles({250, 3, 9});
  foxglove::FrameTransform ours;
  Buffer back;

  converter.to_message(cdr.bytes(), ours);
  converter.to_ros(ours, back);

  EXPECT_EQ(ours.parent_frame_id(), "map");
  EXPECT_EQ(ours.translation().x(), 2.5);
  EXPECT_EQ(ours.translation().y(), 7.0);
  EXPECT_EQ(ours.translation().z(), 0.0);
  Cdr expected;
  expected.header("map_enu").doubles({250, 3, 7});
  EXPECT_TRUE(std::ranges::equal(back.bytes(), expected.bytes()));
}

}  // namespace
}  // namespace fastcycle::ros2
