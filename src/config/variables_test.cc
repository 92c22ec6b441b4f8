#include "config/variables.h"

#include <gtest/gtest.h>

#include "config/parse.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

Value value_of(std::string_view text, const std::string& folder = "folder") {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{folder + "/app.json", folder, true});
  return parse(text, source, problems).value();
}

struct Fixture : testing::Test {
  void declare(std::string_view text) { variables.declare(value_of(text)); }

  Value substituted(std::string_view text) {
    variables.complete(problems);
    Value value = value_of(text, "other");
    variables.substitute(value, problems);
    return value;
  }

  Variables variables;
  Problems problems;
};

using VariablesTest = Fixture;

TEST_F(VariablesTest, StandForTheirTextInsideAString) {
  declare(R"({"town": "kassel", "zone": 32, "fast": true})");

  const Value value = substituted(R"(["maps/${town}_${zone}.osm", {"a": "${fast}!"}])");

  EXPECT_EQ(value.to_text(), R"(["maps/kassel_32.osm",{"a":"true!"}])");
  EXPECT_FALSE(problems.has_errors());
}

TEST_F(VariablesTest, KeepTheirTypeWhenTheyAreTheWholeString) {
  declare(R"({"port": 2368, "rate_hz": 0.5, "on": false, "name": "7"})");

  const Value value = substituted(R"(["${port}", "${rate_hz}", "${on}", "${name}"])");

  EXPECT_EQ(value.to_text(), R"([2368,0.5,false,"7"])");
}

TEST_F(VariablesTest, TwoDollarsMeanNoVariable) {
  const Value value = substituted(R"(["$${data}", "$$${data}", "$5", "a$"])");

  EXPECT_EQ(value.to_text(), R"(["${data}","$${data}","$5","a$"])");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(VariablesTest, EscapedTextComesBack) {
  for (const std::string text : {"${data}", "$${data}", "$$${a}${b}", "$", "plain"}) {
    const Value value = substituted(Value(escape_variables(text), {}).to_text());

    EXPECT_EQ(value.as_string(), text);
  }
}

TEST_F(VariablesTest, DefaultsMayUseEarlierOnes) {
  declare(R"({"data": "maps", "map": "${data}/town.osm"})");
  variables.give_option("data=/srv", problems);

  EXPECT_EQ(substituted(R"("${map}")").as_string(), "/srv/town.osm");
}

TEST_F(VariablesTest, OptionsTakeTheTypeOfTheDefault) {
  declare(R"({"version": "1.0", "port": 1, "any": null})");
  variables.give_option("version=2.0", problems);
  variables.give_option("port=2", problems);
  variables.give_option("any=3", problems);

  const Value value = substituted(R"(["${version}", "${port}", "${any}"])");

  EXPECT_EQ(value.to_text(), R"(["2.0",2,3])");
  EXPECT_FALSE(problems.has_errors()) << text_of(problems);
}

TEST_F(VariablesTest, PathsStartWhereTheVariableGotItsValue) {
  declare(R"({"data": "maps", "town": "kassel"})");

  const Value value = substituted(R"(["${data}/a.osm", "maps/${town}.osm", "${data}"])");

  EXPECT_EQ(value[0].as_path(), "folder/maps/a.osm");
  EXPECT_EQ(value[1].as_path(), "other/maps/kassel.osm");
  EXPECT_EQ(value[2].as_path(), "folder/maps");
}

TEST_F(VariablesTest, PathsOfOptionsStartInTheWorkingFolder) {
  declare(R"({"data": "maps"})");
  variables.give_option("data=here", problems);

  EXPECT_EQ(substituted(R"("${data}/a.osm")").as_path(), "here/a.osm");
}

TEST_F(VariablesTest, ThePlaceStaysThatOfTheString) {
  declare(R"({"port": 2368})");

  EXPECT_EQ(to_string(substituted("\n\"${port}\"").place()), "other/app.json:2");
}

TEST_F(VariablesTest, LargeOnesCannotFillTheMemory) {
  declare("{\"big\": \"" + std::string(1'000'000, 'a') + "\"}");
  std::string text = "[\"\"";
  for (int i = 0; i < 100; ++i) {
    text += ",\"${big}\"";
  }

  (void)substituted(text + ']');

  EXPECT_NE(text_of(problems).find("add more than 16 MiB"), std::string::npos);
}

}  // namespace
}  // namespace fastcycle::config
