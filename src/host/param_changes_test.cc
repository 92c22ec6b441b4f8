#include "host/param_changes.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"
#include "report/param_list.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace std::chrono_literals;

/// The committed values of all parameters, "one.k0" and so on, as JSON.
std::map<std::string, std::string> values_of(const Application& application) {
  std::map<std::string, std::string> values;
  for (const ListedParam& param : list_params(application)) {
    values[param.full_name()] = param.value.dump();
  }
  return values;
}

ReportValue result(const Application& application, std::size_t component, const std::string& name) {
  return application.components()[component]->results.at(name);
}

/// Four numbers from 0 to 100 that can be changed, and one that cannot.
class Knobs final : public Component {
 public:
  explicit Knobs(Context& context)
      : Component(context), fixed_(context.param<std::int64_t>("fixed", {.fallback = 7})) {
    for (const char* name : {"k0", "k1", "k2", "k3"}) {
      knobs_.push_back(context.param<std::int64_t>(
          name, {.fallback = 10, .min = 0, .max = 100, .is_tunable = true}));
      context.on_change(knobs_.back(), [this] { ++changes_; });
    }
  }

  void stop() override {
    std::string text;
    for (const Param<std::int64_t>& knob : knobs_) {
      text += std::to_string(knob.get()) + " ";
    }
    report("knobs", text);
    report("changes", changes_);
  }

 private:
  Param<std::int64_t> fixed_;
  std::vector<Param<std::int64_t>> knobs_;
  std::int64_t changes_ = 0;
};

constexpr const char* kThreeOfKnobs = R"({"name": "t", "components": [
  {"name": "one", "library": "knobs"}, {"name": "two", "library": "knobs"},
  {"name": "three", "library": "knobs"}]})";

/// Ten values for the three of them.
std::vector<ParamChange> ten_changes() {
  std::vector<ParamChange> changes;
  for (const char* name : {"one.k0", "one.k1", "one.k2", "one.k3", "two.k0", "two.k1", "two.k2",
                           "two.k3", "three.k0", "three.k1"}) {
    changes.push_back({name, std::to_string(20 + changes.size())});
  }
  return changes;
}

class ATransaction : public ::testing::TestWithParam<bool> {
 protected:
  ATransaction() { classes_.with<Knobs>("knobs"); }

  [[nodiscard]] static ClockOptions clock() { return {.is_simulated = GetParam(), .workers = 2}; }

  TestClasses classes_;
};

TEST_P(ATransaction, OfTenGoodValuesOverThreeComponentsChangesAll) {
  const auto application = make_application(kThreeOfKnobs, classes_, clock());
  application->start();

  EXPECT_TRUE(application->change_params(ten_changes()).has_changed());

  EXPECT_EQ(values_of(*application)["three.k1"], "29");
  application->stop();
  EXPECT_EQ(result(*application, 0, "knobs"), ReportValue(std::string("20 21 22 23 ")));
  EXPECT_EQ(result(*application, 1, "knobs"), ReportValue(std::string("24 25 26 27 ")));
  EXPECT_EQ(result(*application, 2, "knobs"), ReportValue(std::string("28 29 10 10 ")));
  EXPECT_EQ(result(*application, 0, "changes"), ReportValue(std::int64_t{4}));
  EXPECT_EQ(result(*application, 2, "changes"), ReportValue(std::int64_t{2}));
}

TEST_P(ATransaction, WithOneInvalidValueAmongTenChangesNothingAnywhere) {
  const auto application = make_application(kThreeOfKnobs, classes_, clock());
  application->start();
  const auto before = values_of(*application);
  for (std::size_t wrong = 0; wrong < 10; ++wrong) {
    std::vector<ParamChange> changes = ten_changes();
    changes[wrong].json = "101";

    const ParamsResult refused = application->change_params(changes);

    EXPECT_FALSE(refused.has_changed());
    EXPECT_THAT(refused.errors,
                ElementsAre(changes[wrong].param + ": expected an integer in [0, 100], found 101"));
    EXPECT_EQ(values_of(*application), before);
  }
  application->stop();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(result(*application, i, "knobs"), ReportValue(std::string("10 10 10 10 ")));
    EXPECT_EQ(result(*application, i, "changes"), ReportValue(std::int64_t{0}));
  }
}

