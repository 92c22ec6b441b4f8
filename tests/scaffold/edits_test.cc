#include "new/edits.h"

#include <gtest/gtest.h>

namespace fastcycle::tool {
namespace {

TEST(Edits, FindTheNamesOfProjectAndApplication) {
  const std::string cmake =
      "cmake_minimum_required(VERSION 3.25)\n# project(wrong)\n  project(door LANGUAGES CXX)\n"
      "fastcycle_application(\n  \"door.json\" more.json)\n";
  EXPECT_EQ(project_of(cmake), "door");
  EXPECT_EQ(application_of(cmake), "door.json");
  EXPECT_EQ(project_of("project()"), std::nullopt);
  EXPECT_EQ(application_of("fastcycle_application("), std::nullopt);
}

TEST(Edits, ACallComesAfterTheLastOfItsKind) {
  const std::string cmake =
      "part(NAME a\n  # ) not yet\n  TEXT \")\")  # the first\npart(NAME "
      "b)\n\napplication(x.json)\n";
  EXPECT_EQ(with_call(cmake, "part", "part(NAME c)", "application"),
            "part(NAME a\n  # ) not yet\n  TEXT \")\")  # the first\npart(NAME b)\npart(NAME c)\n\n"
            "application(x.json)\n");
}

TEST(Edits, ACallThatIsTheFirstOfItsKindComesBeforeWhatNeedsItOrAtTheEnd) {
  EXPECT_EQ(with_call("# no\napplication(x.json)\n", "part", "part(NAME c)", "application"),
            "# no\npart(NAME c)\napplication(x.json)\n");
  EXPECT_EQ(with_call("# no\npartial(x)", "part", "part(NAME c)", "application"),
            "# no\npartial(x)\npart(NAME c)\n");
  EXPECT_EQ(with_call("", "part", "part(NAME c)", "application"), "part(NAME c)\n");
}

TEST(Edits, AComponentComesAtTheEndOfTheList) {
  EXPECT_EQ(with_component(R"({"components": []})", "{}"), "{\"components\": [\n    {}\n  ]}");
  EXPECT_EQ(
      with_component(
          "{\n  \"name\": \"components\",\n  \"components\": [\n    {\"a\": [1]}\n  ]\n}\n", "{}"),
      "{\n  \"name\": \"components\",\n  \"components\": [\n    {\"a\": [1]},\n    {}\n  ]\n}\n");
}

TEST(Edits, CommentsAndListsInsideStayWhereTheyAre) {
  EXPECT_EQ(
      with_component(
          "{ // \"components\": [\n \"x\": {\"components\": [1]}, /* ] */ \"components\" : /**/ [\n"
          "  {\"a\": \"]\\\"]\"} // ] last\n ]}",
          "{}"),
      "{ // \"components\": [\n \"x\": {\"components\": [1]}, /* ] */ \"components\" : /**/ [\n"
      "  {\"a\": \"]\\\"]\"},\n    {} // ] last\n ]}");
}

TEST(Edits, WhatIsNoListIsNotChanged) {
  for (const char* const text :
       {"", "{", "{}", "[]", R"({"components": {}})", R"({"components": [)", R"({"components": [1)",
        R"({"components)", R"({"components":)", "/*", "\""}) {
    EXPECT_EQ(with_component(text, "{}"), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace fastcycle::tool
