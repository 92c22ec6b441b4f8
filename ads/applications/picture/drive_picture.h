#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "common/plane.h"

namespace ads {

/// A drive as recorded by the modules, without ground truth; any part may be empty.
struct DrivePicture {
  /// An object as perceived.
  struct Seen {
    std::uint64_t id = 0;
    Box box;
  };
  /// One moment of the drive.
  struct Moment {
    double time_s = 0.0;  ///< Since autonomous driving was requested.
    Box ego;
    double speed_mps = 0.0;
    double acceleration_mps2 = 0.0;
    double gap_m = 0.0;  ///< To the closest object; infinite without any.
    std::string state;   ///< The result of `to_string(DrivingState)`.
    std::vector<Seen> objects;
    std::vector<Eigen::Vector2d> plan;  ///< The planned path at that time.
  };
  struct Event {
    double time_s = 0.0;
    std::string text;
  };
  struct Lane {
    std::vector<Eigen::Vector2d> left;
    std::vector<Eigen::Vector2d> right;
  };

  std::string title;
  std::string subtitle;
  std::vector<Lane> lanes;
  std::vector<Box> goals;
  std::vector<Moment> moments;  ///< In the order of their times.
  std::vector<Event> events;
};

/// Draws it as an SVG document: the whole drive with lanes, traffic and the trajectory; four
/// moments of it enlarged, each with its plan; speed, acceleration and the smallest gap
/// over time; the states, and the events as text. Equal input gives equal bytes.
std::string draw_svg(const DrivePicture& picture);

}  // namespace ads
