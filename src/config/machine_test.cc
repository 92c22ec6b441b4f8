#include "config/machine.h"

#include <string>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

// No machine has so many CPUs, and none such a user.
constexpr std::string_view kApplication = R"({"name": "demo",
  "processes": [
    {"name": "sensing", "user": "nobody_of_this_name", "cpus": [0, 1023],
     "sandbox": {"read": ["maps", "no_maps"], "write": ["/none/at/all", "app.json/inside"]}},
    {"name": "planning", "user": "root", "cpus": [0], "sandbox": {"read": ["/"], "write": []}}],
  "components": [
    {"name": "lidar", "library": "a", "process": "sensing"},
    {"name": "planner", "library": "a", "process": "planning"}]})";

struct Machine : testing::Test {
  void SetUp() override { std::filesystem::create_directory(folder / "maps"); }

  // Without the folder in front.
  std::string said() const {
    std::string text = text_of(problems);
    const std::string before = (folder / "app.json").string() + ':';
    for (std::size_t at = 0; (at = text.find(before)) != std::string::npos;) {
      text.erase(at, before.size());
    }
    return text;
  }

  TestFolder folder;
  Problems problems;
};

TEST_F(Machine, UsersThatAreNotThereAreErrorsAndCpusAndPathsWarnings) {
  (void)load({.file = folder.write("app.json", kApplication)}, problems);

  EXPECT_EQ(problems.error_count(), 1U) << said();
  EXPECT_EQ(problems.all().size(), 5U) << said();
  for (const char* sentence :
       {"3: /processes/0/user: expected a user of this machine, found \"nobody_of_this_name\"",
        "3: /processes/0/cpus/1: warning: this machine has no CPU 1023, only CPU",
        "4: /processes/0/sandbox/read/1: warning: there is no file or folder \"no_maps\"",
        "4: /processes/0/sandbox/write/0: warning: there is no file or folder \"/none/at/all\"",
        "4: /processes/0/sandbox/write/1: warning: there is no file or folder "
        "\"app.json/inside\""}) {
    EXPECT_NE(said().find(sentence), std::string::npos) << sentence << '\n' << said();
  }
}

// That of a log, which was made on another one.
TEST_F(Machine, IsNotThatOfAnApplicationWhoseTextIsGiven) {
  const auto app = load({.file = folder / "app.json", .text = std::string(kApplication)}, problems);

  EXPECT_EQ(said(), "");
  EXPECT_EQ(app.processes.size(), 2U);
}

TEST_F(Machine, WhatHasAWrongFormIsLeftToTheSchema) {
  (void)load({.file = folder.write("app.json", R"({"name": "demo", "processes": [7,
      {"name": "a", "user": 7, "cpus": ["x", 18446744073709551615], "sandbox": {"read": [null]}},
      {"name": "b", "user": "", "cpus": 1023, "sandbox": {"read": "none", "write": 7}}],
      "components": [{"name": "lidar", "library": "a"}]})")},
             problems);

  EXPECT_TRUE(problems.has_errors());
  EXPECT_EQ(said().find("of this machine"), std::string::npos) << said();
  EXPECT_EQ(said().find("this machine has no"), std::string::npos) << said();
  EXPECT_EQ(said().find("there is no"), std::string::npos) << said();
}

}  // namespace
}  // namespace fastcycle::config
