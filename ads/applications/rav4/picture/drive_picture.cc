#include "drive_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <string_view>

#include <fmt/format.h>

namespace rav4 {
namespace {

// Sizes are in the picture's own units, which a viewer shows as pixels.
constexpr double kWidth = 1600.0;
constexpr double kMargin = 48.0;
constexpr double kInner = kWidth - 2.0 * kMargin;
constexpr double kHeaderHeight = 124.0;
constexpr double kMapHeightMin = 150.0;
constexpr double kMapHeightMax = 620.0;
constexpr double kLensHeight = 220.0;
constexpr double kLensGap = 24.0;
constexpr double kChartHeight = 230.0;
constexpr double kGap = 30.0;
constexpr double kPadding = 44.0;
constexpr std::size_t kLenses = 3;
constexpr double kLensWidth_m = 12.0;

constexpr std::string_view kReferenceColor = "#2b2f36";
constexpr std::string_view kEstimateColor = "#0a7ea4";
constexpr std::string_view kFixColor = "#e4572e";

struct Rectangle {
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;

  [[nodiscard]] double right() const { return left + width; }
  [[nodiscard]] double bottom() const { return top + height; }
};

struct Pixel {
  double x = 0.0;
  double y = 0.0;
};

/// From the plane to the picture: turned, scaled alike in both directions, moved.
class Projection {
 public:
  Projection(double turn_rad, double pixels_per_m, const PlanePoint& center, const Pixel& at)
      : cos_(std::cos(turn_rad)),
        sin_(std::sin(turn_rad)),
        pixels_per_m_(pixels_per_m),
        center_(center),
        at_(at) {}

  [[nodiscard]] Pixel operator()(const PlanePoint& point) const {
    const double east = point.east_m - center_.east_m;
    const double north = point.north_m - center_.north_m;
    return {at_.x + pixels_per_m_ * (cos_ * east - sin_ * north),
            at_.y - pixels_per_m_ * (sin_ * east + cos_ * north)};
  }

  [[nodiscard]] double pixels_per_m() const { return pixels_per_m_; }
  /// Where north is, as a direction in the picture.
  [[nodiscard]] Pixel north() const { return {-sin_, -cos_}; }

 private:
  double cos_;
  double sin_;
  double pixels_per_m_;
  PlanePoint center_;
  Pixel at_;
};

struct Bounds {
  double left = std::numeric_limits<double>::infinity();
  double right = -std::numeric_limits<double>::infinity();
  double bottom = std::numeric_limits<double>::infinity();
  double top = -std::numeric_limits<double>::infinity();

  void add(double x, double y) {
    left = std::min(left, x);
    right = std::max(right, x);
    bottom = std::min(bottom, y);
    top = std::max(top, y);
  }
  [[nodiscard]] bool is_empty() const { return !(left <= right); }
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

/// The greatest of 1, 2, 5 times a power of ten that is at most `limit`.
double round_step(double limit) {
  const double power = std::pow(10.0, std::floor(std::log10(limit)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= limit) {
      return factor * power;
    }
  }
  return power;
}

double mean_error(const std::vector<ComparedPoint>& points) {
  double sum = 0.0;
  for (const ComparedPoint& point : points) {
    sum += point.error_m;
  }
  return sum / static_cast<double>(points.size());
}

class Drawing {
 public:
  explicit Drawing(const DrivePicture& picture) : picture_(picture) {}

  std::string draw() {
    const std::vector<PlanePoint>& path = main_path();
    turn_rad_ = turn_of(path);
    const Projection map = draw_map(path);
    draw_lenses(map);
    draw_chart();
    height_ += kMargin - kGap;
    return head() + body_ + "</svg>\n";
  }

 private:
  template <typename... Args>
  void put(fmt::format_string<Args...> text, Args&&... args) {
    body_ += fmt::vformat(text, fmt::make_format_args(args...));
    body_ += '\n';
  }

  const std::vector<PlanePoint>& main_path() const {
    return picture_.reference.size() > 1 ? picture_.reference : picture_.estimate;
  }

