#include "config/params.h"

#include <gtest/gtest.h>

#include "config/parse.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

Value value_of(std::string_view text) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});
  return parse(text, source, problems).value();
}

struct ParamsTest : testing::Test {
  Value params = value_of(R"({"limit_mps": 22.2, "count": 3, "on": true, "mode": "slow",
                              "limits": {"jerk": 1, "snap": 2}, "gains": [1, 2.5]})");
  Value shared = value_of(R"({"width_m": 2, "count": 7, "limits": {"pop": 5}})");
  Problems problems;
  ParamReader reader{params, shared, problems};
};

TEST_F(ParamsTest, AreReadWithTheirTypes) {
  const std::vector<std::string> modes = {"fast", "slow"};

  EXPECT_EQ(reader.read_double("limit_mps", 0), 22.2);
  EXPECT_EQ(reader.read_double("count", 0), 3.0);
  EXPECT_EQ(reader.read_int64("count", 0), 3);
  EXPECT_EQ(reader.read_uint64("count", 0), 3U);
  EXPECT_TRUE(reader.read_bool("on", false));
  EXPECT_EQ(reader.read_text("mode", ""), "slow");
  EXPECT_EQ(reader.read_choice("mode", 0, modes), 1U);
  EXPECT_EQ(reader.read_int64("limits.jerk", 0), 1);
  EXPECT_EQ(text_of(problems), "");
}

TEST_F(ParamsTest, ComeFromTheSharedOnesIfTheComponentHasNone) {
  EXPECT_EQ(reader.read_int64("width_m", 0), 2);
  EXPECT_EQ(reader.read_int64("count", 0), 3);
  EXPECT_EQ(reader.read_int64("limits.pop", 0), 5);
}

TEST_F(ParamsTest, HaveTheirFallbackWhenNoOneGivesThem) {
  EXPECT_EQ(reader.read_double("other", 1.5), 1.5);
  EXPECT_EQ(reader.read_text("another", "x"), "x");
  EXPECT_EQ(reader.read_path("path", "p"), "p");
  EXPECT_EQ(text_of(problems), "");
}

TEST_F(ParamsTest, OfTheWrongKindAreErrorsAndFallBack) {
  EXPECT_EQ(reader.read_double("mode", 13.9, {.min = 0.0, .max = 60.0}), 13.9);
  EXPECT_EQ(reader.read_int64("limit_mps", 5, {.min = 1}), 5);
  EXPECT_TRUE(reader.read_bool("count", true));
  EXPECT_EQ(reader.read_path("on", "p"), "p");

  EXPECT_EQ(text_of(problems),
            "app.json:1: /mode: expected a number in [0, 60], found \"slow\"\n"
            "app.json:1: /limit_mps: expected an integer of at least 1, found 22.2\n"
            "app.json:1: /count: expected true or false, found 3\n"
            "app.json:1: /on: expected a string, found true\n");
}

TEST_F(ParamsTest, RangesIncludeTheirEnds) {
  EXPECT_TRUE(to_double(value_of("60"), {.min = 0.0, .max = 60.0}, problems));
  EXPECT_TRUE(to_int64(value_of("-1"), {.min = -1, .max = 1}, problems));
  EXPECT_FALSE(to_int64(value_of("-2"), {.min = -1, .max = 1}, problems));
  EXPECT_FALSE(to_double(value_of("60.001"), {.max = 60.0}, problems));
}

TEST_F(ParamsTest, UnsignedOnesTakeAll64BitsAndNothingBelowZero) {
  EXPECT_EQ(to_uint64(value_of("18446744073709551615"), {}, problems), UINT64_MAX);
  EXPECT_FALSE(to_int64(value_of("18446744073709551615"), {}, problems));
  EXPECT_FALSE(to_uint64(value_of("-1"), {}, problems));
  EXPECT_NE(text_of(problems).find("expected an integer of at least 0, found -1"),
            std::string::npos);
}

