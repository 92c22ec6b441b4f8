// What docs/guides/continuity.md shows.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "process/process.h"

namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr const char* kStandby = R"(
{
  "components": [
    {"name": "planner", "library": "planner", "standby": true},
    {"name": "control", "library": "control", "standby": true}
  ]
}
)";

constexpr const char* kShadow = R"(
{
  "shadow": [{"of": "planner", "library": "planner_v2", "params": {"horizon_s": 8}}]
}
)";

json application() {
  json application = json::parse(kStandby);
  application["name"] = "guide";
  application["components"][0]["library"] = "examples/hello_talker";
  application["components"][1]["library"] = "examples/hello_listener";
  return application;
}

TEST(ContinuityGuide, ShowsAnApplicationThatIsRight) {
  const fastcycle::test::Folder folder;
  const auto file = folder.write("guide.json", application().dump());

  fastcycle::test::Process check(
      {.program = FASTCYCLE_PROGRAM, .arguments = {"check", file.string()}});

  EXPECT_EQ(check.wait().exit_code, 0) << check.errors();
  EXPECT_THAT(check.output() + check.errors(),
              HasSubstr("planner (with a standby), control (with a standby)"));
}

TEST(ContinuityGuide, ShowsAnOverlayWithAShadow) {
  json watched = application();
  for (json& component : watched["components"]) {
    component.erase("standby");
  }
  json overlay = json::parse(kShadow);
  overlay["shadow"][0]["library"] = "examples/hello_talker";
  const fastcycle::test::Folder folder;
  const auto file = folder.write("guide.json", watched.dump());
  const auto shadow = folder.write("shadow.json", overlay.dump());

  fastcycle::test::Process check(
      {.program = FASTCYCLE_PROGRAM,
       .arguments = {"check", file.string(), "--overlay", shadow.string()}});

  EXPECT_EQ(check.wait().exit_code, 0) << check.errors();
}

TEST(ContinuityGuide, SaysThatAShadowNeedsAComponentWithoutAStandby) {
  json overlay = json::parse(kShadow);
  const fastcycle::test::Folder folder;
  const auto file = folder.write("guide.json", application().dump());
  const auto shadow = folder.write("shadow.json", overlay.dump());

  fastcycle::test::Process check(
      {.program = FASTCYCLE_PROGRAM,
       .arguments = {"check", file.string(), "--overlay", shadow.string()}});

  EXPECT_EQ(check.wait().exit_code, 2);
  EXPECT_THAT(check.errors(), HasSubstr("has a standby, and no shadow"));
}

}  // namespace
