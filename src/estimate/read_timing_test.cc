#include "estimate/read_timing.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"

namespace fastcycle::estimate {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// Reads `text` as a file named times.json.
class ATimingFile : public testing::Test {
 protected:
  Timing read(const std::string& text, double margin = 1.0) {
    Timing timing;
    read_timing(folder_.write("times.json", text), margin, timing, problems_);
    return timing;
  }
  std::string errors() {
    std::string text;
    for (const config::Problem& problem : problems_.all()) {
      const std::string line = to_string(problem);
      text += line.substr(line.find("times.json")) + "\n";
    }
    return text;
  }

  config::TestFolder folder_;  // Of its own: tests run beside each other.
  config::Problems problems_;
};

TEST_F(ATimingFile, SaysHowLongCallbacksTakeAndHowOftenSourcesPublish) {
  const Timing timing = read(R"({"components": {"filter": {"run_ms": 2, "callbacks": {
      "lidar/points": {"run_ms": 9.5, "publishes": ["lidar/objects"]},
      "serve": {"may_publish": {"filter/status": 3}}}}},
    "sources": {"lidar/points": {"period_ms": 100, "jitter_ms": 4, "burst": 2, "age_ms": 12,
                                 "keeps_coming": false}}})");
  EXPECT_EQ(errors(), "");
  const ComponentTiming& filter = timing.components.at("filter");
  EXPECT_EQ(filter.run_time, milliseconds(2));
  EXPECT_EQ(filter.callbacks.at("lidar/points").run_time, microseconds(9500));
  EXPECT_TRUE(filter.callbacks.at("lidar/points").always_publishes);
  EXPECT_FALSE(filter.callbacks.at("serve").always_publishes);
  EXPECT_EQ(filter.callbacks.at("serve").publishes->at(0).second, 3U);
  const SourceTiming& points = timing.sources.at("lidar/points");
  EXPECT_EQ(points.arrivals.period, milliseconds(100));
  EXPECT_EQ(points.arrivals.jitter, milliseconds(4));
  EXPECT_EQ(points.arrivals.burst, 2U);
  EXPECT_EQ(points.age, milliseconds(12));
  EXPECT_FALSE(points.keeps_coming);
}

TEST_F(ATimingFile, MayBeTheReportOfARun) {
  const Timing timing = read(R"({"application": "a", "clock": "live", "topics": {}, "components": {
      "filter": {"callback_us": {"p50": 10, "p99": 20, "max": 1000}},
      "idle": {"callback_us": {"p50": null, "p99": null, "max": null}}}})",
                             1.5);
  EXPECT_EQ(errors(), "");
  EXPECT_EQ(timing.components.at("filter").run_time, microseconds(1500));
  EXPECT_FALSE(timing.components.contains("idle"));
}

TEST_F(ATimingFile, HasItsErrorsNamedAllAtOnce) {
  read(R"({
 "components": {"filter": {"run_sm": 2, "run_ms": -1}},
 "sources": {"points": {"jitter_ms": 4}, "others": {"period_ms": 0}},
 "surces": {}})");
  EXPECT_EQ(errors(),
            "times.json:2: /components/filter/run_sm: unknown key \"run_sm\"; did you mean "
            "\"run_ms\"?\n"
            "times.json:2: /components/filter/run_ms: expected milliseconds in [0, 86400000], "
            "found -1\n"
            "times.json:3: /sources/points: \"jitter_ms\" and \"burst\" mean nothing without "
            "\"period_ms\"\n"
            "times.json:3: /sources/points: a source needs \"period_ms\"\n"
            "times.json:3: /sources/others/period_ms: expected milliseconds in [0.001, 86400000], "
            "found 0\n"
            "times.json:4: /surces: unknown key \"surces\"; did you mean \"sources\"?\n");
}

}  // namespace
}  // namespace fastcycle::estimate
