#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "process/process.h"

namespace fastcycle::test {

/// Runs an application of a lidar, a tracker and a planner, 100 sweeps of 100 ms.
class TrackingRuns : public testing::Test {
 protected:
  static constexpr const char* kApplication = R"({"name": "tracking", "components": [
      {"name": "lidar", "library": "campaign_parts", "class": "Lidar", "serve_period_ms": 100},
      {"name": "tracker", "library": "campaign_parts", "class": "Tracker"},
      {"name": "planner", "library": "campaign_parts", "class": "Planner"}]})";

  [[nodiscard]] ProcessOptions program(std::vector<std::string> words) const {
    return {.program = FASTCYCLE_PROGRAM, .arguments = std::move(words), .folder = folder_.path()};
  }

  /// The report of a simulated run with these faults.
  nlohmann::json run(const std::string& faults, const std::vector<std::string>& more = {}) {
    folder_.write("app.json", kApplication);
    folder_.write("overlay.json", R"({"faults": )" + faults + "}");
    std::vector<std::string> words{"run",     "app.json",  "--overlay", "overlay.json",
                                   "--clock", "simulated", "--report",  "report.json",
                                   "--quiet", "--for",     "15s"};
    words.insert(words.end(), more.begin(), more.end());
    Process process(program(words));
    ending_ = process.wait();
    errors_ = process.errors();
    return nlohmann::json::parse(read_file(folder_ / "report.json"), nullptr, false);
  }

  /// What became of the sweeps on their way to the tracker.
  static nlohmann::json ledger_of(const nlohmann::json& report) {
    return report["topics"]["sweeps"]["subscribers"][0];
  }

  Folder folder_;
  Ending ending_;
  std::string errors_;
};

}  // namespace fastcycle::test