  // The way from the first point to the last goes from left to right.
  static double turn_of(const std::vector<PlanePoint>& path) {
    if (path.size() < 2) {
      return 0.0;
    }
    return -std::atan2(path.back().north_m - path.front().north_m,
                       path.back().east_m - path.front().east_m);
  }

  std::string head() const {
    std::string text = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1:.0f}\" width=\"{0}\" "
        "height=\"{1:.0f}\" font-family=\"Inter, 'Helvetica Neue', Arial, sans-serif\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#f7f5f0\"/>\n",
        kWidth, height_);
    text += fmt::format(
        "<text x=\"{}\" y=\"66\" font-size=\"34\" font-weight=\"700\" fill=\"#1c1f24\">{}</text>\n"
        "<text x=\"{}\" y=\"98\" font-size=\"17\" fill=\"#6b6f76\">{}</text>\n",
        kMargin, escaped(picture_.title), kMargin, escaped(picture_.subtitle));
    return text + legend();
  }

  std::string legend() const {
    std::string text;
    double x = kWidth - kMargin - 436.0;
    const auto entry = [&](std::string_view mark, std::string_view name) {
      text += fmt::format(
          "<g transform=\"translate({:.0f} 60)\">{}<text x=\"40\" y=\"5\" font-size=\"17\" "
          "fill=\"#1c1f24\">{}</text></g>\n",
          x, mark, name);
      x += 58.0 + 9.0 * static_cast<double>(name.size());
    };
    const auto line = [](std::string_view color, double width) {
      return fmt::format("<line x2=\"30\" stroke=\"{}\" stroke-width=\"{}\"/>", color, width);
    };
    entry(line("#c9c8c6", 9.0), "Reference");
    entry(line(kEstimateColor, 3.5), "Estimate");
    entry(fmt::format("<circle cx=\"15\" r=\"5.5\" fill=\"none\" stroke=\"{}\" "
                      "stroke-width=\"2.4\"/>",
                      kFixColor),
          "Raw GNSS fix");
    return text;
  }

  void panel(const Rectangle& box) {
    put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" rx=\"10\" "
        "fill=\"#ffffff\" "
        "stroke=\"#e3dfd5\"/>",
        box.left, box.top, box.width, box.height);
  }

