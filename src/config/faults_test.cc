#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/load.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

using testing::HasSubstr;
using namespace std::chrono_literals;

/// An application with two components, and faults.
struct FaultsTest : testing::Test {
  ApplicationDescription load(const std::string& faults, const std::string& overlay = "") {
    LoadOptions options;
    options.file = folder.write("app.json", R"({"name": "demo", "faults": )" + faults + R"(,
        "components": [{"name": "planner", "library": "p"}, {"name": "limiter", "library": "l"}]})");
    if (!overlay.empty()) {
      options.overlays = {folder.write("overlay.json", overlay)};
    }
    return config::load(options, problems);
  }

  TestFolder folder;
  Problems problems;
};

TEST_F(FaultsTest, AreReadWithAllThatTheySay) {
  const ApplicationDescription application = load(R"({"seed": 7, "list": [
      {"kind": "delay", "topic": "/planning/speed", "publisher": "planner", "subscriber": "limiter",
       "from_s": 1.5, "to_s": 2, "messages": [9, 3], "probability": 0.25, "by_ms": 80},
      {"name": "bad", "kind": "corrupt", "topic": "planning/speed", "field": "mps", "as": "value",
       "value": -1}]})");

  EXPECT_EQ(text_of(problems), "");
  EXPECT_EQ(application.faults.seed, 7U);
  ASSERT_EQ(application.faults.list.size(), 2U);
  const FaultDescription& delay = application.faults.list[0];
  EXPECT_EQ(delay.name, "delay_1");
  EXPECT_EQ(delay.kind, FaultKind::kDelay);
  EXPECT_EQ(delay.topic, "planning/speed");
  EXPECT_EQ(delay.from, 1500ms);
  EXPECT_EQ(delay.to, 2s);
  EXPECT_EQ(delay.messages, (std::vector<std::uint64_t>{3, 9}));
  EXPECT_EQ(delay.probability, 0.25);
  EXPECT_EQ(delay.by, 80ms);
  EXPECT_EQ(application.faults.list[1].name, "bad");
  EXPECT_EQ(application.faults.list[1].corruption, Corruption::kValue);
  EXPECT_EQ(application.faults.list[1].value, -1);
}

TEST_F(FaultsTest, OfAnOverlayTakeThePlaceOfTheList) {
  const ApplicationDescription application =
      load(R"({"seed": 7, "list": [{"kind": "restart", "component": "planner"}]})",
           R"({"faults": {"list": [{"kind": "throw", "component": "limiter"}]}})");

  EXPECT_EQ(text_of(problems), "");
  EXPECT_EQ(application.faults.seed, 7U);
  ASSERT_EQ(application.faults.list.size(), 1U);
  EXPECT_EQ(application.faults.list[0].kind, FaultKind::kThrow);
}

TEST_F(FaultsTest, ThatAreNotCompleteOrContradictThemselvesAreErrors) {
  load(R"({"list": [
      {"kind": "drop"},
      {"kind": "dop", "topic": "a"},
      {"kind": "slow", "component": "planer", "by_ms": 3, "topic": "a"},
      {"kind": "corrupt", "topic": "a", "field": "b", "as": "nan", "value": 3},
      {"kind": "corrupt", "topic": "a", "field": "b", "as": "value"},
      {"kind": "leak", "component": "planner"},
      {"kind": "leek", "component": "planner", "by_mb": 3},
      {"kind": "suspend", "component": "planner"},
      {"kind": "drop", "topic": "a", "from_s": 3, "to_s": 3},
      {"kind": "drop", "topic": "a", "name": "same"},
      {"kind": "drop", "topic": "a", "name": "same"}]})");

  const std::string all = text_of(problems);
  EXPECT_THAT(all, HasSubstr("/faults/list/0: \"drop\" needs the key \"topic\""));
  EXPECT_THAT(all, HasSubstr("/faults/list/1/kind: expected one of \"drop\""));
  EXPECT_THAT(all, HasSubstr("did you mean \"drop\"?"));
  EXPECT_THAT(all, HasSubstr("did you mean \"leak\"?"));
  EXPECT_THAT(all, Not(HasSubstr("\"by_mb\" has no meaning")));  // With which kind is unknown.
  EXPECT_THAT(all, HasSubstr("there is no component \"planer\"; did you mean \"planner\"?"));
  EXPECT_THAT(all, HasSubstr("a \"topic\" has no meaning with the kind \"slow\""));
  EXPECT_THAT(all, HasSubstr("a \"value\" has no meaning where \"as\" is not \"value\""));
  EXPECT_THAT(all, HasSubstr("\"as\": \"value\" needs the key \"value\""));
  EXPECT_THAT(all, HasSubstr("\"leak\" needs the key \"by_mb\""));
  EXPECT_THAT(all, HasSubstr("\"suspend\" needs the key \"process\""));
  EXPECT_THAT(all, HasSubstr("\"to_s\" has to be greater than \"from_s\""));
  EXPECT_THAT(all, HasSubstr("the fault \"same\" is there twice"));
}

}  // namespace
}  // namespace fastcycle::config
