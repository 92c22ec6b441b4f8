#include "revolution.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/files.h"
#include "encoder.h"

namespace ads::velodyne {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr std::int64_t kMillisecond_ns = 1'000'000;

struct TimedPacket {
  Bytes bytes;
  std::int64_t sent_ns = 0;
};

struct Seen {
  Eigen::Vector3f place_m;
  std::uint16_t time = 0;
  std::uint8_t ring = 0;
  std::uint8_t intensity = 0;
};

// The distance that a laser measures in that direction, in units of 2 mm; some see nothing.
std::uint16_t units_at(std::size_t laser, double azimuth_deg) {
  const auto step = static_cast<std::size_t>(std::lround(azimuth_deg * 10.0)) % 3600;
  return (laser + step) % 11 == 0 ? 0 : static_cast<std::uint16_t>(1000 + step * 5 + laser * 40);
}

Seen seen_at(const lidar::Sweep& sweep, std::size_t index) {
  Seen seen;
  const char* const at = sweep.points().data() + 16 * index;
  std::memcpy(seen.place_m.data(), at, 12);
  std::memcpy(&seen.time, at + 12, 2);
  std::memcpy(&seen.ring, at + 14, 1);
  std::memcpy(&seen.intensity, at + 15, 1);
  return seen;
}

// The packets of a sensor that turns evenly, beginning at 90 degrees.
std::vector<TimedPacket> packets_of(const Model& model, double turns, double step_deg,
                                    std::int64_t begin_us = 0) {
  std::vector<TimedPacket> packets;
  PacketEncoder encoder(model, [&](std::span<const std::uint8_t> bytes, std::int64_t sent_ns) {
    packets.push_back({.bytes = {bytes.begin(), bytes.end()}, .sent_ns = sent_ns});
  });
  std::vector<Return> returns(model.lasers.size());
  const auto count = static_cast<int>(turns * 360.0 / step_deg);
  for (int firing = 0; firing < count; ++firing) {
    const double azimuth_deg = 90.0 + step_deg * firing;
    for (std::size_t laser = 0; laser < returns.size(); ++laser) {
      returns[laser] = {.distance = units_at(laser, azimuth_deg),
                        .intensity = static_cast<std::uint8_t>(laser)};
    }
    encoder.add(azimuth_deg, begin_us + firing * model.firing_ns / 1000, returns);
  }
  return packets;
}

std::vector<lidar::Sweep> decode(RevolutionDecoder& decoder, std::span<const TimedPacket> packets,
                                 std::int64_t delay_ns = 0) {
  std::vector<lidar::Sweep> sweeps;
  for (const TimedPacket& packet : packets) {
    if (decoder.take(packet.bytes, packet.sent_ns + delay_ns)) {
      decoder.write(sweeps.emplace_back());
    }
  }
  return sweeps;
}

// Each point is where its laser, its azimuth at the time of its firing and its distance say.
void expect_places(const lidar::Sweep& sweep, const Model& model, double step_deg,
                   bool is_interpolated) {
  ASSERT_EQ(sweep.rings(), model.lasers.size());
  ASSERT_EQ(sweep.points().size(), std::size_t{16} * sweep.rings() * sweep.columns());
  for (std::size_t column = 0; column < sweep.columns(); ++column) {
    const double azimuth_deg = 180.0 + step_deg * static_cast<double>(column);
    for (std::size_t index = 0; index < model.lasers.size(); ++index) {
      const Laser& laser = model.lasers[index];
      const Seen seen = seen_at(sweep, column * sweep.rings() + laser.ring);
      const double range_m = 0.002 * units_at(index, azimuth_deg);
      if (range_m == 0.0) {
        EXPECT_TRUE(seen.place_m.isZero(0.0F));
        continue;
      }
      const double delay =
          static_cast<double>(laser.delay_ns) / static_cast<double>(model.firing_ns);
      const double azimuth_rad =
          (azimuth_deg + (is_interpolated ? delay * step_deg : 0.0)) * kRadPerDeg;
      const double flat_m = range_m * std::cos(laser.elevation_rad);
      ASSERT_NEAR(seen.place_m.x(), flat_m * std::cos(azimuth_rad), 1e-3) << column << " " << index;
      ASSERT_NEAR(seen.place_m.y(), -flat_m * std::sin(azimuth_rad), 1e-3);
      ASSERT_NEAR(seen.place_m.z(), range_m * std::sin(laser.elevation_rad) + laser.height_m, 1e-3);
      ASSERT_EQ(seen.ring, laser.ring);
      ASSERT_EQ(seen.intensity, index);
    }
  }
}

TEST(Packets, AreWhatWasEncoded) {
  Packet packet;
  packet.blocks[3] = {.flag = BlockFlag::kLasers32To63, .azimuth = 35'999, .returns = {}};
  packet.blocks[3].returns[31] = {.distance = 0xabcd, .intensity = 0xef};
  packet.since_hour_us = 3'599'999'999U;
  packet.factory = {0x39, 0x22};

  const auto bytes = encode_packet(packet);
  Packet read;
  ASSERT_FALSE(parse_packet(bytes, read));

  // The bytes on the wire, as the manual draws them.
  EXPECT_EQ(bytes[0], 0xff);
  EXPECT_EQ(bytes[1], 0xee);
  EXPECT_EQ(bytes[301], 0xdd);
  EXPECT_EQ(bytes[302], 0x9f);
  EXPECT_EQ(bytes[303], 0x8c);
  EXPECT_EQ(bytes[397], 0xcd);
  EXPECT_EQ(bytes[398], 0xab);
  EXPECT_EQ(bytes[399], 0xef);
  EXPECT_EQ(read.blocks[3].azimuth, 35'999);
  EXPECT_EQ(read.blocks[3].returns[31].distance, 0xabcd);
  EXPECT_EQ(read.since_hour_us, 3'599'999'999U);
  EXPECT_EQ(read.factory[1], 0x22);
}

TEST(Packets, ThatAreMalformedAreCountedByWhatIsWrong) {
  RevolutionDecoder decoder(vlp16(), {});
  const Bytes good = packets_of(vlp16(), 0.1, 0.2).front().bytes;
  const auto changed = [&good](std::size_t at, std::uint8_t value) {
    Bytes bytes = good;
    bytes[at] = value;
    return bytes;
  };
  const std::vector<std::pair<Bytes, PacketFault>> cases = {
      {Bytes(good.begin(), good.end() - 1), PacketFault::kSize},
      {Bytes(512), PacketFault::kSize},
      {{}, PacketFault::kSize},
      {changed(100, 0), PacketFault::kFlag},
      {changed(203, 0xff), PacketFault::kAzimuth},
      {changed(1203, 0xff), PacketFault::kTime},
      {changed(1204, 0), PacketFault::kReturnMode},
      {changed(1205, 0x24), PacketFault::kModel},
      {changed(1, 0xdd), PacketFault::kModel}};

  for (const auto& [bytes, fault] : cases) {
    EXPECT_FALSE(decoder.take(bytes, 0));
    EXPECT_EQ(decoder.fault(), fault) << text_of(fault);
  }

  EXPECT_EQ(decoder.counts().packets, 0);
  EXPECT_EQ(decoder.counts().faults[static_cast<std::size_t>(PacketFault::kSize)], 3);
  EXPECT_EQ(decoder.counts().faults[static_cast<std::size_t>(PacketFault::kModel)], 2);
}

TEST(Vlp16, ARevolutionIsWhatWasEncoded) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});

  const auto sweeps = decode(decoder, packets_of(model, 2.5, 0.2));

  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[0].columns(), 1800U);
  expect_places(sweeps[0], model, 0.2, true);
  expect_places(sweeps[1], model, 0.2, true);
  EXPECT_EQ(decoder.counts().packets_lost, 0);
}

