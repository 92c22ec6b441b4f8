// What docs/guides/processes.md shows.
#include <ostream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "process/process.h"

namespace {

constexpr const char* kApplication = R"(
{
  "components": [
    {"name": "camera", "library": "camera"},
    {"name": "detector", "library": "detector", "process": "perception"},
    {"name": "tracker", "library": "tracker", "process": "perception"}
  ],
  "processes": [
    {"name": "perception", "on_exit": "restart", "memory_mb": 2048}
  ]
}
)";

constexpr const char* kHanging = R"(
{
  "components": [
    {"name": "camera", "library": "camera"},
    {"name": "detector", "library": "detector", "process": "perception",
     "callback_limit_ms": 200, "on_hang": "end_process"}
  ],
  "processes": [
    {"name": "perception", "on_exit": "restart", "heartbeat_ms": 500}
  ]
}
)";

constexpr const char* kUntrusted = R"(
{
  "components": [
    {"name": "camera", "library": "camera"},
    {"name": "decoder", "library": "decoder", "process": "decoding"}
  ],
  "processes": [
    {"name": "decoding", "trusted": false, "sandbox": "strict", "on_exit": "restart"}
  ]
}
)";

struct Example {
  const char* name;
  const char* application;
  const char* processes;
};

void PrintTo(const Example& example, std::ostream* out) {
  *out << example.name;
}

// With libraries that are there, all else of it is as it should be.
class ProcessesGuide : public testing::TestWithParam<Example> {};

TEST_P(ProcessesGuide, ShowsAnApplicationThatIsRight) {
  using testing::HasSubstr;
  auto application = nlohmann::json::parse(GetParam().application);
  application["name"] = "guide";
  for (auto& component : application["components"]) {
    component["library"] =
        component["name"] == "camera" ? "examples/hello_talker" : "examples/hello_listener";
  }
  const fastcycle::test::Folder folder;
  const auto file = folder.write("guide.json", application.dump());

  fastcycle::test::Process check(
      {.program = FASTCYCLE_PROGRAM, .arguments = {"check", file.string()}});

  EXPECT_EQ(check.wait().exit_code, 0) << check.errors();
  EXPECT_THAT(check.output() + check.errors(), HasSubstr(GetParam().processes));
}

INSTANTIATE_TEST_SUITE_P(Applications, ProcessesGuide,
                         testing::Values(Example{"restart", kApplication, "main, perception"},
                                         Example{"hang", kHanging, "main, perception"},
                                         Example{"notTrusted", kUntrusted, "main, decoding"}),
                         [](const auto& its) { return its.param.name; });

}  // namespace
