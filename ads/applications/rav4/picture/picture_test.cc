#include "picture.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <fastcycle/testing.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rav4 {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;
using ::testing::HasSubstr;

TEST(Picture, IsDrawnAtTheEnd) {
  const auto file = std::filesystem::path(::testing::TempDir()) / "rav4_picture.svg";
  Bench bench;
  bench.add<Picture>("picture",
                     R"({"params": {"title": "A <drive>", "file": ")" + file.string() + R"("}})");
  auto poses = bench.input<localization::Pose>("localization/pose");
  auto fixes = bench.input<gnss::Fix>("gnss/fix");
  auto statuses = bench.input<supervision::Status>("supervision/status");
  bench.start();

  for (int step = 0; step < 20; ++step) {
    localization::Pose pose;
    pose.mutable_header()->set_taken_ns(bench.now().time_since_epoch().count());
    pose.set_east_m(step);
    pose.set_east_mps(10.0);
    poses.publish(pose);
    fixes.publish({});
    supervision::Status status;
    status.set_judgement(step < 10 ? supervision::READY : supervision::DEGRADED);
    statuses.publish(status);
    bench.advance(100ms);
  }
  bench.stop();

  std::ifstream stream(file);
  const std::string svg{std::istreambuf_iterator<char>(stream), {}};
  EXPECT_THAT(svg, HasSubstr("A &lt;drive&gt;"));
  EXPECT_THAT(svg, HasSubstr("2 s, 19 m, 20 fixes"));
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace rav4