TEST(Hdl64, ARevolutionIsWhatWasEncoded) {
  const Model model = nominal_hdl64();
  RevolutionDecoder decoder(model, {});

  const auto sweeps = decode(decoder, packets_of(model, 2.5, 0.2));

  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[0].columns(), 1800U);
  expect_places(sweeps[0], model, 0.2, false);
}

TEST(Hdl64, RingsGoFromTheLowestToTheHighest) {
  const Model model = nominal_hdl64();
  std::vector<double> elevations(64);
  for (const Laser& laser : model.lasers) {
    elevations[laser.ring] = laser.elevation_rad / kRadPerDeg;
  }

  EXPECT_TRUE(std::ranges::is_sorted(elevations));
  EXPECT_NEAR(elevations.front(), -24.33, 1e-9);
  EXPECT_NEAR(elevations[31], -8.83, 1e-9);
  EXPECT_NEAR(elevations[32], -8.333, 1e-3);
  EXPECT_NEAR(elevations.back(), 2.0, 1e-9);
}

TEST(Revolutions, HaveTheTimesOfTheSensorAndTheLeastDelay) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});
  auto packets = packets_of(model, 2.5, 0.2, 1000);
  // Each packet comes late, most of them very late.
  for (std::size_t index = 0; index < packets.size(); ++index) {
    packets[index].sent_ns += (index % 10 == 0 ? 1 : 30) * kMillisecond_ns;
  }

  const auto sweeps = decode(decoder, packets);

  ASSERT_EQ(sweeps.size(), 2U);
  // A quarter of a turn at 1800 firings, 55.296 us each.
  const std::int64_t begin_ns = 1'000'000 + 450 * 55'296;
  EXPECT_NEAR(static_cast<double>(sweeps[0].header().taken_ns() - begin_ns), 1e6, 2e3);
  EXPECT_NEAR(static_cast<double>(sweeps[0].duration_ns()), 1800.0 * 55'296, 2e3);
  const Seen last = seen_at(sweeps[0], 16 * 1799);
  EXPECT_NEAR(last.time, 65'536.0 * 1799.0 / 1800.0, 1.0);
}

TEST(Revolutions, HaveTheHourOfUtcIfTheSensorIsSynchronised) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {.clock = ClockSource::kUtc});
  constexpr std::int64_t kHour_us = 3'600'000'000;
  // The hour ends between the packets.
  const auto packets = packets_of(model, 2.5, 0.2, kHour_us - 60'000);

  const auto sweeps = decode(decoder, packets, 100 * 1000 * kHour_us + 5 * kMillisecond_ns);

  ASSERT_EQ(sweeps.size(), 2U);
  const std::int64_t begin_ns = 101 * 1000 * kHour_us - 60 * kMillisecond_ns + 450 * 55'296;
  EXPECT_NEAR(static_cast<double>(sweeps[0].header().taken_ns() - begin_ns), 0.0, 2e3);
  EXPECT_EQ(decoder.counts().clock_steps, 0);
}

