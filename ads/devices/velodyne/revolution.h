#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "lidar/sweep.pb.h"
#include "model.h"
#include "packet.h"

namespace ads::velodyne {

/// The return that is used if a sensor sends both.
enum class DualReturn : std::uint8_t { kStrongest, kLast };

/// How packet times are converted to the application's time.
enum class ClockSource : std::uint8_t {
  /// The sensor's clock is free-running: its offset is estimated from the packet of a revolution
  /// with the shortest delay.
  kArrival,
  /// The sensor is synchronised to UTC by its GNSS receiver: its microseconds are those of the
  /// hour.
  kUtc,
};

struct RevolutionConfig {
  /// The azimuth at which a revolution begins, clockwise from ahead: behind.
  double cut_azimuth_deg = 180.0;
  double range_min_m = 0.4;
  double range_max_m = 130.0;
  DualReturn dual_return = DualReturn::kStrongest;
  ClockSource clock = ClockSource::kArrival;
  /// From the sensor's axes to forward, left, up.
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();
};

/// Counts of processed packets.
struct RevolutionCounts {
  std::int64_t packets = 0;       ///< Valid ones.
  std::int64_t packets_lost = 0;  ///< From gaps in the sensor's clock.
  std::array<std::int64_t, kPacketFaults> faults{};
  std::int64_t revolutions = 0;
  /// With a gap of more than 25 ms, or longer than 250 ms: the sensor does not rotate properly.
  std::int64_t incomplete = 0;
  std::int64_t clock_steps = 0;  ///< The sensor's clock went back.
};

/// Assembles the packets of a sensor to revolutions, as `lidar::Sweep`.
///
/// The first revolution begins where the sensor first passes the cut: earlier packets are
/// discarded. Angles: VLP-16 User Manual: the azimuth of each laser is interpolated between blocks;
/// HDL-64E S3 User's Manual: that of its block, with the laser's corrections.
///
/// @threads  Confined.
class RevolutionDecoder {
 public:
  RevolutionDecoder(Model model, const RevolutionConfig& config);

  /// Takes the payload of one packet that arrived at `arrival_ns` (Unix time, or any clock that
  /// does not step for `ClockSource::kArrival`). Returns whether it completed a revolution: `write`
  /// provides it until the next call.
  bool take(std::span<const std::uint8_t> payload, std::int64_t arrival_ns);

  /// The fault of the last packet taken.
  [[nodiscard]] std::optional<PacketFault> fault() const { return fault_; }

  /// Writes the last completed revolution: times, columns, rings, points. The header's time is that
  /// of its first column, on the clock of `arrival_ns`.
  ///
  /// @pre  `take` has returned true.
  void write(lidar::Sweep& sweep) const;

  [[nodiscard]] const RevolutionCounts& counts() const { return counts_; }

 private:
  struct Point {
    Eigen::Vector3f place_m = Eigen::Vector3f::Zero();
    std::uint8_t intensity = 0;
  };
  struct Turn {
    std::vector<std::int64_t> columns_ns;  // On the sensor's clock, unwrapped.
    std::vector<Point> points;             // Column by column, ring by ring.
    std::int64_t end_ns = 0;
    std::int64_t offset_ns = std::numeric_limits<std::int64_t>::max();  // To the application's.

    void clear();
  };
  // One firing of all lasers.
  struct Column {
    std::array<Return, 2 * kReturnsPerBlock> returns{};
    double azimuth_deg = 0.0;
    double step_deg = 0.0;  // Rotation until the next one; 0 if that is corrected for.
    std::int64_t time_ns = 0;
  };

  [[nodiscard]] std::optional<PacketFault> check(const Packet& packet) const;
  void follow_clock(std::int64_t arrival_ns, std::int64_t span_ns);
  void give_up_turn();
  // The number of firings in the packet; each return of a firing has its own block.
  [[nodiscard]] std::size_t firings_of(const Packet& packet) const;
  bool take_vlp16();
  bool take_hdl64();
  void merge(std::span<const Return> from, std::span<Return> into) const;
  bool add(const Column& column);
  void place(const Column& column);
  [[nodiscard]] Point point_of(const Laser& laser, const Return& measured,
                               double azimuth_rad) const;
  [[nodiscard]] bool passes_cut(double azimuth_deg);

  Model model_;
  RevolutionConfig config_;
  RevolutionCounts counts_;
  std::optional<PacketFault> fault_;
  Packet packet_;
  std::optional<std::uint32_t> last_us_;
  std::int64_t last_span_ns_ = 0;
  std::int64_t sensor_ns_ = 0;
  std::int64_t offset_ns_ = 0;
  std::optional<double> since_cut_deg_;
  double step_deg_ = 0.0;
  bool is_turning_ = false;  // The cut has been passed, without a gap since.
  Turn turn_;
  Turn ended_;
};

}  // namespace ads::velodyne