TEST_P(ATransaction, ReportsAllItsErrorsAtOnce) {
  const auto application = make_application(kThreeOfKnobs, classes_, clock());
  application->start();

  const ParamsResult refused = application->change_params({{"one.k0", "\"fast\""},
                                                           {"one.k1", "-1"},
                                                           {"one.kO", "1"},
                                                           {"tow.k0", "1"},
                                                           {"two.fixed", "1"},
                                                           {"two.k0", "1"},
                                                           {"two.k0", "2"},
                                                           {"k3", "1"},
                                                           {"shared_params.k", "1"},
                                                           {"three.k0", "50"}});

  EXPECT_THAT(refused.errors,
              ElementsAre(HasSubstr("k3: a param is named with its component"),
                          "one.k0: expected an integer in [0, 100], found \"fast\"",
                          "one.k1: expected an integer in [0, 100], found -1",
                          "one.kO: there is no param \"kO\"; did you mean \"k0\"?",
                          "shared_params.k: no component reads a shared param \"k\"",
                          "tow.k0: there is no component \"tow\"; did you mean \"two\"?",
                          HasSubstr("two.fixed: the param is not tunable"),
                          "two.k0: the param is changed twice"));
  EXPECT_EQ(values_of(*application)["three.k0"], "10");
  application->stop();
  EXPECT_EQ(result(*application, 2, "changes"), ReportValue(std::int64_t{0}));
}

TEST_P(ATransaction, BeforeTheStartIsInPlaceWhenComponentsStart) {
  const auto application = make_application(kThreeOfKnobs, classes_, clock());

  EXPECT_TRUE(application->change_params({{"two.k3", "99"}}).has_changed());

  application->start();
  application->stop();
  EXPECT_EQ(result(*application, 1, "knobs"), ReportValue(std::string("10 10 10 99 ")));
  EXPECT_EQ(result(*application, 1, "changes"), ReportValue(std::int64_t{0}))
      << "a component that has not started is not called";
}

TEST_P(ATransaction, AfterTheEndIsRefused) {
  const auto application = make_application(kThreeOfKnobs, classes_, clock());
  application->start();
  application->stop();

  EXPECT_FALSE(application->change_params({{"two.k3", "99"}}).has_changed());
  EXPECT_EQ(values_of(*application)["two.k3"], "10");
}

INSTANTIATE_TEST_SUITE_P(Clocks, ATransaction, ::testing::Bool(),
                         [](const auto& is_simulated) -> std::string {
                           return is_simulated.param ? "Simulated" : "Live";
                         });

// ---- Types ----

enum class Mode : std::uint8_t { kEco, kSport };

class AllTypes final : public Component {
 public:
  explicit AllTypes(Context& context)
      : Component(context),
        flag_(context.param<bool>("flag", {.fallback = false, .is_tunable = true})),
        gain_(context.param<double>("gain", {.min = 0.0,
                                             .max = 1.0,
                                             .unit = "1/s",
                                             .description = "how hard | it pulls",
                                             .is_tunable = true})),
        small_(context.param<std::uint8_t>("small", {.fallback = 3, .is_tunable = true})),
        label_(context.param<std::string>("label", {.fallback = "a", .is_tunable = true})),
        map_(context.param<Path>("map", {.fallback = Path("/m"), .is_tunable = true})),
        mode_(context.param<Mode>("drive.mode",
                                  {.fallback = Mode::kEco,
                                   .names = {{"eco", Mode::kEco}, {"sport", Mode::kSport}},
                                   .is_tunable = true})),
        list_(context.param<std::vector<double>>(
            "list", {.fallback = {{1.0}}, .min = 0.0, .is_tunable = true})),
        modes_(context.param<std::vector<Mode>>(
            "modes", {.fallback = std::vector<Mode>{},
                      .names = {{"eco", Mode::kEco}, {"sport", Mode::kSport}},
                      .is_tunable = true})),
        limit_(context.param<Int64Value>("limit", {.fallback = Int64Value(), .is_tunable = true})) {
  }

  [[nodiscard]] std::string text() const {
    std::string text = std::to_string(flag_.get()) + " " + std::to_string(gain_.get()) + " " +
                       std::to_string(small_.get()) + " " + label_.get() + " " +
                       map_.get().string() + " " + std::to_string(static_cast<int>(mode_.get()));
    for (const double item : list_.get()) {
      text += " " + std::to_string(item);
    }
    return text + " " + std::to_string(modes_.get().size()) + " " +
           std::to_string(limit_.get().value());
  }
  void stop() override { report("text", text()); }

