// Drives through recorded scenes in closed loop with the planner alone:
//   closed_loop [--perfect] [--given] [--only TEXT] [--verbose] [--share I/N] FILE.xml...
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "drive_case.h"

int main(int argc, char** argv) {
  using namespace motion_planning;
  DriveOptions options;
  bool only_given = false;
  std::string only;
  int share = 0;
  int shares = 1;
  std::deque<ads::Scenario> scenarios;
  for (int index = 1; index < argc; ++index) {
    const std::string word = argv[index];
    if (word == "--perfect") {
      options.foresight = Foresight::kPerfect;
    } else if (word == "--given") {
      only_given = true;
    } else if (word == "--only") {
      only = argv[++index];
    } else if (word == "--verbose") {
      options.is_verbose = true;
    } else if (word == "--model") {
      options.with_model = true;
    } else if (word == "--noise") {
      options.with_model = true;
      options.noise = std::atof(argv[++index]);
    } else if (word == "--seed") {
      options.seed = std::strtoull(argv[++index], nullptr, 10);
    } else if (word == "--share") {
      std::sscanf(argv[++index], "%d/%d", &share, &shares);
    } else {
      scenarios.push_back(ads::Scenario::read(word));
    }
  }
  std::vector<DriveCase> cases;
  for (const ads::Scenario& scenario : scenarios) {
    cases.push_back(given_case(scenario));
    if (!only_given) {
      for (const DriveCase& drive : recorded_cases(scenario)) {
        cases.push_back(drive);
      }
    }
  }
  int number = 0;
  for (const DriveCase& drive : cases) {
    if (drive.name.find(only) == std::string::npos || number++ % shares != share) {
      continue;
    }
    const DriveResult r = drive_through(drive, PlannerConfig{}, options);
    std::printf(
        "%-8s %-32s gap %5.2f (%lld at %.1f, recorded %5.2f) a %5.2f..%4.2f lat %4.2f jerk %4.1f "
        "track %.2f %s"
        " | %.1f ms max %.1f | reached %.1f miss %s\n",
        r.collided               ? "HIT"
        : !r.reached             ? "MISSED"
        : r.smallest_gap_m < 0.5 ? "CLOSE"
                                 : "ok",
        drive.name.c_str(), r.smallest_gap_m, static_cast<long long>(r.gap_object), r.gap_s,
        r.recorded_gap_m, r.acceleration_min_mps2, r.acceleration_max_mps2, r.lateral_max_mps2,
        r.jerk_max_mps3, r.tracking_max_m, r.on_road ? "" : "OFF_ROAD", r.time_mean_ms,
        r.time_max_ms, r.reached_s, r.reached ? "-" : r.goal_miss.c_str());
    std::fflush(stdout);
  }
}