TEST(Revolutions, WithFewPacketsMissingHaveFewerColumns) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});
  auto packets = packets_of(model, 2.5, 0.2);
  packets.erase(packets.begin() + 40, packets.begin() + 42);

  const auto sweeps = decode(decoder, packets);

  ASSERT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(sweeps[0].columns(), 1752U);
  EXPECT_EQ(sweeps[1].columns(), 1800U);
  EXPECT_EQ(decoder.counts().packets_lost, 2);
}

TEST(Revolutions, WithAGapAreLeftOut) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});
  auto packets = packets_of(model, 3.5, 0.2);
  packets.erase(packets.begin() + 40, packets.begin() + 70);

  const auto sweeps = decode(decoder, packets);

  EXPECT_EQ(sweeps.size(), 2U);
  EXPECT_EQ(decoder.counts().incomplete, 1);
}

TEST(Revolutions, OfASensorThatTurnsTooSlowlyAreLeftOut) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});

  // 5400 firings a turn: 299 ms.
  const auto sweeps = decode(decoder, packets_of(model, 2.5, 360.0 / 5400.0));

  EXPECT_TRUE(sweeps.empty());
  EXPECT_EQ(decoder.counts().incomplete, 2);
}

TEST(Revolutions, BeginAnewWhenTheSensorsClockGoesBack) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});

  const auto before = decode(decoder, packets_of(model, 1.0, 0.2, 900'000));
  const auto after = decode(decoder, packets_of(model, 2.5, 0.2, 0));

  EXPECT_EQ(decoder.counts().clock_steps, 1);
  EXPECT_EQ(before.size(), 0U);
  EXPECT_EQ(after.size(), 2U);
}

TEST(Revolutions, OfTwoReturnsHaveTheOneThatIsAskedFor) {
  const Model model = vlp16();
  Packet packet;
  const auto fill = [&packet](std::uint16_t azimuth, std::uint32_t time_us) {
    for (std::size_t index = 0; index < kBlocks; ++index) {
      Block& block = packet.blocks[index];
      block.azimuth = static_cast<std::uint16_t>((azimuth + index / 2 * 40) % kAzimuthUnits);
      const bool is_last = index % 2 == 0;
      block.returns.fill({.distance = static_cast<std::uint16_t>(is_last ? 10'000 : 5'000),
                          .intensity = static_cast<std::uint8_t>(is_last ? 10 : 200)});
    }
    packet.since_hour_us = time_us;
    packet.factory = {static_cast<std::uint8_t>(ReturnMode::kDual), kProductVlp16};
    return encode_packet(packet);
  };
  for (const DualReturn choice : {DualReturn::kStrongest, DualReturn::kLast}) {
    RevolutionDecoder decoder(model, {.dual_return = choice});
    lidar::Sweep sweep;
    for (std::uint32_t count = 0; count < 400 && sweep.columns() == 0; ++count) {
      if (decoder.take(fill(static_cast<std::uint16_t>(count * 240 % 36'000), count * 664), 0)) {
        decoder.write(sweep);
      }
    }
    EXPECT_EQ(sweep.columns(), 1800U);
    EXPECT_NEAR(seen_at(sweep, 100).place_m.norm(), choice == DualReturn::kLast ? 20.0 : 10.0,
                0.02);
    EXPECT_EQ(decoder.counts().packets_lost, 0);
  }
}

TEST(Revolutions, OfASensorThatIsMountedAskewAreTurned) {
  const Model model = nominal_hdl64();
  Eigen::Matrix3f left;
  left << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  RevolutionDecoder straight(model, {});
  RevolutionDecoder turned(model, {.rotation = left});

  const auto ahead = decode(straight, packets_of(model, 2.5, 0.2)).at(0);
  const auto aside = decode(turned, packets_of(model, 2.5, 0.2)).at(0);

  const Seen one = seen_at(ahead, 12'345);
  const Seen other = seen_at(aside, 12'345);
  EXPECT_GT(one.place_m.norm(), 1.0F);
  EXPECT_FLOAT_EQ(other.place_m.x(), -one.place_m.y());
  EXPECT_FLOAT_EQ(other.place_m.y(), one.place_m.x());
}

std::string calibration_text(int lasers) {
  std::string text = "<boost_serialization><DB><distLSB_>0.2</distLSB_><points_>";
  for (int id = 0; id < lasers; ++id) {
    text += fmt::format(
        "<item><px><id_>{}</id_><rotCorrection_>{}</rotCorrection_><vertCorrection_>{}"
        "</vertCorrection_><distCorrection_>120</distCorrection_><vertOffsetCorrection_>20"
        "</vertOffsetCorrection_><horizOffsetCorrection_>-2.6</horizOffsetCorrection_></px></item>",
        id, id % 2 == 0 ? 4.0 : -4.0, -24.0 + 0.4 * id);
  }
  return text + "</points_></DB></boost_serialization>";
}

TEST(Calibrations, OfAnHdl64CorrectEachLaser) {
  const auto file = std::filesystem::temp_directory_path() / "velodyne_calibration_test.xml";
  write_file(file, calibration_text(64));

  const Model model = read_hdl64(file);

  EXPECT_NEAR(model.lasers[10].elevation_rad, -20.0 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(model.lasers[10].azimuth_rad, 4.0 * kRadPerDeg, 1e-9);
  EXPECT_NEAR(model.lasers[10].distance_m, 1.2, 1e-9);
  EXPECT_NEAR(model.lasers[10].vertical_m, 0.2, 1e-9);
  EXPECT_NEAR(model.lasers[10].horizontal_m, -0.026, 1e-9);
  EXPECT_EQ(model.lasers[10].ring, 10U);
  std::filesystem::remove(file);
}

TEST(Calibrations, ThatLackALaserAreRefused) {
  const auto file = std::filesystem::temp_directory_path() / "velodyne_calibration_short.xml";
  write_file(file, calibration_text(63));

  try {
    (void)read_hdl64(file);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("expected 64 lasers"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("found 63"), std::string::npos);
  }
  std::filesystem::remove(file);
}

TEST(Encoders, OfSweepsGiveTheSameSweepBack) {
  const Model model = vlp16();
  RevolutionDecoder decoder(model, {});
  lidar::Sweep sweep = decode(decoder, packets_of(model, 2.5, 0.2)).at(0);
  std::vector<TimedPacket> packets;
  PacketEncoder encoder(model, [&](std::span<const std::uint8_t> bytes, std::int64_t sent_ns) {
    packets.push_back({.bytes = {bytes.begin(), bytes.end()}, .sent_ns = sent_ns});
  });
  for (int turn = 0; turn < 3; ++turn) {
    encoder.add(sweep, 100'000 * turn);
  }
  RevolutionDecoder again(model, {.cut_azimuth_deg = 170.0});

  const auto sweeps = decode(again, packets);

  ASSERT_EQ(sweeps.size(), 2U);
  // It begins 10 degrees earlier: 50 columns.
  for (const std::size_t column : {0U, 777U, 1700U}) {
    for (std::size_t ring = 0; ring < 16; ++ring) {
      const Seen one = seen_at(sweep, column * 16 + ring);
      const Seen other = seen_at(sweeps[1], (column + 50) * 16 + ring);
      EXPECT_NEAR(one.place_m.norm(), other.place_m.norm(), 3e-3);
      // Lasers that fire later look 0.13 degrees farther; the sweep says one azimuth for all.
      EXPECT_LT((one.place_m - other.place_m).norm(), 0.005F * one.place_m.norm() + 0.01F);
    }
  }
}

}  // namespace
}  // namespace ads::velodyne