 private:
  Param<bool> flag_;
  Param<double> gain_;
  Param<std::uint8_t> small_;
  Param<std::string> label_;
  Param<Path> map_;
  Param<Mode> mode_;
  Param<std::vector<double>> list_;
  Param<std::vector<Mode>> modes_;
  Param<Int64Value> limit_;
};

TEST(Params, OfEachTypeCanBeChanged) {
  testing::Bench bench;
  bench.add<AllTypes>("all", R"({"params": {"gain": 0.5}})");
  bench.start();

  const ParamsResult changed = bench.change_params({{"all.flag", param_json(true)},
                                                    {"all.gain", param_json(0.25)},
                                                    {"all.small", param_json(200)},
                                                    {"all.label", param_json("b \"c\"")},
                                                    {"all.map", "maps/town.osm"},
                                                    {"all.drive.mode", "\"sport\""},
                                                    {"all.list", "[2, 3.5]"},
                                                    {"all.modes", R"(["sport", "eco"])"},
                                                    {"all.limit", "\"12\""}});
  const ParamsResult refused = bench.change_params({{"all.drive.mode", "\"sprot\""},
                                                    {"all.flag", "1"},
                                                    {"all.list", "[1, -2, \"x\"]"},
                                                    {"all.limit", "{\"value\": {}}"},
                                                    {"all.small", "256"}});
  bench.stop();

  EXPECT_THAT(changed.errors, IsEmpty());
  EXPECT_EQ(
      bench.result("all", "text"),
      ReportValue(std::string("1 0.250000 200 b \"c\" maps/town.osm 1 2.000000 3.500000 2 12")));
  ASSERT_THAT(refused.errors, SizeIs(6));
  EXPECT_EQ(refused.errors[0],
            "all.drive.mode: expected one of \"eco\", \"sport\", found \"sprot\"; did you mean "
            "\"sport\"?");
  EXPECT_EQ(refused.errors[1], "all.flag: expected true or false, found 1");
  EXPECT_THAT(refused.errors[2], HasSubstr("all.limit: expected a message"));
  EXPECT_THAT(refused.errors[3], HasSubstr("expected a number of at least 0, found -2"));
  EXPECT_THAT(refused.errors[4], HasSubstr("expected a number of at least 0, found \"x\""));
  EXPECT_EQ(refused.errors[5], "all.small: expected an integer in [0, 255], found 256");
}

TEST(Params, AreListedWithAllThatIsKnownOfThem) {
  TestClasses classes;
  classes.with<AllTypes>("all");
  const auto application = make_application(
      "{\"name\": \"t\", \"components\": [\n"
      "{\"name\": \"all\", \"library\": \"all\",\n"
      " \"params\": {\"gain\": 0.5}}]}",
      classes, {.is_simulated = true});
  application->start();
  EXPECT_TRUE(application->change_params({{"all.label", "\"new\""}}).has_changed());

  const std::vector<ListedParam> params = list_params(*application);

  ASSERT_THAT(params, SizeIs(9));
  EXPECT_EQ(params[1].full_name(), "all.gain");
  EXPECT_EQ(params[1].type, "number");
  EXPECT_EQ(params[1].unit, "1/s");
  EXPECT_EQ(params[1].min, 0.0);
  EXPECT_EQ(params[1].max, 1.0);
  EXPECT_FALSE(params[1].has_fallback);
  EXPECT_EQ(params[1].value, 0.5);
  EXPECT_EQ(params[1].origin, "file");
  EXPECT_EQ(params[1].place.line, 3);
  EXPECT_EQ(params[1].place.pointer, "/components/0/params/gain");
  EXPECT_EQ(params[2].type, "integer");
  EXPECT_TRUE(params[2].min.is_null()) << "the limits of its type are not its author's";
  EXPECT_EQ(params[3].origin, "changed");
  EXPECT_EQ(params[3].value, "new");
  EXPECT_EQ(params[3].fallback, "a");
  EXPECT_THAT(params[5].names, ElementsAre("eco", "sport"));
  EXPECT_EQ(params[6].type, "number[]");
  EXPECT_EQ(params[8].type, "message google.protobuf.Int64Value");
  EXPECT_THAT(to_table(params), HasSubstr("all.gain"));
  EXPECT_THAT(to_table(params), HasSubstr("test.json:3"));
  EXPECT_THAT(to_markdown(params), HasSubstr("how hard \\| it pulls"));
  const auto json = nlohmann::json::parse(to_json(params));
  EXPECT_EQ(json[1]["max"], 1.0);
  EXPECT_EQ(json[1]["file"], "test.json");
  EXPECT_EQ(json[3]["from"], "changed");
  EXPECT_EQ(json[5]["default"], "eco");
}

