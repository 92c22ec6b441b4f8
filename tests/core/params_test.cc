// Parameters of every type, as a component declares them.

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace fastcycle::testing {
namespace {

using google::protobuf::StringValue;

enum class Mode { kComfort, kSport };

/// Reports what it was configured with.
class Configured final : public Component {
 public:
  explicit Configured(Context& context)
      : Component(context),
        flag_(context.param<bool>("flag", {.fallback = false})),
        small_(context.param<std::int16_t>("small", {.fallback = std::int16_t{1}})),
        large_(context.param<std::uint64_t>("large", {.fallback = std::uint64_t{1}})),
        jerk_(context.param<double>("limits.jerk_mps3", {.fallback = 1.0, .min = 0.0, .max = 5.0})),
        name_(context.param<std::string>("label", {.fallback = std::string("none")})),
        file_(context.param<Path>("file", {.fallback = Path("a.txt")})),
        mode_(context.param<Mode>(
            "mode", {.fallback = Mode::kComfort,
                     .names = {{"comfort", Mode::kComfort}, {"sport", Mode::kSport}}})),
        gains_(context.param<std::vector<double>>(
            "gains", {.fallback = std::vector<double>{0.5}, .min = 0.0, .max = 1.0})),
        modes_(context.param<std::vector<Mode>>(
            "modes", {.fallback = std::vector<Mode>{},
                      .names = {{"comfort", Mode::kComfort}, {"sport", Mode::kSport}}})),
        message_(context.param<StringValue>("message", {.fallback = StringValue()})) {}

  void start() override {
    report("flag", flag_.get());
    report("small", static_cast<std::int64_t>(small_.get()));
    report("large", static_cast<std::int64_t>(large_.get() >> 1U));
    report("jerk", jerk_.get());
    report("label", name_.get());
    report("file", file_.get().string());
    report("sport", mode_.get() == Mode::kSport);
    report("gains", static_cast<std::int64_t>(gains_.get().size()));
    report("modes", static_cast<std::int64_t>(modes_.get().size()));
    report("message", message_.get().value());
  }

 private:
  Param<bool> flag_;
  Param<std::int16_t> small_;
  Param<std::uint64_t> large_;
  Param<double> jerk_;
  Param<std::string> name_;
  Param<Path> file_;
  Param<Mode> mode_;
  Param<std::vector<double>> gains_;
  Param<std::vector<Mode>> modes_;
  Param<StringValue> message_;
};

TEST(Params, OfEveryTypeHaveTheConfiguredValue) {
  Bench bench;
  bench.configure(R"({"shared_params": {"label": "shared"}})");
  bench.add<Configured>("c", R"({"params": {
    "flag": true, "small": -7, "large": 18446744073709551615, "limits": {"jerk_mps3": 2},
    "file": "maps/town.osm", "mode": "sport", "gains": [0, 0.25, 1], "modes": ["sport", "comfort"],
    "message": "hello"}})");

  bench.start();

  EXPECT_EQ(bench.result("c", "flag"), ReportValue(true));
  EXPECT_EQ(bench.result("c", "small"), ReportValue(std::int64_t{-7}));
  EXPECT_EQ(bench.result("c", "large"), ReportValue(std::int64_t{INT64_MAX}));
  EXPECT_EQ(bench.result("c", "jerk"), ReportValue(2.0));
  EXPECT_EQ(bench.result("c", "label"), ReportValue(std::string("shared")));
  EXPECT_EQ(bench.result("c", "file"), ReportValue(std::string("maps/town.osm")));
  EXPECT_EQ(bench.result("c", "sport"), ReportValue(true));
  EXPECT_EQ(bench.result("c", "gains"), ReportValue(std::int64_t{3}));
  EXPECT_EQ(bench.result("c", "modes"), ReportValue(std::int64_t{2}));
  EXPECT_EQ(bench.result("c", "message"), ReportValue(std::string("hello")));
}

TEST(Params, HaveTheirFallbackWhenNothingIsConfigured) {
  Bench bench;
  bench.add<Configured>("c");

  bench.start();

  EXPECT_EQ(bench.result("c", "jerk"), ReportValue(1.0));
  EXPECT_EQ(bench.result("c", "label"), ReportValue(std::string("none")));
  EXPECT_EQ(bench.result("c", "gains"), ReportValue(std::int64_t{1}));
}

TEST(Params, WhatDoesNotFitIsNamedAllAtOnce) {
  Bench bench;
  bench.add<Configured>("c", R"({"params": {
    "flag": 1, "small": 40000, "large": -1, "limits": {"jerk_mps3": 6, "jerk_mps": 1}, "label": 3,
    "mode": "sports", "gains": [0.5, 2], "modes": "sport", "message": {"no": 1}}})");

  std::string text;
  try {
    bench.start();
  } catch (const std::runtime_error& error) {
    text = error.what();
  }

  for (const char* expected :
       {"/params/flag: expected", "/params/small: expected an integer in [-32768, 32767]",
        "/params/large: expected", "/params/limits/jerk_mps3: expected a number in [0, 5]",
        "\"limits.jerk_mps\"", "did you mean", "/params/label: expected a string",
        "/params/mode: expected", "\"sport\"", "/params/gains/1: expected a number in [0, 1]",
        "/params/modes: expected a list", "/params/message: expected a message"}) {
    EXPECT_NE(text.find(expected), std::string::npos) << "missing: " << expected << "\n" << text;
  }
}

class Demanding final : public Component {
 public:
  explicit Demanding(Context& context)
      : Component(context), port_(context.param<int>("port", {.min = 1, .max = 65535})) {}

 private:
  Param<int> port_;
};

TEST(Params, ThatAreRequiredAreMissed) {
  Bench bench;
  bench.add<Demanding>("c");

  EXPECT_THROW(bench.start(), std::runtime_error);
}

}  // namespace
}  // namespace fastcycle::testing
