#include "drive_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace ads {
namespace {

// Sizes are in the picture's own units, which a viewer shows as pixels.
constexpr double kWidth = 1600.0;
constexpr double kMargin = 40.0;
constexpr double kInner = kWidth - 2.0 * kMargin;
constexpr double kHeaderHeight = 96.0;
constexpr double kMapHeightMin = 160.0;
constexpr double kMapHeightMax = 560.0;
constexpr double kLensHeight = 200.0;
constexpr double kLensWidth_m = 90.0;
constexpr double kChartHeight = 150.0;
constexpr double kGap = 26.0;
constexpr double kEventHeight = 22.0;
constexpr std::size_t kLenses = 4;
constexpr std::size_t kEventsMax = 12;

constexpr std::string_view kEgoColor = "#0a7ea4";
constexpr std::string_view kObjectColor = "#5c6470";
constexpr std::string_view kPlanColor = "#e4572e";
constexpr std::string_view kGoalColor = "#2f9e44";

struct Rectangle {
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;
};

struct Extent {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-std::numeric_limits<double>::infinity());

  void add(const Eigen::Vector2d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  [[nodiscard]] Eigen::Vector2d size() const { return high - low; }
  [[nodiscard]] Eigen::Vector2d center() const { return (low + high) / 2.0; }
};

/// From the plane to the picture: turned, scaled alike in both directions, moved.
struct Projection {
  double turn_rad = 0.0;
  double pixels_per_m = 1.0;
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d at = Eigen::Vector2d::Zero();

  [[nodiscard]] Eigen::Vector2d operator()(const Eigen::Vector2d& point_m) const {
    const Eigen::Vector2d forward = direction(turn_rad);
    const Eigen::Vector2d offset = point_m - center_m;
    return {at.x() + pixels_per_m * forward.dot(offset),
            at.y() - pixels_per_m * left_of(forward).dot(offset)};
  }
};

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (static_cast<unsigned char>(c) >= 0x20) {
      out += c;
    }
  }
  return out;
}

std::string_view color_of(std::string_view state) {
  if (state == "engaged") {
    return "#2f9e44";
  }
  if (state == "degraded") {
    return "#f08c00";
  }
  if (state == "minimal-risk stop" || state == "stopped") {
    return "#c92a2a";
  }
  return "#adb5bd";
}

class Drawing {
 public:
  explicit Drawing(const DrivePicture& picture) : picture_(picture) {}

  std::string draw() {
    draw_map();
    draw_lenses();
    draw_chart("speed, m/s", [](const auto& moment) { return moment.speed_mps; }, kEgoColor);
    draw_chart(
        "acceleration, m/s²", [](const auto& moment) { return moment.acceleration_mps2; },
        kPlanColor);
    draw_chart(
        "gap to the closest object, m",
        [](const auto& moment) { return std::min(moment.gap_m, 50.0); }, kObjectColor);
    draw_states();
    draw_events();
    return head() + body_ + "</svg>\n";
  }

 private:
  template <typename... Args>
  void put(fmt::format_string<Args...> format, Args&&... args) {
    body_ += fmt::vformat(format, fmt::make_format_args(args...));
  }

