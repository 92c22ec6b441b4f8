#include "config/print.h"

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/parse.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

TEST(Print, EachValueSaysWhereItComesFrom) {
  const TestFolder folder;
  const auto file = folder.write("app.json", R"({"name": "demo",
      "components": [{"name": "limiter", "library": "a", "params": {"limit_mps": 13.9,
                      "gains": [1, 2.5]}}]})");
  Problems problems;

  const std::string text =
      print(load({.file = file, .sets = {"limiter.limit_mps=20"}}, problems).effective);

  EXPECT_NE(text.find("\"name\": \"demo\",  // " + file.string() + ":1\n"), std::string::npos);
  EXPECT_NE(text.find("\"limit_mps\": 20,  // --set limiter.limit_mps=20\n"), std::string::npos);
  EXPECT_NE(text.find("\"gains\": [1, 2.5]  // " + file.string() + ":3\n"), std::string::npos);
}

TEST(Print, CanBeLoadedAgainAndMeansTheSame) {
  const TestFolder folder;
  folder.write("lidar.json", R"({"topics": {"points": {"pool_max": 8}, "/map": {}}, "components":
      [{"name": "lidar", "library": "lidar", "params": {"text": "$${no} \n \u0001 \\ \" ü"}}]})");
  const auto file = folder.write("app.json", R"({"name": "demo", "on_fault": "stop",
      "include": [{"file": "lidar.json", "namespace": "front"}],
      "executors": [{"name": "fast", "cpus": [0, 1]}],
      "components": [{"name": "limiter", "library": "a", "executor": "fast", "params":
        {"empty": {}, "none": [], "deep": [[1, [2]], {"x": null}], "tiny": 1e-300, "big": 1e300,
         "most": 18446744073709551615, "least": -9223372036854775808}}]})");
  Problems problems;
  const auto first =
      load({.file = file, .sets = {"limiter.a\nb=\"${x}\" // no comment \n {"}}, problems);
  const auto printed = folder.write("printed.json", print(first.effective));

  const auto second = load({.file = printed}, problems);

  EXPECT_EQ(text_of(problems), "");
  EXPECT_TRUE(second.effective.same_content(first.effective)) << print(second.effective);
  EXPECT_EQ(second.components[0].name, "front/lidar");
}

TEST(Print, FilesMayHaveAnyName) {
  const TestFolder folder;
  const auto file = folder.write("a\xff\n\"b.json", R"({"name": "demo", "components":
      [{"name": "a", "library": "a"}]})");
  Problems problems;
  const auto first = load({.file = file}, problems);

  const auto second =
      load({.file = folder.write("printed.json", print(first.effective))}, problems);

  EXPECT_EQ(text_of(problems), "");
  EXPECT_TRUE(second.effective.same_content(first.effective));
}

}  // namespace
}  // namespace fastcycle::config