TEST(Params, OfAnObjectThatIsNotKeptAreValues) {
  class Temporary final : public Component {
   public:
    explicit Temporary(Context& context)
        : Component(context), name_(context.param<std::string>("name").get()) {
      const Param<std::string> again = context.param<std::string>("name");
      Param<std::string> moved = context.param<std::string>("name");
      EXPECT_EQ(std::move(moved).get(), name_);
      EXPECT_EQ(again.get(), name_) << "one that is moved out takes nothing from the others";
    }
    void stop() override { report("name", name_); }

   private:
    std::string name_;
  };
  testing::Bench bench;
  bench.add<Temporary>("t", R"({"params": {"name": "a name that is not short at all"}})");
  bench.start();
  bench.stop();
  EXPECT_EQ(bench.result("t", "name"), ReportValue(std::string("a name that is not short at all")));
}

/// Lists the parameters of the application after it has changed one of another component.
class Exporter final : public Component {
 public:
  explicit Exporter(Context& context) : Component(context), source_(context.create_source()) {}

  void start() override {
    texts_.push_back(text_of_list());
    context().change_params({{"one.k2", "55"}}, [this](const ParamsResult& result) {
      EXPECT_TRUE(result.has_changed());
      texts_.push_back(text_of_list());
      source_.finish();
    });
  }

  void stop() override {
    report("before", texts_.at(0));
    report("after", texts_.at(1));
  }

 private:
  std::string text_of_list() {
    std::string text;
    for (const ParamInfo& info : list_params(context())) {
      text += info.param + " " + info.type + " " + info.json + " " + info.min_json + ".." +
              info.max_json + (info.is_tunable ? " tunable\n" : "\n");
    }
    return text;
  }

  Source source_;
  std::vector<std::string> texts_;
};

TEST(ParamChanges, AreInTheListThatAComponentAsksForAfterwards) {
  TestClasses classes;
  classes.with<Knobs>("knobs").with<Exporter>("exporter");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "one", "library": "knobs"},
        {"name": "exporter", "library": "exporter"}]})",
      classes, {.is_simulated = true});

  application->start();
  application->run(Duration(100ms));
  application->stop();

  const auto before = std::get<std::string>(result(*application, 1, "before"));
  const auto after = std::get<std::string>(result(*application, 1, "after"));
  EXPECT_THAT(before, HasSubstr("one.fixed integer 7 ..\n"));
  EXPECT_THAT(before, HasSubstr("one.k2 integer 10 0..100 tunable\n"));
  EXPECT_THAT(after, HasSubstr("one.k2 integer 55 0..100 tunable\n"));
}

// ---- Shared params ----

/// Reads a shared length, up to a limit of its own.
template <int kLimit>
class Reads final : public Component {
 public:
  explicit Reads(Context& context)
      : Component(context),
        length_(context.param<double>("length", {.max = kLimit, .is_tunable = true})) {}
  void stop() override { report("length", length_.get()); }

 private:
  Param<double> length_;
};

TEST(SharedParams, AreChangedInAllThatReadThemIfAllCanTakeTheValue) {
  TestClasses classes;
  classes.with<Reads<5>>("short").with<Reads<9>>("long");
  const auto application = make_application(
      R"({"name": "t", "shared_params": {"length": 2}, "components": [
        {"name": "short", "library": "short"}, {"name": "long", "library": "long"},
        {"name": "own", "library": "short", "params": {"length": 1}}]})",
      classes, {.is_simulated = true});
  application->start();

  EXPECT_THAT(application->change_params({{"shared_params.length", "7"}}).errors,
              ElementsAre("shared_params.length of component \"short\": expected a number of at "
                          "most 5, found 7"));
  EXPECT_EQ(values_of(*application)["long.length"], "2.0");
  EXPECT_TRUE(application->change_params({{"shared_params.length", "4"}}).has_changed());
  EXPECT_EQ(list_params(*application)[0].origin, "shared");

  // From then on it is its own.
  EXPECT_TRUE(application->change_params({{"long.length", "8"}}).has_changed());
  EXPECT_TRUE(application->change_params({{"shared_params.length", "3"}}).has_changed());
  application->stop();

  EXPECT_EQ(result(*application, 0, "length"), ReportValue(3.0));
  EXPECT_EQ(result(*application, 1, "length"), ReportValue(8.0));
  EXPECT_EQ(result(*application, 2, "length"), ReportValue(1.0));
}