  void text(double x, double y, std::string_view words, int size = 15,
            std::string_view anchor = "start", std::string_view color = "#2b2f36") {
    put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" "
        "fill=\"{}\">{}</text>\n",
        x, y, size, anchor, color, escaped(words));
  }

  void line(const std::vector<Eigen::Vector2d>& points, const Projection& map,
            std::string_view style) {
    if (points.size() < 2) {
      return;
    }
    put("<polyline {} points=\"", style);
    for (const Eigen::Vector2d& point : points) {
      const Eigen::Vector2d pixel = map(point);
      put("{:.1f},{:.1f} ", pixel.x(), pixel.y());
    }
    put("\"/>\n");
  }

  void box(const Box& drawn, const Projection& map, std::string_view style) {
    put("<polygon {} points=\"", style);
    for (const Eigen::Vector2d& corner : drawn.corners()) {
      const Eigen::Vector2d pixel = map(corner);
      put("{:.1f},{:.1f} ", pixel.x(), pixel.y());
    }
    put("\"/>\n");
  }

  /// The following elements are clipped to the rectangle, until `end_panel`.
  void begin_panel(const Rectangle& panel) {
    ++panels_;
    put("<clipPath id=\"p{0}\"><rect x=\"{1:.1f}\" y=\"{2:.1f}\" width=\"{3:.1f}\" "
        "height=\"{4:.1f}\" rx=\"6\"/></clipPath><rect x=\"{1:.1f}\" y=\"{2:.1f}\" "
        "width=\"{3:.1f}\" height=\"{4:.1f}\" rx=\"6\" fill=\"#f6f7f9\"/><g "
        "clip-path=\"url(#p{0})\">\n",
        panels_, panel.left, panel.top, panel.width, panel.height);
  }
  void end_panel() { put("</g>\n"); }

  void draw_lanes(const Projection& map) {
    for (const DrivePicture::Lane& lane : picture_.lanes) {
      std::vector<Eigen::Vector2d> outline = lane.left;
      outline.insert(outline.end(), lane.right.rbegin(), lane.right.rend());
      line(outline, map, "fill=\"#e9ecef\" stroke=\"none\"");
    }
    for (const DrivePicture::Lane& lane : picture_.lanes) {
      for (const auto* edge : {&lane.left, &lane.right}) {
        line(*edge, map, "fill=\"none\" stroke=\"#ffffff\" stroke-width=\"1.5\"");
      }
    }
  }

  /// So that the drive goes from left to right.
  [[nodiscard]] double turn() const {
    if (picture_.moments.empty()) {
      return 0.0;
    }
    const Eigen::Vector2d way =
        picture_.moments.back().ego.center_m - picture_.moments.front().ego.center_m;
    return way.norm() > 1.0 ? std::atan2(way.y(), way.x())
                            : picture_.moments.front().ego.heading_rad;
  }

  void draw_map() {
    const double turn_rad = turn();
    Extent extent;
    const Projection turned{.turn_rad = turn_rad};
    for (const DrivePicture::Moment& moment : picture_.moments) {
      extent.add(turned(moment.ego.center_m));
    }
    for (const Box& goal : picture_.goals) {
      extent.add(turned(goal.center_m));
    }
    if (!(extent.low.x() <= extent.high.x())) {
      return;
    }
    const Eigen::Vector2d size = extent.size() + Eigen::Vector2d(40.0, 30.0);
    const double pixels_per_m = std::min(kInner / size.x(), kMapHeightMax / size.y());
    const Rectangle panel{kMargin, top_, kInner,
                          std::clamp(size.y() * pixels_per_m, kMapHeightMin, kMapHeightMax)};
    // The middle, back in the plane.
    const Eigen::Vector2d middle = extent.center().cwiseProduct(Eigen::Vector2d(1.0, -1.0));
    const Eigen::Vector2d forward = direction(turn_rad);
    const Projection map{.turn_rad = turn_rad,
                         .pixels_per_m = pixels_per_m,
                         .center_m = middle.x() * forward + middle.y() * left_of(forward),
                         .at = {panel.left + panel.width / 2.0, panel.top + panel.height / 2.0}};
    begin_panel(panel);
    draw_lanes(map);
    draw_ghosts(map);
    for (const Box& goal : picture_.goals) {
      box(goal, map,
          fmt::format("fill=\"{0}\" fill-opacity=\"0.3\" stroke=\"{0}\" stroke-width=\"1.5\"",
                      kGoalColor));
    }
    std::vector<Eigen::Vector2d> path;
    for (const DrivePicture::Moment& moment : picture_.moments) {
      path.push_back(moment.ego.center_m);
    }
    line(path, map, fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"2\"", kEgoColor));
    end_panel();
    top_ += panel.height + kGap;
  }

  /// Every second the ego and what it saw, fainter the longer ago.
  void draw_ghosts(const Projection& map) {
    double next_s = -std::numeric_limits<double>::infinity();
    for (const DrivePicture::Moment& moment : picture_.moments) {
      if (moment.time_s < next_s) {
        continue;
      }
      next_s = moment.time_s + 1.0;
      for (const DrivePicture::Seen& object : moment.objects) {
        box(object.box, map,
            fmt::format("fill=\"{}\" fill-opacity=\"0.13\" stroke=\"none\"", kObjectColor));
      }
      box(moment.ego, map,
          fmt::format("fill=\"{0}\" fill-opacity=\"0.25\" stroke=\"{0}\"", kEgoColor));
    }
  }

  void draw_lenses() {
    if (picture_.moments.empty()) {
      return;
    }
    const double width = (kInner - kGap * (kLenses - 1)) / kLenses;
    for (std::size_t lens = 0; lens < kLenses; ++lens) {
      const std::size_t last = picture_.moments.size() - 1;
      const DrivePicture::Moment& moment = picture_.moments[last * lens / (kLenses - 1)];
      const Rectangle panel{kMargin + static_cast<double>(lens) * (width + kGap), top_, width,
                            kLensHeight};
      const Projection map{
          .turn_rad = moment.ego.heading_rad,
          .pixels_per_m = width / kLensWidth_m,
          .center_m = moment.ego.center_m + 12.0 * direction(moment.ego.heading_rad),
          .at = {panel.left + panel.width / 2.0, panel.top + panel.height / 2.0}};
      begin_panel(panel);
      draw_lanes(map);
      for (const DrivePicture::Seen& object : moment.objects) {
        box(object.box, map,
            fmt::format("fill=\"{0}\" fill-opacity=\"0.5\" stroke=\"{0}\"", kObjectColor));
        const Eigen::Vector2d at = map(object.box.center_m);
        text(at.x(), at.y() + 3.0, std::to_string(object.id), 9, "middle");
      }
      line(moment.plan, map,
           fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"2\"", kPlanColor));
      box(moment.ego, map,
          fmt::format("fill=\"{0}\" fill-opacity=\"0.8\" stroke=\"{0}\"", kEgoColor));
      end_panel();
      text(panel.left + 8.0, panel.top + 18.0,
           fmt::format("{:.1f} s, {:.1f} m/s, {}", moment.time_s, moment.speed_mps, moment.state),
           13);
    }
    top_ += kLensHeight + kGap;
  }

  [[nodiscard]] double x_of(double time_s) const {
    const double begin_s = picture_.moments.front().time_s;
    const double span_s = std::max(0.1, picture_.moments.back().time_s - begin_s);
    return kMargin + 60.0 + (kInner - 60.0) * (time_s - begin_s) / span_s;
  }

  void draw_chart(std::string_view title,
                  const std::function<double(const DrivePicture::Moment&)>& value,
                  std::string_view color) {
    if (picture_.moments.size() < 2) {
      return;
    }
    double low = 0.0;
    double high = 1.0;
    for (const DrivePicture::Moment& moment : picture_.moments) {
      low = std::min(low, value(moment));
      high = std::max(high, value(moment));
    }
    const double top = top_ + 24.0;
    const double height = kChartHeight - 24.0;
    const auto y_of = [&](double shown) { return top + height * (high - shown) / (high - low); };
    text(kMargin, top_ + 14.0, title, 14);
    for (const double shown : {low, 0.0, high}) {
      put("<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#dee2e6\"/>\n",
          kMargin + 60.0, kMargin + kInner, y_of(shown), y_of(shown));
      text(kMargin + 52.0, y_of(shown) + 4.0, fmt::format("{:.1f}", shown), 12, "end");
    }
    put("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"2\" points=\"", color);
    for (const DrivePicture::Moment& moment : picture_.moments) {
      put("{:.1f},{:.1f} ", x_of(moment.time_s), y_of(value(moment)));
    }
    put("\"/>\n");
    top_ += kChartHeight + kGap;
  }

  void draw_states() {
    if (picture_.moments.size() < 2) {
      return;
    }
    text(kMargin, top_ + 14.0, "state", 14);
    for (std::size_t i = 0; i + 1 < picture_.moments.size(); ++i) {
      const DrivePicture::Moment& moment = picture_.moments[i];
      const double x = x_of(moment.time_s);
      put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"16\" fill=\"{}\"/>\n", x,
          top_ + 2.0, x_of(picture_.moments[i + 1].time_s) - x + 0.5, color_of(moment.state));
    }
    const double end_s = picture_.moments.back().time_s;
    const double step_s = end_s - picture_.moments.front().time_s > 30.0 ? 10.0 : 1.0;
    for (double time_s = std::ceil(picture_.moments.front().time_s / step_s) * step_s;
         time_s <= end_s; time_s += step_s) {
      text(x_of(time_s), top_ + 36.0, fmt::format("{:.0f} s", time_s), 12, "middle");
    }
    top_ += 36.0 + kGap;
  }

  void draw_events() {
    const std::size_t count = std::min(picture_.events.size(), kEventsMax);
    for (std::size_t i = 0; i < count; ++i) {
      const DrivePicture::Event& event = picture_.events[i];
      text(kMargin, top_ + 14.0, fmt::format("{:6.2f} s   {}", event.time_s, event.text), 14);
      top_ += kEventHeight;
    }
    if (count < picture_.events.size()) {
      text(kMargin, top_ + 14.0, fmt::format("and {} more", picture_.events.size() - count), 14);
      top_ += kEventHeight;
    }
  }

  [[nodiscard]] std::string head() {
    const std::string body = std::exchange(body_, {});
    put("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
        "width=\"{0:.0f}\" height=\"{1:.0f}\" font-family=\"sans-serif\">\n<rect width=\"{0:.0f}\" "
        "height=\"{1:.0f}\" fill=\"#ffffff\"/>\n",
        kWidth, top_ + kMargin);
    text(kMargin, 48.0, picture_.title, 26);
    text(kMargin, 74.0, picture_.subtitle, 15, "start", "#5c6470");
    return std::exchange(body_, body);
  }

  const DrivePicture& picture_;
  std::string body_;
  double top_ = kHeaderHeight;
  int panels_ = 0;
};

}  // namespace

std::string draw_svg(const DrivePicture& picture) {
  return Drawing(picture).draw();
}

}  // namespace ads
