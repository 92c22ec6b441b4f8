// The application of docs/guides/looking_inside.md; what the commands say is tested in tests/live.

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/problem.h"
#include "config/test_folder.h"

namespace {

// [snippet configuration]
constexpr const char* kApplication = R"(
{
  "name": "speed_demo",
  "inspect": {"allow": ["params", "publish", "lifecycle"]},
  "components": [
    {"name": "limiter", "library": "speed_limiter", "params": {"limit_mps": 22.2}},
    {"name": "planner", "library": "speed_planner", "serve_period_ms": 10}
  ]
}
)";
// [end]

TEST(LookingInsideGuide, ItsFileHasNoError) {
  const fastcycle::config::TestFolder folder;
  fastcycle::config::LoadOptions options;
  options.file = folder.write("app.json", kApplication);
  fastcycle::config::Problems problems;

  const auto application = fastcycle::config::load(options, problems);

  EXPECT_TRUE(problems.all().empty());
  EXPECT_EQ(application.components.size(), 2U);
}

}  // namespace