  void label(double x, double y, std::string_view text, std::string_view extra = "") {
    put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"15\" fill=\"#6b6f76\" {}>{}</text>", x, y,
        extra, escaped(text));
  }

  void polyline(const std::vector<PlanePoint>& points, const Projection& projection,
                std::string_view style) {
    if (points.size() < 2) {
      return;
    }
    std::string list;
    Pixel last{-1e9, -1e9};
    for (const PlanePoint& point : points) {
      const Pixel pixel = projection(point);
      // Invisibly small steps are left out.
      if (std::hypot(pixel.x - last.x, pixel.y - last.y) < 0.8) {
        continue;
      }
      list += fmt::format("{:.1f},{:.1f} ", pixel.x, pixel.y);
      last = pixel;
    }
    put("<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\" "
        "{}/>",
        list, style);
  }

  void scale_bar(const Rectangle& box, const Projection& projection) {
    const double length_m = round_step(0.2 * box.width / projection.pixels_per_m());
    const double length = length_m * projection.pixels_per_m();
    const double x = box.right() - 24.0 - length;
    const double y = box.bottom() - 20.0;
    put("<path d=\"M{:.1f} {:.1f}v8h{:.1f}v-8\" fill=\"none\" stroke=\"#1c1f24\" "
        "stroke-width=\"2\"/>",
        x, y - 8.0, length);
    label(x + 0.5 * length, y - 14.0, fmt::format("{:g} m", length_m), "text-anchor=\"middle\"");
  }

  void north_arrow(const Rectangle& box, const Projection& projection) {
    const double angle_deg =
        std::atan2(projection.north().x, -projection.north().y) * 180.0 / std::numbers::pi;
    put("<g transform=\"translate({:.1f} {:.1f})\"><path transform=\"rotate({:.1f})\" "
        "d=\"M0 -17L8 14L0 8L-8 14Z\" fill=\"#1c1f24\"/></g>",
        box.left + 34.0, box.top + 36.0, angle_deg);
    label(box.left + 60.0, box.top + 41.0, "N");
  }

  // The whole drive. Its panel is as high as the drive is wide.
  Projection draw_map(const std::vector<PlanePoint>& path) {
    Bounds bounds;
    const Projection turned(turn_rad_, 1.0, {}, {});
    const auto add = [&](const PlanePoint& point) {
      const Pixel pixel = turned(point);
      bounds.add(pixel.x, -pixel.y);
    };
    std::ranges::for_each(path, add);
    std::ranges::for_each(picture_.estimate, add);
    if (bounds.is_empty()) {
      bounds.add(0.0, 0.0);
    }
    const double width_m = std::max(bounds.right - bounds.left, 10.0);
    const double height_m = std::max(bounds.top - bounds.bottom, 1.0);
    const double scale =
        std::min((kInner - 2.0 * kPadding) / width_m, (kMapHeightMax - 2.0 * kPadding) / height_m);
    const Rectangle box{.left = kMargin,
                        .top = height_,
                        .width = kInner,
                        .height = std::max(kMapHeightMin, scale * height_m + 2.0 * kPadding)};
    // The middle of the bounds, turned back into the plane.
    const double x = 0.5 * (bounds.left + bounds.right);
    const double y = 0.5 * (bounds.bottom + bounds.top);
    const PlanePoint center{.east_m = std::cos(turn_rad_) * x + std::sin(turn_rad_) * y,
                            .north_m = -std::sin(turn_rad_) * x + std::cos(turn_rad_) * y};
    const Projection projection(turn_rad_, scale, center,
                                {box.left + 0.5 * box.width, box.top + 0.5 * box.height});
    panel(box);
    polyline(picture_.reference, projection,
             fmt::format("stroke=\"{}\" stroke-width=\"11\" opacity=\"0.22\"", kReferenceColor));
    put("<g fill=\"none\" stroke=\"{}\" stroke-width=\"1.1\" opacity=\"0.75\">", kFixColor);
    for (const ComparedPoint& fix : picture_.fixes) {
      const Pixel pixel = projection(fix.position);
      put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.6\"/>", pixel.x, pixel.y);
    }
    put("</g>");
    polyline(picture_.estimate, projection,
             fmt::format("stroke=\"{}\" stroke-width=\"2.6\"", kEstimateColor));
    draw_ends(path, projection);
    scale_bar(box, projection);
    north_arrow(box, projection);
    height_ = box.bottom() + kGap;
    return projection;
  }

  void draw_ends(const std::vector<PlanePoint>& path, const Projection& projection) {
    if (path.empty()) {
      return;
    }
    const Pixel first = projection(path.front());
    const Pixel last = projection(path.back());
    put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"6\" fill=\"#ffffff\" stroke=\"#1c1f24\" "
        "stroke-width=\"2.5\"/>",
        first.x, first.y);
    put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"6\" fill=\"#1c1f24\"/>", last.x, last.y);
    label(first.x, first.y + 30.0, "start", "text-anchor=\"middle\"");
    label(last.x, last.y + 30.0, "end", "text-anchor=\"middle\"");
  }

  // Three places, spread over the drive.
  void draw_lenses(const Projection& map) {
    if (picture_.estimates.empty()) {
      return;
    }
    const double width = (kInner - kLensGap * (kLenses - 1)) / static_cast<double>(kLenses);
    for (std::size_t index = 0; index < kLenses; ++index) {
      const Rectangle box{.left = kMargin + static_cast<double>(index) * (width + kLensGap),
                          .top = height_,
                          .width = width,
                          .height = kLensHeight};
      const std::size_t place = (picture_.estimates.size() - 1) * (2 * index + 1) / (2 * kLenses);
      draw_lens(box, static_cast<char>('A' + index), picture_.estimates[place], map);
    }
    height_ += kLensHeight + kGap;
  }

  void draw_lens(const Rectangle& box, char name, const ComparedPoint& middle,
                 const Projection& map) {
    const Projection lens(turn_rad_, box.width / kLensWidth_m, middle.reference,
                          {box.left + 0.5 * box.width, box.top + 0.5 * box.height});
    const Pixel mark = map(middle.reference);
    put("<g transform=\"translate({:.1f} {:.1f})\"><path d=\"M0 -8v-12\" "
        "stroke=\"#1c1f24\"/><circle "
        "cy=\"-31\" r=\"11\" fill=\"#1c1f24\"/><text y=\"-26\" font-size=\"14\" "
        "font-weight=\"700\" "
        "fill=\"#ffffff\" text-anchor=\"middle\">{}</text></g>",
        mark.x, mark.y, name);
    panel(box);
    put("<clipPath id=\"lens{0}\"><rect x=\"{1:.1f}\" y=\"{2:.1f}\" width=\"{3:.1f}\" "
        "height=\"{4:.1f}\" rx=\"10\"/></clipPath><g clip-path=\"url(#lens{0})\">",
        name, box.left, box.top, box.width, box.height);
    const double reach_m = kLensWidth_m;
    polyline(near(picture_.reference, middle.reference, reach_m), lens,
             fmt::format("stroke=\"{}\" stroke-width=\"13\" opacity=\"0.2\"", kReferenceColor));
    tie(picture_.estimates, middle.reference, lens, kEstimateColor);
    tie(picture_.fixes, middle.reference, lens, kFixColor);
    polyline(near(picture_.estimate, middle.reference, reach_m), lens,
             fmt::format("stroke=\"{}\" stroke-width=\"3\"", kEstimateColor));
    for (const ComparedPoint& fix : picture_.fixes) {
      if (distance(fix.position, middle.reference) < reach_m) {
        const Pixel pixel = lens(fix.position);
        put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\" fill=\"#ffffff\" stroke=\"{}\" "
            "stroke-width=\"2.2\"/>",
            pixel.x, pixel.y, kFixColor);
      }
    }
    put("</g>");
    put("<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"13\" fill=\"#1c1f24\"/><text x=\"{0:.1f}\" "
        "y=\"{2:.1f}\" font-size=\"16\" font-weight=\"700\" fill=\"#ffffff\" "
        "text-anchor=\"middle\">{3}</text>",
        box.left + 28.0, box.top + 28.0, box.top + 33.5, name);
    label(
        box.left + 50.0, box.top + 33.0,
        fmt::format("at {:.1f} s, each position tied to the reference at its time", middle.time_s));
    scale_bar(box, lens);
  }

  static double distance(const PlanePoint& a, const PlanePoint& b) {
    return std::hypot(a.east_m - b.east_m, a.north_m - b.north_m);
  }

  static std::vector<PlanePoint> near(const std::vector<PlanePoint>& points,
                                      const PlanePoint& middle, double reach_m) {
    std::vector<PlanePoint> found;
    std::ranges::copy_if(points, std::back_inserter(found), [&](const PlanePoint& point) {
      return distance(point, middle) < reach_m;
    });
    return found;
  }

  void tie(const std::vector<ComparedPoint>& points, const PlanePoint& middle,
           const Projection& lens, std::string_view color) {
    put("<g stroke=\"{0}\" fill=\"{0}\" stroke-width=\"1.8\" opacity=\"0.75\">", color);
    for (const ComparedPoint& point : points) {
      if (distance(point.reference, middle) < kLensWidth_m) {
        const Pixel from = lens(point.position);
        const Pixel to = lens(point.reference);
        put("<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{2:.1f}\" y2=\"{3:.1f}\"/><circle "
            "cx=\"{2:.1f}\" "
            "cy=\"{3:.1f}\" r=\"2\"/>",
            from.x, from.y, to.x, to.y);
      }
    }
    put("</g>");
  }

  // Both errors over time, with their means, above the judgement of the system.
  void draw_chart() {
    if (picture_.fixes.empty() && picture_.estimates.empty()) {
      return;
    }
    double end_s = 1.0;
    double worst_m = 0.5;
    for (const auto* points : {&picture_.fixes, &picture_.estimates}) {
      for (const ComparedPoint& point : *points) {
        end_s = std::max(end_s, point.time_s);
        worst_m = std::max(worst_m, point.error_m);
      }
    }
    const Rectangle box{
        .left = kMargin, .top = height_, .width = kInner, .height = kChartHeight + 60.0};
    panel(box);
    label(box.left + 20.0, box.top + 30.0, "Horizontal error in metres over time in seconds");
    const Rectangle plot{.left = box.left + 56.0,
                         .top = box.top + 52.0,
                         .width = box.width - 270.0,
                         .height = kChartHeight - 76.0};
    const auto x_of = [&](double time_s) {
      return plot.left + std::clamp(time_s / end_s, 0.0, 1.0) * plot.width;
    };
    const auto y_of = [&](double error_m) {
      return plot.bottom() - error_m / worst_m * plot.height;
    };
    const double step_m = round_step(worst_m / 2.0);
    for (double error_m = 0.0; error_m <= worst_m; error_m += step_m) {
      put("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#e3dfd5\"/>",
          plot.left, y_of(error_m), plot.right(), y_of(error_m));
      label(plot.left - 10.0, y_of(error_m) + 5.0, fmt::format("{:g}", error_m),
            "text-anchor=\"end\"");
    }
    const double step_s = round_step(end_s / 4.0);
    for (double time_s = 0.0; time_s <= end_s; time_s += step_s) {
      label(x_of(time_s), plot.bottom() + 22.0, fmt::format("{:g}", time_s),
            "text-anchor=\"middle\"");
    }
    curve(picture_.fixes, x_of, y_of, kFixColor, 1.6);
    curve(picture_.estimates, x_of, y_of, kEstimateColor, 2.6);
    mean_line(picture_.fixes, "raw fix", plot, y_of, kFixColor);
    mean_line(picture_.estimates, "estimate", plot, y_of, kEstimateColor);
    draw_judgements(plot, box.bottom() - 46.0, x_of);
    height_ = box.bottom() + kGap;
  }

  template <typename X, typename Y>
  void curve(const std::vector<ComparedPoint>& points, X x_of, Y y_of, std::string_view color,
             double width) {
    std::string list;
    for (const ComparedPoint& point : points) {
      list += fmt::format("{:.1f},{:.1f} ", x_of(point.time_s), y_of(point.error_m));
    }
    put("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" "
        "stroke-linejoin=\"round\"/>",
        list, color, width);
  }

  template <typename Y>
  void mean_line(const std::vector<ComparedPoint>& points, std::string_view name,
                 const Rectangle& plot, Y y_of, std::string_view color) {
    if (points.empty()) {
      return;
    }
    const double mean_m = mean_error(points);
    put("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
        "stroke-dasharray=\"7 6\"/>",
        plot.left, y_of(mean_m), plot.right(), y_of(mean_m), color);
    put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"17\" font-weight=\"700\" fill=\"{}\">{}: "
        "{:.2f} "
        "m</text>",
        plot.right() + 16.0, y_of(mean_m) + 6.0, color, name, mean_m);
  }

  template <typename X>
  void draw_judgements(const Rectangle& plot, double top, X x_of) {
    constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kColors{
        {{"starting", "#b9b6ae"},
         {"ready", "#4f9d69"},
         {"degraded", "#e9b44c"},
         {"lost", "#c1292e"}}};
    for (const JudgedSpan& span : picture_.judgements) {
      const auto found = std::ranges::find(kColors, std::string_view(span.judgement),
                                           &std::pair<std::string_view, std::string_view>::first);
      const std::string_view color = found == kColors.end() ? kColors[0].second : found->second;
      const double left = x_of(span.from_s);
      const double width = std::max(x_of(span.to_s) - left, 0.0);
      put("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"20\" fill=\"{}\"/>", left, top,
          width, color);
      if (width > 14.0 * static_cast<double>(span.judgement.size())) {
        put("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"14\" fill=\"#ffffff\" "
            "text-anchor=\"middle\">{}</text>",
            left + 0.5 * width, top + 15.0, escaped(span.judgement));
      }
    }
    label(plot.right() + 16.0, top + 15.0, "judgement");
  }

  const DrivePicture& picture_;
  std::string body_;
  double turn_rad_ = 0.0;
  double height_ = kHeaderHeight;
};

}  // namespace

std::string draw_svg(const DrivePicture& picture) {
  return Drawing(picture).draw();
}

}  // namespace rav4
