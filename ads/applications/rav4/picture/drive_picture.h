#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace rav4 {

/// A position in the local plane.
struct PlanePoint {
  double east_m = 0.0;
  double north_m = 0.0;
};

/// A position at a time, and the car's true position.
struct ComparedPoint {
  double time_s = 0.0;  ///< Since the application's start.
  PlanePoint position;
  PlanePoint reference;
  double error_m = 0.0;
};

/// A time span with one judgement.
struct JudgedSpan {
  double from_s = 0.0;
  double to_s = 0.0;
  std::string judgement;  ///< "starting", "ready", "degraded" or "lost"
};

/// The content of a picture of a drive; any part may be empty.
struct DrivePicture {
  std::string title;
  std::string subtitle;
  std::vector<PlanePoint> reference;
  std::vector<PlanePoint> estimate;
  std::vector<ComparedPoint> fixes;      ///< Raw, from the receiver.
  std::vector<ComparedPoint> estimates;  ///< At the times of the reference.
  std::vector<JudgedSpan> judgements;
};

/// Draws the picture as an SVG document: the whole drive with a scale bar and a north arrow, three
/// places of it enlarged, where each position is linked to the true position, and both errors over
/// time. Equal input gives equal bytes.
std::string draw_svg(const DrivePicture& picture);

}  // namespace rav4