// ---- Checks over several parameters ----

class Band final : public Component {
 public:
  explicit Band(Context& context)
      : Component(context),
        low_(context.param<double>("low", {.fallback = 1.0, .is_tunable = true})),
        high_(context.param<double>("high", {.fallback = 2.0, .is_tunable = true})) {
    context.check_params([low = low_, high = high_](const ProposedParams& params) {
      return params.get(low) < params.get(high) ? std::string() : "low must be below high";
    });
  }
  void stop() override { report("sum", low_.get() + high_.get()); }

 private:
  Param<double> low_;
  Param<double> high_;
};

TEST(ACheckOfParams, SeesWhatTheyWouldBeTogether) {
  testing::Bench bench;
  bench.add<Band>("band");
  bench.start();

  EXPECT_THAT(bench.change_params({{"band.low", "3"}}).errors,
              ElementsAre("band: low must be below high"));
  EXPECT_TRUE(bench.change_params({{"band.low", "3"}, {"band.high", "4"}}).has_changed());
  EXPECT_FALSE(bench.change_params({{"band.high", "2.5"}}).has_changed());
  bench.stop();

  EXPECT_EQ(bench.result("band", "sum"), ReportValue(7.0));
}

TEST(ACheckOfParams, LooksAtTheConfiguredOnesToo) {
  TestClasses classes;
  classes.with<Band>("band");
  EXPECT_THAT(
      [&] {
        static_cast<void>(make_application(R"({"name": "t", "components": [
          {"name": "band", "library": "band", "params": {"low": 5}}]})",
                                           classes, {.is_simulated = true}));
      },
      ::testing::ThrowsMessage<std::runtime_error>(
          HasSubstr("component \"band\": low must be below high")));
}

TEST(OnChange, OfAParamThatIsNotTunableIsAnError) {
  class Waits final : public Component {
   public:
    explicit Waits(Context& context) : Component(context) {
      context.on_change(context.param<bool>("on", {.fallback = true}), [] {});
    }
  };
  TestClasses classes;
  classes.with<Waits>("waits");
  EXPECT_THAT(
      [&] {
        static_cast<void>(
            make_application(R"({"name": "t", "components": [{"name": "w", "library": "waits"}]})",
                             classes, {.is_simulated = true}));
      },
      ::testing::ThrowsMessage<std::runtime_error>(
          HasSubstr("waits for changes of its param \"on\", which is not declared as tunable")));
}

// ---- Activations ----

/// Wants its two values to be equal, and says so if they are not.
class Follower final : public Component {
 public:
  explicit Follower(Context& context)
      : Component(context),
        left_(context.param<std::int64_t>("left", {.fallback = 0, .is_tunable = true})),
        right_(context.param<std::int64_t>("right", {.fallback = 0, .is_tunable = true})) {
    context.on_change(left_, [this](const std::int64_t& left) {
      EXPECT_EQ(left, right_.get()) << "all is in place when the first is called back";
      if (left == 13) {
        throw std::runtime_error("not this one");
      }
      changes_ += std::to_string(left) + " ";
    });
    context.create_subscriber<Int64Value>(
        "fail", [](const Int64Value&) { throw std::runtime_error("asked to"); });
  }
  void start() override {
    began_with_ = left_.get();
    EXPECT_EQ(left_.get(), right_.get());
  }
  void stop() override {
    report("left", left_.get());
    report("began_with", began_with_);
    report("changes", changes_);
  }

 private:
  Param<std::int64_t> left_;
  Param<std::int64_t> right_;
  std::int64_t began_with_ = -1;
  std::string changes_;
};

std::vector<ParamChange> both(std::int64_t value, const std::string& component = "follower") {
  return {{component + ".left", param_json(value)}, {component + ".right", param_json(value)}};
}

