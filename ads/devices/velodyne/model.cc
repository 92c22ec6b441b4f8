#include "model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <pugixml.hpp>

#include "common/files.h"

namespace ads::velodyne {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kMetresPerCentimetre = 0.01;
constexpr std::size_t kHdl64Lasers = 64;
constexpr std::int64_t kHdl64Firing_ns = 48'000;
constexpr std::size_t kHdl64Firings = 6;

struct Vlp16Laser {
  double elevation_deg;
  double height_mm;
};
constexpr std::array<Vlp16Laser, 16> kVlp16Lasers = {{{-15.0, 11.2},
                                                      {1.0, -0.7},
                                                      {-13.0, 9.7},
                                                      {3.0, -2.2},
                                                      {-11.0, 8.1},
                                                      {5.0, -3.7},
                                                      {-9.0, 6.6},
                                                      {7.0, -5.1},
                                                      {-7.0, 5.1},
                                                      {9.0, -6.6},
                                                      {-5.0, 3.7},
                                                      {11.0, -8.1},
                                                      {-3.0, 2.2},
                                                      {13.0, -9.7},
                                                      {-1.0, 0.7},
                                                      {15.0, -11.2}}};
constexpr std::int64_t kVlp16Firing_ns = 55'296;
constexpr std::int64_t kVlp16Laser_ns = 2'304;
constexpr std::size_t kVlp16Firings = 24;

// The lasers of one half of an HDL-64E, from the lowest: they fire in another order than they are
// mounted, so that neighbours do not dazzle each other.
constexpr std::array<std::size_t, 32> kHdl64FromLowest = {
    6,  7,  10, 11, 0,  1,  4,  5,  8,  9,  14, 15, 18, 19, 22, 23,
    12, 13, 16, 17, 20, 21, 26, 27, 30, 31, 2,  3,  24, 25, 28, 29};

void sort_rings(std::vector<Laser>& lasers) {
  std::vector<std::size_t> order(lasers.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(
      order, {}, [&](std::size_t index) { return std::pair(lasers[index].elevation_rad, index); });
  for (std::size_t ring = 0; ring < order.size(); ++ring) {
    lasers[order[ring]].ring = ring;
  }
}

Model hdl64(std::string name) {
  return {.kind = ModelKind::kHdl64,
          .name = std::move(name),
          .lasers = std::vector<Laser>(kHdl64Lasers),
          .firing_ns = kHdl64Firing_ns,
          .firings = kHdl64Firings};
}

double number_of(const pugi::xml_node& laser, const char* name, const std::string& place) {
  const pugi::xml_node node = laser.child(name);
  const std::string_view text = node.text().get();
  const double value = node.text().as_double(std::nan(""));
  if (!node || text.empty() || !std::isfinite(value)) {
    throw std::runtime_error(
        fmt::format("{}: expected a number in <{}>, found \"{}\"", place, name, text));
  }
  return value;
}

}  // namespace

Model vlp16() {
  Model model{.kind = ModelKind::kVlp16,
              .name = "VLP-16",
              .lasers = {},
              .firing_ns = kVlp16Firing_ns,
              .firings = kVlp16Firings};
  for (const Vlp16Laser& its : kVlp16Lasers) {
    model.lasers.push_back(
        {.elevation_rad = its.elevation_deg * kRadPerDeg,
         .height_m = its.height_mm * 1e-3,
         .delay_ns = static_cast<std::int64_t>(model.lasers.size()) * kVlp16Laser_ns});
  }
  sort_rings(model.lasers);
  return model;
}

Model nominal_hdl64() {
  Model model = hdl64("HDL-64E, nominal");
  for (std::size_t step = 0; step < kHdl64FromLowest.size(); ++step) {
    const auto from_lowest = static_cast<double>(step);
    const std::size_t laser = kHdl64FromLowest[step];
    model.lasers[laser].elevation_rad = (2.0 - (31.0 - from_lowest) / 3.0) * kRadPerDeg;
    model.lasers[laser + 32].elevation_rad = (-24.33 + from_lowest / 2.0) * kRadPerDeg;
  }
  sort_rings(model.lasers);
  return model;
}

Model read_hdl64(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  pugi::xml_document document;
  const auto result = document.load_buffer(text.data(), text.size());
  if (!result) {
    throw std::runtime_error(fmt::format("{}: expected XML, found at byte {}: {}", file.string(),
                                         result.offset, result.description()));
  }
  Model model = hdl64("HDL-64E");
  std::array<bool, kHdl64Lasers> is_known{};
  const pugi::xml_node points = document.child("boost_serialization").child("DB").child("points_");
  for (const pugi::xml_node item : points.children("item")) {
    const pugi::xml_node its = item.child("px");
    const std::string any = fmt::format("{}: <px>", file.string());
    const double id = number_of(its, "id_", any);
    if (id < 0.0 || id >= static_cast<double>(kHdl64Lasers) || id != std::floor(id)) {
      throw std::runtime_error(fmt::format("{}: expected an <id_> of 0 to 63, found {}", any, id));
    }
    const std::string place = fmt::format("{}: laser {}", file.string(), id);
    const auto index = static_cast<std::size_t>(id);
    model.lasers[index] = {
        .elevation_rad = number_of(its, "vertCorrection_", place) * kRadPerDeg,
        .azimuth_rad = number_of(its, "rotCorrection_", place) * kRadPerDeg,
        .distance_m = number_of(its, "distCorrection_", place) * kMetresPerCentimetre,
        .vertical_m = number_of(its, "vertOffsetCorrection_", place) * kMetresPerCentimetre,
        .horizontal_m = number_of(its, "horizOffsetCorrection_", place) * kMetresPerCentimetre};
    is_known[index] = true;
  }
  const auto count = std::ranges::count(is_known, true);
  if (count != static_cast<std::ptrdiff_t>(kHdl64Lasers)) {
    throw std::runtime_error(
        fmt::format("{}: expected 64 lasers under <boost_serialization><DB><points_>, found {}",
                    file.string(), count));
  }
  sort_rings(model.lasers);
  return model;
}

}  // namespace ads::velodyne