TEST_F(ParamsTest, WordsThatAreNotKnownGetTheNearest) {
  const std::vector<std::string> modes = {"fast", "slow"};

  EXPECT_EQ(reader.read_choice("mode", 0, std::vector<std::string>{"fast", "slower"}), 0U);
  EXPECT_FALSE(to_choice(value_of("3"), modes, problems));

  EXPECT_EQ(text_of(problems),
            "app.json:1: /mode: expected one of \"fast\", \"slower\", found \"slow\"; "
            "did you mean \"slower\"?\n"
            "app.json:1: expected one of \"fast\", \"slow\", found 3\n");
}

TEST_F(ParamsTest, EachWrongItemOfAListIsReported) {
  EXPECT_EQ(to_doubles(params["gains"], {}, problems), (std::vector<double>{1, 2.5}));
  EXPECT_FALSE(to_int64s(value_of("[1, \"a\", 2.5]"), {}, problems));
  EXPECT_FALSE(to_bools(value_of("3"), {}, problems));
  EXPECT_FALSE(to_texts(value_of("[\"a\"]"), {.min = 2, .max = 2}, problems));
  EXPECT_EQ(to_uint64s(value_of("[]"), {}, problems)->size(), 0U);

  EXPECT_EQ(text_of(problems),
            "app.json:1: /1: expected an integer, found \"a\"\n"
            "app.json:1: /2: expected an integer, found 2.5\n"
            "app.json:1: expected a list, found 3\n"
            "app.json:1: expected a list with a number of items in [2, 2], found [\"a\"]\n");
}

TEST_F(ParamsTest, ThatNoOneDeclaredAreErrors) {
  (void)reader.read_double("limits.jerk", 0);
  (void)reader.read_double("limit_mps", 0);
  (void)reader.read_int64("coutn", 0);
  (void)reader.find("gains");
  (void)reader.read_bool("on", false);
  reader.finish();

  EXPECT_EQ(text_of(problems),
            "app.json:1: /count: there is no param \"count\"; did you mean \"coutn\"?\n"
            "app.json:1: /mode: there is no param \"mode\"; known are coutn, gains, "
            "limit_mps, limits.jerk, on\n"
            "app.json:2: /limits/snap: there is no param \"limits.snap\"; known are coutn, gains, "
            "limit_mps, limits.jerk, on\n");
}

TEST_F(ParamsTest, ObjectThatIsReadWholeIsDeclaredWhole) {
  for (const auto name : {"limit_mps", "count", "on", "mode", "limits", "gains"}) {
    EXPECT_NE(reader.find(name), nullptr);
  }
  reader.finish();

  EXPECT_EQ(text_of(problems), "");
}

TEST_F(ParamsTest, ThatHaveToBeThereAreMissed) {
  EXPECT_EQ(reader.require("device"), nullptr);
  EXPECT_NE(reader.require("count"), nullptr);

  EXPECT_EQ(text_of(problems), "app.json:1: the param \"device\" is missing\n");
}

TEST_F(ParamsTest, KeyWithADotIsNeverDeclared) {
  const Value dotted = value_of(R"({"limits.jerk": 1})");
  ParamReader other(dotted, shared, problems);

  EXPECT_EQ(other.read_int64("limits.jerk", 7), 7);
  other.finish();

  EXPECT_EQ(
      text_of(problems),
      "app.json:1: /limits.jerk: there is no param \"limits.jerk\"; write \"limits\": {\"jerk\": "
      "…}\n");
}

TEST_F(ParamsTest, SharedOnesAreCheckedWhenAllComponentsAreKnown) {
  check_shared(shared, {"width_m", "limits"}, problems);

  EXPECT_EQ(text_of(problems),
            "app.json:1: /count: there is no param \"count\"; known are limits, width_m\n");
}

}  // namespace
}  // namespace fastcycle::config