TEST(AChangedParam, IsPutInPlaceByAnActivationWithTheCauseParameter) {
  TestClasses classes;
  classes.with<Follower>("follower");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "follower", "library": "follower"}]})", classes,
      {.is_simulated = true, .workers = 1});
  application->start();
  EXPECT_TRUE(application->change_params(both(4)).has_changed());
  EXPECT_TRUE(application->change_params(both(5)).has_changed());
  application->settle();

  int count = 0;
  for (const detail::ActivationRecord& record : application->time().rings()[0]->snapshot()) {
    count += record.cause == detail::Cause::kParameter ? 1 : 0;
  }
  EXPECT_EQ(count, 2);
  application->stop();
  EXPECT_EQ(result(*application, 0, "changes"), ReportValue(std::string("4 5 ")));
}

TEST(AChangedParam, OutlivesARestartOfItsComponent) {
  testing::Bench bench;
  bench.add<Follower>("follower", R"({"on_fault": "restart", "params": {"left": 1, "right": 1}})");
  auto fail = bench.input<Int64Value>("fail");
  bench.start();
  EXPECT_TRUE(bench.change_params(both(8)).has_changed());

  fail.publish(Int64Value());
  EXPECT_TRUE(bench.change_params(both(9)).has_changed());
  bench.stop();

  EXPECT_EQ(bench.result("follower", "began_with"), ReportValue(std::int64_t{8}));
  EXPECT_EQ(bench.result("follower", "left"), ReportValue(std::int64_t{9}));
  EXPECT_EQ(bench.result("follower", "changes"), ReportValue(std::string("9 ")))
      << "the new object is called back, and only once";
}

TEST(AChangedParam, WhoseCallbackThrowsIsAFaultOfItsComponent) {
  testing::Bench bench;
  bench.add<Follower>("follower", R"({"on_fault": "restart"})");
  bench.start();

  EXPECT_TRUE(bench.change_params(both(13)).has_changed());
  bench.stop();

  ASSERT_THAT(bench.faults("follower"), SizeIs(1));
  EXPECT_THAT(bench.faults("follower")[0],
              HasSubstr("its callback for a change of \"left\" threw: not this one"));
  EXPECT_EQ(bench.result("follower", "began_with"), ReportValue(std::int64_t{13}));
}

// ---- Changes that components ask for ----

/// At its second tick asks for a change of everybody, at its third for one that is wrong.
class Supervisor final : public Component {
 public:
  explicit Supervisor(Context& context) : Component(context) {}
  void serve() override {
    ++ticks_;
    if (ticks_ != 2 && ticks_ != 3) {
      return;
    }
    std::vector<ParamChange> changes;
    for (const char* name : {"f0", "f1", "f2", "f3"}) {
      for (const ParamChange& change : both(100 * ticks_, name)) {
        changes.push_back(change);
      }
    }
    if (ticks_ == 3) {
      changes.push_back({"f1.middle", "1"});
    }
    context().change_params(changes, [this](const ParamsResult& result) {
      results_ += result.has_changed() ? "done " : result.errors.at(0);
    });
  }
  void stop() override { report("results", results_); }

 private:
  int ticks_ = 0;
  std::string results_;
};

/// Mixes what it sees of its parameters at each tick, and in the round after that.
class Mixer final : public Component {
 public:
  explicit Mixer(Context& context)
      : Component(context),
        left_(context.param<std::int64_t>("left", {.fallback = 1, .is_tunable = true})),
        right_(context.param<std::int64_t>("right", {.fallback = 1, .is_tunable = true})),
        out_(context.create_publisher<Int64Value>("out")) {
    context.on_change(right_, [this] { mix("change "); });
    context.create_subscriber<Int64Value>("in", [this](const Int64Value& other) {
      mix("at " + std::to_string((now() - start_time()) / 1ms) + " ms next to " +
          std::to_string(other.value()) + ": ");
    });
  }
  void serve() override {
    const auto end = std::chrono::steady_clock::now() + 100us;  // Worth waking helpers for.
    while (std::chrono::steady_clock::now() < end) {
    }
    mix("tick ");
    auto out = out_.loan();
    out->set_value(left_.get());
    out_.publish(std::move(out));
  }
  void stop() override { report("mixed", mixed_); }

 private:
  void mix(const std::string& when) {
    mixed_ += when + std::to_string(left_.get()) + " " + std::to_string(right_.get()) + "\n";
  }

  Param<std::int64_t> left_;
  Param<std::int64_t> right_;
  Publisher<Int64Value> out_;
  std::string mixed_;
};

constexpr const char* kSupervised = R"({"name": "t", "components": [
  {"name": "f0", "library": "mixer", "serve_period_ms": 1, "remap": {"out": "a", "in": "d"}},
  {"name": "f1", "library": "mixer", "serve_period_ms": 1, "remap": {"out": "b", "in": "a"}},
  {"name": "supervisor", "library": "supervisor", "serve_period_ms": 2},
  {"name": "f2", "library": "mixer", "serve_period_ms": 1, "remap": {"out": "c", "in": "b"}},
  {"name": "f3", "library": "mixer", "serve_period_ms": 1, "remap": {"out": "d", "in": "c"}}]})";

TEST(ASupervisor, ChangesParamsOfAllInTheNextRoundWithAnyNumberOfWorkers) {
  TestClasses classes;
  classes.with<Mixer>("mixer").with<Supervisor>("supervisor");
  std::vector<std::vector<ReportValue>> results;
  for (const unsigned workers : {1U, 2U, 4U, 4U}) {
    const auto application =
        make_application(kSupervised, classes, {.is_simulated = true, .workers = workers});
    application->start();
    application->run(Duration(12ms));
    application->stop();
    results.emplace_back();
    for (const std::size_t i : {0U, 1U, 3U, 4U}) {
      results.back().push_back(result(*application, i, "mixed"));
    }
    EXPECT_EQ(result(*application, 2, "results"),
              ReportValue(std::string("done f1.middle: there is no param \"middle\"")));
  }

  // The ticks of 4 ms still see the old value, also those that are served after the supervisor;
  // the messages of that moment come a round later, and see the new one.
  const std::string seen = std::get<std::string>(results[0][0]);
  EXPECT_THAT(seen, HasSubstr("at 3 ms next to 1: 1 1\ntick 1 1\nchange 200 200\n"
                              "at 4 ms next to 1: 200 200\ntick 200 200\n"
                              "at 5 ms next to 200: 200 200\n"));
  for (const ReportValue& other : results[0]) {
    EXPECT_EQ(other, results[0][0]);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
  EXPECT_EQ(results[2], results[3]);
}

TEST(ASupervisor, IsNotifiedLiveWhatBecameOfItsChange) {
  class Asker final : public Component {
   public:
    explicit Asker(Context& context) : Component(context), source_(context.create_source()) {}
    void serve() override {
      if (asked_) {
        return;
      }
      asked_ = true;
      context().change_params({{"one.k0", "1"}, {"two.k0", "2"}}, [this](const ParamsResult& good) {
        report("good", good.has_changed());
        context().change_params({{"one.k0", "1000"}, {"two.k0", "3"}},
                                [this](const ParamsResult& bad) {
                                  report("bad", bad.errors.at(0));
                                  source_.finish();
                                });
      });
    }

   private:
    Source source_;
    bool asked_ = false;
  };
  TestClasses classes;
  classes.with<Knobs>("knobs").with<Asker>("asker");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "one", "library": "knobs"},
        {"name": "asker", "library": "asker", "serve_period_ms": 1},
        {"name": "two", "library": "knobs"}]})",
      classes);
  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();

  EXPECT_EQ(result(*application, 1, "good"), ReportValue(true));
  EXPECT_EQ(result(*application, 1, "bad"),
            ReportValue(std::string("one.k0: expected an integer in [0, 100], found 1000")));
  EXPECT_EQ(result(*application, 2, "knobs"), ReportValue(std::string("2 10 10 10 ")));
}

// ---- Many reads ----

constexpr int kReadersPerRun = 4;
constexpr std::int64_t kReadsEach = 250'000;

/// Reads its parameters again and again in each tick: none may change within it, and the two that
/// are changed together must always be equal.
class Reader final : public Component {
 public:
  explicit Reader(Context& context)
      : Component(context),
        first_(context.param<std::int64_t>("first", {.fallback = 0, .is_tunable = true})),
        label_(context.param<std::string>("label", {.fallback = "0", .is_tunable = true})),
        second_(context.param<std::int64_t>("second", {.fallback = 0, .is_tunable = true})),
        source_(context.create_source()) {
    context.on_change(second_, [this](const std::int64_t& second) {
      EXPECT_FALSE(is_inside_);
      is_inside_ = true;
      seen_.push_back(second);
      wrong_ += label_.get() == std::to_string(second) && first_.get() == second ? 0 : 1;
      is_inside_ = false;
    });
  }

  void serve() override {
    EXPECT_FALSE(is_inside_);
    is_inside_ = true;
    const std::int64_t first = first_.get();
    const std::string& label = label_.get();
    const std::string before = label;
    for (int i = 0; i < 2000; ++i) {
      wrong_ += first_.get() == first && second_.get() == first ? 0 : 1;
      reads_ += 2;
    }
    wrong_ += label == before && label == std::to_string(first) ? 0 : 1;
    is_inside_ = false;
    if (reads_ >= kReadsEach) {
      source_.finish();
    }
  }

  void stop() override {
    report("reads", reads_);
    report("wrong", wrong_);
    std::string text;
    for (const std::int64_t value : seen_) {
      text += std::to_string(value) + " ";
    }
    report("seen", text);
    report("changes", static_cast<std::int64_t>(seen_.size()));
  }

 private:
  Param<std::int64_t> first_;
  Param<std::string> label_;
  Param<std::int64_t> second_;
  Source source_;
  bool is_inside_ = false;  // Plain: what overlapped would race.
  std::int64_t reads_ = 0;
  std::int64_t wrong_ = 0;
  std::vector<std::int64_t> seen_;
};

std::vector<ParamChange> for_all_readers(std::int64_t value) {
  std::vector<ParamChange> changes;
  for (int i = 0; i < kReadersPerRun; ++i) {
    const std::string component = "reader" + std::to_string(i);
    changes.push_back({component + ".first", std::to_string(value)});
    changes.push_back({component + ".label", param_json(std::to_string(value))});
    changes.push_back({component + ".second", std::to_string(value)});
  }
  return changes;
}

/// Runs readers while two threads change their parameters.
void read_while_changing(const ClockOptions& clock) {
  TestClasses classes;
  classes.with<Reader>("reader");
  std::string text = R"({"name": "t", "executors": [
      {"name": "left", "threads": 2}, {"name": "right", "threads": 2}], "components": [)";
  for (int i = 0; i < kReadersPerRun; ++i) {
    text += (i == 0 ? "" : ",") + std::string(R"({"name": "reader)") + std::to_string(i) +
            R"(", "library": "reader", "serve_period_ms": 1, "executor": ")" +
            (i % 2 == 0 ? "left" : "right") + "\"}";
  }
  const auto application = make_application(text + "]}", classes, clock);
  application->start();
  std::atomic<std::int64_t> made{0};
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 2; ++thread) {
    threads.emplace_back([&application, &made] {
      do {
        const std::int64_t number = made.fetch_add(1) + 1;
        EXPECT_TRUE(application->change_params(for_all_readers(number)).has_changed());
        auto wrong = for_all_readers(0);
        wrong[7].json = "true";
        EXPECT_THAT(application->change_params(wrong).errors, SizeIs(1));
        // Simulated time must not be kept from going on.
        const Time now = application->clock().now();
        while (application->clock().now() == now && application->end_reason() == EndReason::kNone) {
          std::this_thread::yield();
        }
      } while (application->end_reason() == EndReason::kNone);
    });
  }
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  threads.clear();  // Joins.
  application->stop();

  std::int64_t reads = 0;
  for (std::size_t i = 0; i < kReadersPerRun; ++i) {
    reads += std::get<std::int64_t>(result(*application, i, "reads"));
    EXPECT_EQ(result(*application, i, "wrong"), ReportValue(std::int64_t{0}));
    EXPECT_EQ(result(*application, i, "changes"), ReportValue(made.load()));
    EXPECT_EQ(result(*application, i, "seen"), result(*application, 0, "seen"))
        << "all see the transactions in the same order";
  }
  EXPECT_GE(reads, 1'000'000);
}

TEST(ManyParameterReads, SeeConstantsWithinAnActivationAndPairsThatWereSetTogether) {
  read_while_changing({});
}

TEST(ManyParameterReads, SeeTheSameInSimulatedTimeWhileOtherThreadsChangeThem) {
  read_while_changing({.is_simulated = true, .workers = 4});
}

}  // namespace
}  // namespace fastcycle::host
