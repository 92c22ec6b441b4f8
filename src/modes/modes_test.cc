#include "modes/modes.h"

#include <array>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using detail::ComponentCore;
using detail::DropReason;
using google::protobuf::Int64Value;
using namespace std::chrono_literals;
using State = ComponentCore::State;

template <typename Condition>
void wait_until(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!condition()) {
    ASSERT_LT(std::chrono::steady_clock::now(), limit) << "the condition never came true";
    std::this_thread::yield();
  }
}

std::uint64_t dropped(const detail::Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

/// What components of one test write down, in the order in which it happened.
class Diary {
 public:
  void clear() {
    const std::lock_guard lock(mutex_);
    lines_.clear();
  }
  void write(const std::string& line) {
    const std::lock_guard lock(mutex_);
    lines_.push_back(line);
  }
  [[nodiscard]] std::vector<std::string> lines() {
    const std::lock_guard lock(mutex_);
    return lines_;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> lines_;
};

Diary g_diary;
std::atomic<bool> g_may_go{false};

/// Writes its life down.
class Probe final : public Component {
 public:
  explicit Probe(Context& its_context)
      : Component(its_context),
        waits_(its_context.param<bool>("waits", {.fallback = false})),
        fault_ms_(its_context.param<std::int64_t>("fault_ms", {.fallback = 0})) {
    if (fault_ms_.get() > 0) {
      its_context.create_timer({.period = std::chrono::milliseconds(fault_ms_.get())},
                               [this] { fault(); });
    }
  }

  void start() override {
    note("start");
    while (waits_.get() && !g_may_go) {
      std::this_thread::yield();
    }
  }
  void activate() override { note("activate"); }
  void deactivate() override { note("deactivate"); }
  void stop() override { note("stop"); }

 private:
  void note(const std::string& what) { g_diary.write(context().component_name() + " " + what); }
  void fault() {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now() - start_time());
    g_diary.write(fmt::format("{} faults at {}", context().component_name(), ms.count()));
    throw std::runtime_error("on purpose");
  }

  Param<bool> waits_;
  Param<std::int64_t> fault_ms_;
};

/// How many controllers are active, and whether there ever were two.
struct Controllers {
  std::atomic<int> active{0};
  std::atomic<int> clashes{0};

  void clear() {
    active = 0;
    clashes = 0;
  }
};

Controllers g_controllers;

/// Turns each number into a command, as long as it is active.
class Controller final : public Component {
 public:
  explicit Controller(Context& context)
      : Component(context), commands_(context.create_publisher<Int64Value>("commands")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      g_controllers.clashes += is_active_ ? 0 : 1;
      publish(number.value());
    });
  }

  void activate() override {
    g_controllers.clashes += g_controllers.active.fetch_add(1) != 0 ? 1 : 0;
    is_active_ = true;
  }
  void deactivate() override {
    publish(-1);  // Its last word.
    is_active_ = false;
    g_controllers.active.fetch_sub(1);
  }
  void stop() override { publish(-2); }

 private:
  void publish(std::int64_t value) {
    auto loan = commands_.loan();
    loan->set_value(value);
    commands_.publish(std::move(loan));
  }

  Publisher<Int64Value> commands_;
  bool is_active_ = false;
};

/// Publishes a number each time that its Serve Timer ticks, and switches the mode at some of them.
class Driver final : public Component {
 public:
  explicit Driver(Context& context)
      : Component(context),
        numbers_(context.create_publisher<Int64Value>("numbers")),
        switch_at_(context.param<std::vector<std::int64_t>>(
            "switch_at", {.fallback = std::vector<std::int64_t>()})),
        modes_(context.param<std::vector<std::string>>("modes",
                                                       {.fallback = std::vector<std::string>()})) {}

  void serve() override {
    auto loan = numbers_.loan();
    loan->set_value(++count_);
    numbers_.publish(std::move(loan));
    for (std::size_t i = 0; i < switch_at_.get().size(); ++i) {
      if (switch_at_.get()[i] == count_) {
        context().switch_mode(modes_.get()[i], fmt::format("number {}", count_));
      }
    }
  }

 private:
  Publisher<Int64Value> numbers_;
  Param<std::vector<std::int64_t>> switch_at_;
  Param<std::vector<std::string>> modes_;
  std::int64_t count_ = 0;
};

/// Keeps what commands came, from whom and when.
class Actuator final : public Component {
 public:
  struct Command {
    PublisherId publisher = 0;
    Time published{};
    std::int64_t value = 0;
  };

  explicit Actuator(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>(
        "commands", {.depth = 1024}, [this](const Sample<Int64Value>& command) {
          commands.push_back(
              {command.info().publisher, command.info().publish_time, command->value()});
        });
  }

  std::vector<Command> commands;
};

constexpr const char* kTwoControllers = R"({"name": "test",
  "modes": {"nominal": {"components": ["planner"]}, "degraded": {"components": ["fallback"]}},
  "initial_mode": "nominal",
  "topics": {"commands": {"multiple_publishers": true}},
  "components": [
    {"name": "driver", "library": "driver", "serve_period_ms": 1,
     "params": {"switch_at": [3, 6], "modes": ["degraded", "nominal"]}},
    {"name": "planner", "library": "controller"},
    {"name": "fallback", "library": "controller"},
    {"name": "actuator", "library": "actuator"}]})";

class ControllerClasses : public TestClasses {
 public:
  ControllerClasses() {
    g_controllers.clear();
    with<Driver>("driver").with<Controller>("controller").with<Actuator>("actuator");
  }
};

ComponentCore& core_of(const Application& application, const std::string& name) {
  for (const auto& component : application.components()) {
    if (component->name == name) {
      return *component;
    }
  }
  throw std::runtime_error("no component " + name);
}

std::vector<Actuator::Command> commands_of(const Application& application) {
  return static_cast<Actuator*>(core_of(application, "actuator").component)->commands;
}

std::vector<std::int64_t> values_of(const Application& application, const std::string& component) {
  const auto id = core_of(application, component).declared.publishers.at(0)->id;
  std::vector<std::int64_t> values;
  for (const Actuator::Command& command : commands_of(application)) {
    if (command.publisher == id) {
      values.push_back(command.value);
    }
  }
  return values;
}

TEST(AMode, SaysWhoIsActiveInIt) {
  using Values = std::vector<std::int64_t>;
  for (const unsigned workers : {1U, 2U, 4U}) {
    ControllerClasses classes;
    const auto application =
        make_application(kTwoControllers, classes, {.is_simulated = true, .workers = workers});
    application->start();
    EXPECT_EQ(core_of(*application, "planner").state, State::kActive);
    EXPECT_EQ(core_of(*application, "fallback").state, State::kStandby);

    application->run(8ms);

    // The switch takes effect in the next round: number 3, published in the round before, is lost
    // to both, and counted.
    EXPECT_EQ(values_of(*application, "planner"), (Values{1, 2, -1, 7, 8}));
    EXPECT_EQ(values_of(*application, "fallback"), (Values{4, 5, -1}));
    application->stop();
    EXPECT_EQ(g_controllers.clashes, 0);
    const auto planner = ledger_of(*application, "numbers", "planner");
    EXPECT_EQ(planner.delivered, 4U);
    EXPECT_EQ(dropped(planner, DropReason::kInactive), 4U);
    EXPECT_TRUE(planner.adds_up());
    const auto fallback = ledger_of(*application, "numbers", "fallback");
    EXPECT_EQ(fallback.delivered, 2U);
    EXPECT_EQ(dropped(fallback, DropReason::kInactive), 6U);
    EXPECT_TRUE(fallback.adds_up());
    // What it published in `stop` nobody received, since it was not active then.
    EXPECT_EQ(core_of(*application, "fallback").declared.publishers.at(0)->muted(), 1U);

    const RunReport report = make_report(*application, 1s);
    EXPECT_EQ(report.modes->at_end, "nominal");
    ASSERT_EQ(report.modes->switches.size(), 2U);
    EXPECT_EQ(report.modes->switches[0].time_s, 0.003);
    EXPECT_EQ(report.modes->switches[0].from, "nominal");
    EXPECT_EQ(report.modes->switches[0].to, "degraded");
    EXPECT_EQ(report.modes->switches[0].why, "number 3");
    EXPECT_EQ(report.modes->switches[0].by, "driver");
    const auto json = to_json(report);
    for (const char* name : {"planner", "fallback", "driver"}) {
      EXPECT_EQ(json["components"][name]["state"], "stopped") << name;
    }
    EXPECT_EQ(json["components"]["planner"]["was_active"], true);
    EXPECT_EQ(json["components"]["fallback"]["was_active"], false);
    EXPECT_FALSE(json["components"]["driver"].contains("was_active"));
    EXPECT_EQ(json["modes"]["switches"][1]["to"], "nominal");
    EXPECT_NE(to_table(report).find("MODE nominal at the end, after 2 switches"),
              std::string::npos);
  }
}

TEST(AMode, IsAskedForFromOutsideToo) {
  ControllerClasses classes;
  const auto application = make_application(kTwoControllers, classes, {.is_simulated = true});
  EXPECT_THROW(application->switch_mode("nowhere"), std::invalid_argument);
  application->switch_mode("degraded", "before the start");
  application->start();
  application->run(1ms);
  EXPECT_EQ(application->modes().current(), "degraded");
  EXPECT_EQ(core_of(*application, "fallback").state, State::kActive);
  application->stop();
  ASSERT_EQ(application->modes().switches().size(), 1U);
  EXPECT_EQ(application->modes().switches()[0].why, "before the start");
  EXPECT_EQ(application->modes().switches()[0].by, "");
}

TEST(AMode, NamesComponentsByPatternsAndByExecutors) {
  TestClasses classes;
  classes.with<Probe>("w");
  g_diary.clear();
  const auto application = make_application(R"({"name": "test",
    "executors": [{"name": "fast"}],
    "modes": {"one": {"components": ["front/**"]}, "two": {"executors": ["fast"]}, "none": {}},
    "initial_mode": "one",
    "components": [{"name": "a", "namespace": "front", "library": "w"},
                   {"name": "b", "namespace": "front/far", "library": "w", "executor": "fast"},
                   {"name": "c", "library": "w", "executor": "fast"},
                   {"name": "d", "library": "w"}]})",
                                            classes, {.is_simulated = true});
  application->start();
  const auto states = [&] {
    std::string text;
    for (const auto& component : application->components()) {
      text += component->state == State::kActive ? 'x' : '-';
    }
    return text;
  };
  EXPECT_EQ(states(), "xx-x");
  application->switch_mode("two");
  application->settle();
  EXPECT_EQ(states(), "-xxx");
  application->switch_mode("none");
  application->settle();
  EXPECT_EQ(states(), "---x");
  application->stop();
}

std::vector<std::string> errors_of(std::string_view text, TestClasses& classes) {
  config::Problems problems;
  Application application(describe_text(text, problems), {.is_simulated = true});
  application.build(classes, problems, ConstructorFault::kFault);
  std::vector<std::string> texts;
  for (const config::Problem& problem : problems.all()) {
    texts.push_back(problem.message + (problem.hint.empty() ? "" : "; " + problem.hint));
  }
  return texts;
}

TEST(AMode, ThatNamesNobodyIsAnError) {
  TestClasses classes;
  classes.with<Probe>("w");
  const auto errors = errors_of(R"({"name": "test",
    "modes": {"one": {"components": ["plannr", "x/*"], "executors": ["fsat"]}},
    "initial_mode": "on",
    "executors": [{"name": "fast"}],
    "components": [{"name": "planner", "library": "w", "executor": "fast",
                    "fault_mode": "oen"}]})",
                                classes);
  const std::vector<std::string> expected = {
      R"(the mode "one" names the component "plannr", which does not exist; did you mean "planner"?)",
      R"(the mode "one" names no component by the pattern "x/*")",
      R"(the mode "one" names the executor "fsat", which does not exist; did you mean "fast"?)",
      R"(there is no mode "on"; did you mean "one"?)",
      R"(there is no mode "oen"; did you mean "one"?)"};
  EXPECT_EQ(errors, expected);
}

TEST(AMode, HasComponentsKeepTheLastLatchedMessages) {
  struct Map final : Component {
    explicit Map(Context& its_context)
        : Component(its_context), maps(its_context.create_publisher<Int64Value>("map")) {}
    void serve() override {
      auto loan = maps.loan();
      loan->set_value(++count);
      maps.publish(std::move(loan));
    }
    Publisher<Int64Value> maps;
    std::int64_t count = 0;
  };
  struct Reader final : Component {
    explicit Reader(Context& its_context) : Component(its_context) {
      its_context.create_subscriber<Int64Value>(
          "map", [this](const Int64Value& map) { seen.push_back(map.value()); });
    }
    std::vector<std::int64_t> seen;
  };
  TestClasses classes;
  classes.with<Map>("map").with<Reader>("reader");
  const auto application = make_application(R"({"name": "test",
    "modes": {"off": {}, "on": {"components": ["reader"]}}, "initial_mode": "off",
    "topics": {"map": {"latched": 2}},
    "components": [{"name": "map", "library": "map", "serve_period_ms": 10},
                   {"name": "reader", "library": "reader"}]})",
                                            classes, {.is_simulated = true});
  application->start();
  application->advance_to(application->start_time() + 55ms);
  application->switch_mode("on");
  application->settle();
  application->advance_to(application->start_time() + 65ms);
  const auto& reader = *static_cast<Reader*>(core_of(*application, "reader").component);
  EXPECT_EQ(reader.seen, (std::vector<std::int64_t>{4, 5, 6}));
  application->stop();
  const auto ledger = ledger_of(*application, "map", "reader");
  EXPECT_EQ(dropped(ledger, DropReason::kInactive), 3U);
  EXPECT_TRUE(ledger.adds_up());
}

// ---- Starts ----

TEST(AStart, ComesAfterThoseThatTheFileNames) {
  for (const bool is_simulated : {true, false}) {
    TestClasses classes;
    classes.with<Probe>("w");
    g_diary.clear();
    const auto application = make_application(R"({"name": "test",
      "components": [{"name": "a", "library": "w", "after": ["x/c"]},
                     {"name": "b", "library": "w"},
                     {"name": "c", "namespace": "x", "library": "w", "after": ["d", "/b"]},
                     {"name": "d", "namespace": "x", "library": "w"}]})",
                                              classes, {.is_simulated = is_simulated});
    application->start();
    if (is_simulated) {
      application->settle();
    }
    application->stop();
    std::vector<std::string> order;
    for (const std::string& line : g_diary.lines()) {
      if (line.ends_with("start") || line.ends_with("stop")) {
        order.push_back(line);
      }
    }
    EXPECT_EQ(order, (std::vector<std::string>{"b start", "x/d start", "x/c start", "a start",
                                               "a stop", "x/c stop", "x/d stop", "b stop"}));
  }
}

TEST(AStart, ThatWaitsForItselfIsAnErrorWithItsWay) {
  TestClasses classes;
  classes.with<Probe>("w");
  const auto errors = errors_of(R"({"name": "test",
    "components": [{"name": "a", "library": "w", "after": ["c"]},
                   {"name": "b", "library": "w", "after": ["a", "loclization"]},
                   {"name": "c", "library": "w", "after": ["b"]},
                   {"name": "localization", "library": "w"}]})",
                                classes);
  const std::vector<std::string> expected = {
      "components start after each other: \"a\" after \"c\" after \"b\" after \"a\"",
      "there is no component \"loclization\" to start after; did you mean \"localization\"?"};
  EXPECT_EQ(errors, expected);
}

TEST(AStart, ThatTakesTooLongIsAFaultOfItsComponent) {
  TestClasses classes;
  classes.with<Probe>("w");
  g_diary.clear();
  g_may_go = false;
  const auto application = make_application(R"({"name": "test", "start_timeout_ms": 60000,
    "executors": [{"name": "one"}, {"name": "two"}],
    "components": [{"name": "slow", "library": "w", "executor": "one", "start_timeout_ms": 5,
                    "params": {"waits": true}},
                   {"name": "other", "library": "w", "executor": "two", "after": ["slow"]}]})",
                                            classes);
  application->start();
  EXPECT_EQ(core_of(*application, "other").state, State::kActive);
  EXPECT_EQ(core_of(*application, "slow").state, State::kConstructed);
  g_may_go = true;
  wait_until([&] { return core_of(*application, "slow").state == State::kFailed; });
  application->stop();
  EXPECT_EQ(core_of(*application, "slow").faults,
            (std::vector<std::string>{"its start() takes longer than 5 ms"}));
  EXPECT_TRUE(core_of(*application, "other").faults.empty());
}

TEST(AStart, ThatTakesTooLongEndsARunWhosePolicySaysSo) {
  TestClasses classes;
  classes.with<Probe>("w");
  g_diary.clear();
  g_may_go = false;
  const auto application = make_application(R"({"name": "test", "on_fault": "stop",
    "components": [{"name": "slow", "library": "w", "start_timeout_ms": 1,
                    "params": {"waits": true}},
                   {"name": "other", "library": "w"}]})",
                                            classes);
  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kFault);
  g_may_go = true;
  application->stop();
  EXPECT_EQ(g_diary.lines(), (std::vector<std::string>{"slow start"}));
}

// ---- Restarts ----

TEST(ARestart, BacksOffExactlyAndEndsAtItsLimit) {
  for (const unsigned workers : {1U, 2U, 4U}) {
    TestClasses classes;
    classes.with<Probe>("w");
    g_diary.clear();
    const auto application = make_application(R"({"name": "test", "on_fault": "restart",
      "restart": {"limit": 4, "back_off_ms": 50},
      "modes": {"nominal": {"components": ["w"]}, "degraded": {}}, "initial_mode": "nominal",
      "components": [{"name": "w", "library": "w", "restart": {"back_off_max_ms": 150},
                      "fault_mode": "degraded", "params": {"fault_ms": 10}}]})",
                                              classes, {.is_simulated = true, .workers = workers});
    application->start();
    application->run(10s);
    std::vector<std::string> faults;
    for (const std::string& line : g_diary.lines()) {
      if (line.find("faults") != std::string::npos) {
        faults.push_back(line);
      }
    }
    // 10 ms after it is active: 10, then after 50, 100, 150 and 150 ms.
    EXPECT_EQ(faults,
              (std::vector<std::string>{"w faults at 10", "w faults at 70", "w faults at 180",
                                        "w faults at 340", "w faults at 500"}));
    EXPECT_EQ(core_of(*application, "w").faults,
              (std::vector<std::string>{
                  "a timer threw: on purpose (restarting in 50 ms)",
                  "a timer threw: on purpose (restarting in 100 ms)",
                  "a timer threw: on purpose (restarting in 150 ms)",
                  "a timer threw: on purpose (restarting in 150 ms)",
                  "a timer threw: on purpose (restarted 4 times within 10 s: it stays stopped)"}));
    EXPECT_EQ(application->modes().current(), "degraded");
    application->stop();
    ASSERT_EQ(application->modes().switches().size(), 1U);
    const ModeSwitch made = application->modes().switches()[0];
    EXPECT_EQ(made.by, "w");
    EXPECT_EQ(made.stamp, application->start_time() + 500ms);
  }
}

TEST(ARestart, DropsWhatComesWhileItWaitsAndMayBeSwitchedMeanwhile) {
  struct Once final : Component {
    explicit Once(Context& its_context) : Component(its_context) {
      its_context.create_subscriber<Int64Value>("numbers", [](const Int64Value& number) {
        if (number.value() == 2) {
          throw std::runtime_error("two");
        }
      });
    }
  };
  ControllerClasses classes;
  classes.with<Once>("once");
  const auto application = make_application(R"({"name": "test", "on_fault": "restart",
    "restart": {"back_off_ms": 4},
    "modes": {"on": {"components": ["switched"]}, "off": {}}, "initial_mode": "on",
    "components": [{"name": "driver", "library": "driver", "serve_period_ms": 1,
                    "params": {"switch_at": [4], "modes": ["off"]}},
                   {"name": "always", "library": "once"}, {"name": "switched", "library": "once"}]})",
                                            classes, {.is_simulated = true});
  application->start();
  application->run(10ms);
  EXPECT_EQ(core_of(*application, "always").state, State::kActive);
  EXPECT_EQ(core_of(*application, "switched").state, State::kStandby);
  application->stop();
  // Faulted at 2 ms by number 2, made anew at 6 ms, before number 6 came.
  const auto always = ledger_of(*application, "numbers", "always");
  EXPECT_EQ(always.delivered, 7U);
  EXPECT_EQ(dropped(always, DropReason::kInactive), 3U);
  const auto switched = ledger_of(*application, "numbers", "switched");
  EXPECT_EQ(switched.delivered, 2U);
  EXPECT_EQ(dropped(switched, DropReason::kInactive), 8U);
}

// ---- A bench ----

TEST(ABench, SwitchesModesAndActivatesByHand) {
  g_controllers.clear();
  testing::Bench bench;
  bench.add<Controller>("planner");
  bench.configure(R"({"modes": {"on": {"components": ["planner"]}, "off": {}},
                      "initial_mode": "off"})");
  auto numbers = bench.input<Int64Value>("numbers");
  auto commands = bench.output<Int64Value>("commands");
  bench.start();
  Int64Value number;
  number.set_value(7);

  numbers.publish(number);
  EXPECT_TRUE(commands.take().empty());
  EXPECT_FALSE(bench.is_active("planner"));

  bench.switch_mode("on");
  EXPECT_EQ(bench.mode(), "on");
  numbers.publish(number);
  EXPECT_EQ(commands.take().at(0).value(), 7);

  bench.deactivate("planner");
  EXPECT_EQ(commands.take().at(0).value(), -1);
  numbers.publish(number);
  EXPECT_TRUE(commands.take().empty());

  bench.activate("planner");
  numbers.publish(number);
  EXPECT_EQ(commands.take().at(0).value(), 7);
}

/// Ticks once, so long after it has become active; a tick that it arms as it is deactivated is
/// none.
class Delayed final : public Component {
 public:
  explicit Delayed(Context& context)
      : Component(context),
        ticks_(context.create_publisher<Int64Value>("ticks")),
        timer_(context.create_timer([this] {
          auto tick = ticks_.loan();
          tick->set_value(++count_);
          ticks_.publish(std::move(tick));
        })) {}
  void activate() override { timer_.arm_at(now() + std::chrono::milliseconds(50)); }
  void deactivate() override { timer_.arm_at(now() + std::chrono::milliseconds(10)); }

 private:
  Publisher<Int64Value> ticks_;
  Timer timer_;
  std::int64_t count_ = 0;
};

TEST(ABench, HasTimersTickThatWereArmedByEachActivate) {
  using std::chrono_literals::operator""ms;
  testing::Bench bench;
  bench.add<Delayed>("delayed");
  auto ticks = bench.output<Int64Value>("ticks");
  bench.start();

  bench.advance(100ms);
  EXPECT_EQ(ticks.take().size(), 1U);
  bench.deactivate("delayed");
  bench.advance(100ms);
  EXPECT_TRUE(ticks.take().empty());
  for (int round = 0; round < 2; ++round) {
    bench.activate("delayed");
    bench.advance(49ms);
    EXPECT_TRUE(ticks.take().empty());
    bench.advance(51ms);
    EXPECT_EQ(ticks.take().size(), 1U) << "round " << round;
    bench.deactivate("delayed");
  }
}

// ---- Live, under load ----

/// Checks each command against the modes that there were.
void check_commands(const Application& application,
                    const std::vector<Actuator::Command>& commands) {
  const auto planner = core_of(application, "planner").declared.publishers.at(0)->id;
  const auto switches = application.modes().switches();
  std::size_t wrong = 0;
  for (const Actuator::Command& command : commands) {
    std::string mode = "nominal";
    for (const ModeSwitch& made : switches) {
      if (made.stamp < command.published) {
        mode = made.to;
      } else {
        break;
      }
    }
    wrong += mode == (command.publisher == planner ? "nominal" : "degraded") ? 0 : 1;
  }
  EXPECT_EQ(wrong, 0U) << "of " << commands.size();
}

constexpr const char* kLiveControllers = R"({"name": "test",
  "executors": [{"name": "one"}, {"name": "two"}, {"name": "three"}],
  "modes": {"nominal": {"components": ["planner"]}, "degraded": {"executors": ["two"]}},
  "initial_mode": "nominal",
  "topics": {"commands": {"multiple_publishers": true}},
  "components": [
    {"name": "driver", "library": "driver", "serve_period_ms": 0.02, "executor": "three"},
    {"name": "planner", "library": "controller", "executor": "one"},
    {"name": "fallback", "library": "controller", "executor": "two"},
    {"name": "actuator", "library": "actuator", "executor": "three"}]})";

TEST(ManyModeSwitches, LeaveNoMessageOfADisabledComponentBehindThem) {
  ControllerClasses classes;
  const auto application = make_application(kLiveControllers, classes);
  application->start();
  for (int i = 1; i <= 1000; ++i) {
    const std::string mode = i % 2 == 1 ? "degraded" : "nominal";
    application->switch_mode(mode);
    wait_until([&] { return !application->modes().is_switching(); });
    ASSERT_EQ(application->modes().current(), mode);
  }
  application->request_end(EndReason::kRequested);
  std::vector<Actuator::Command> commands;
  ComponentCore& actuator = core_of(*application, "actuator");
  // The last words alone are as many; some may still wait for the actuator.
  wait_until([&] {
    std::atomic<bool> is_done{false};
    actuator.post(detail::Cause::kExternal, [&] {
      commands = static_cast<Actuator*>(actuator.component)->commands;
      is_done = true;
    });
    wait_until([&] { return is_done.load(); });
    return commands.size() >= 1000U;
  });
  application->stop();
  EXPECT_EQ(g_controllers.clashes, 0);
  ASSERT_EQ(application->modes().switches().size(), 1000U);
  check_commands(*application, commands);
  for (const auto& [name, topic] : application->topics().all()) {
    for (const auto& subscription : topic->subscriptions) {
      EXPECT_TRUE(subscription->ledger().adds_up()) << name;
    }
  }
}

TEST(AMode, IsAskedForByTwoThreadsAtOnce) {
  ControllerClasses classes;
  const auto application = make_application(kLiveControllers, classes);
  application->start();
  const auto ask = [&](int first) {
    for (int i = first; i < first + 20; ++i) {
      application->switch_mode(i % 2 == 0 ? "degraded" : "nominal");
    }
  };
  std::thread one([&] { ask(0); });
  std::thread two([&] { ask(1); });
  one.join();
  two.join();
  wait_until([&] { return !application->modes().is_switching(); });
  application->stop();
  EXPECT_EQ(g_controllers.clashes, 0);
  const auto switches = application->modes().switches();
  std::string mode = "nominal";
  for (const ModeSwitch& made : switches) {
    EXPECT_EQ(made.from, mode);
    EXPECT_NE(made.to, mode);
    mode = made.to;
  }
  EXPECT_EQ(application->modes().current(), mode);
  EXPECT_EQ(g_controllers.active, 0);
}

TEST(AMode, MutesTheThreadsOfItsDisabledComponents) {
  struct Radar final : Component {
    explicit Radar(Context& its_context)
        : Component(its_context),
          numbers(its_context.create_external_publisher<Int64Value>("numbers")) {
      its_context.create_thread("radar", [this](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          auto loan = numbers.loan();
          loan->set_value(1);
          numbers.publish(std::move(loan), Time{});
          ++published;
          std::this_thread::yield();
        }
      });
    }
    ExternalPublisher<Int64Value> numbers;
    std::atomic<int> published{0};
  };
  struct Reader final : Component {
    explicit Reader(Context& its_context) : Component(its_context) {
      its_context.create_subscriber<Int64Value>("numbers", [this](const Sample<Int64Value>& s) {
        last = std::max(last.load(), s.info().publish_time.time_since_epoch().count());
      });
    }
    std::atomic<std::int64_t> last{0};
  };
  TestClasses classes;
  classes.with<Radar>("radar").with<Reader>("reader");
  const auto application = make_application(R"({"name": "test",
    "modes": {"on": {"components": ["radar"]}, "off": {}}, "initial_mode": "on",
    "components": [{"name": "radar", "library": "radar"}, {"name": "reader", "library": "reader"}]})",
                                            classes);
  application->start();
  const auto& radar = *static_cast<Radar*>(core_of(*application, "radar").component);
  const auto& reader = *static_cast<Reader*>(core_of(*application, "reader").component);
  wait_until([&] { return reader.last > 0; });
  application->switch_mode("off");
  wait_until([&] { return !application->modes().is_switching(); });
  const std::int64_t stamp = base::to_ns(application->modes().switches().at(0).stamp);
  const int before = radar.published;
  wait_until([&] { return radar.published > before + 100; });  // Its thread runs on.
  EXPECT_LE(reader.last, stamp);
  application->switch_mode("on");
  wait_until([&] { return reader.last > stamp; });
  application->stop();
  EXPECT_TRUE(ledger_of(*application, "numbers", "reader").adds_up());
}

// ---- Random lives ----

/// What went wrong in the lives of `Mortal`s, and what happened in them.
struct Lives {
  std::atomic<int> objects{0};
  std::atomic<int> wrong{0};
  std::mutex mutex;
  std::map<std::string, std::string> stories;

  void clear() {
    objects = 0;
    wrong = 0;
    stories.clear();
  }
};

Lives g_lives;

/// Faults anywhere, and knows itself what may be called when.
class Mortal final : public Component {
 public:
  explicit Mortal(Context& context)
      : Component(context),
        fault_percent_(context.param<std::int64_t>("fault_percent")),
        inputs_(context.param<std::vector<std::string>>("inputs")),
        modes_(context.param<std::vector<std::string>>("modes")),
        out_(context.create_publisher<Int64Value>(context.component_name())) {
    ++g_lives.objects;
    try {
      for (const std::string& input : inputs_.get()) {
        context.create_subscriber<Int64Value>(input, [this](const Int64Value& n) { on(n); });
      }
      context.create_timer({.period = 3ms}, [this] { called('t', phase_ == Phase::kActive); });
      once_.emplace(context.create_timer([this] { called('o', phase_ == Phase::kActive); }));
      called('c', true, 1);
    } catch (...) {
      --g_lives.objects;
      throw;
    }
  }
  Mortal(const Mortal&) = delete;
  Mortal& operator=(const Mortal&) = delete;
  ~Mortal() override { --g_lives.objects; }

  void start() override {
    called('s', phase_ == Phase::kNew);
    phase_ = Phase::kStandby;
  }
  void activate() override {
    called('a', phase_ == Phase::kStandby);
    phase_ = Phase::kActive;
    once_->arm_at(now() + 2ms);
  }
  void serve() override {
    called('v', phase_ == Phase::kActive);
    publish(0);
    if (!modes_.get().empty() && random()() % 4 == 0) {
      context().switch_mode(modes_.get()[random()() % modes_.get().size()]);
    }
  }
  void deactivate() override {
    called('d', phase_ == Phase::kActive);
    phase_ = Phase::kStandby;
    publish(5);
    once_->arm_at(now());
  }
  void stop() override {
    called('p', phase_ == Phase::kStandby);
    phase_ = Phase::kStopped;
  }

 private:
  enum class Phase { kNew, kStandby, kActive, kStopped, kFaulted };

  void on(const Int64Value& number) {
    called('m', phase_ == Phase::kActive);
    if (number.value() < 2) {
      publish(number.value() + 1);
    }
  }

  void called(char what, bool is_right, int part = 4) {
    g_lives.wrong += is_right ? 0 : 1;
    const auto ms = std::chrono::duration_cast<std::chrono::microseconds>(now() - start_time());
    {
      const std::lock_guard lock(g_lives.mutex);
      g_lives.stories[context().component_name()] += fmt::format("{}{} ", what, ms.count());
    }
    if (static_cast<std::int64_t>(random()() % 400) < part * fault_percent_.get()) {
      phase_ = Phase::kFaulted;
      throw std::runtime_error(std::string("in ") + what);
    }
  }

  void publish(std::int64_t value) {
    auto loan = out_.loan();
    loan->set_value(value);
    out_.publish(std::move(loan));
  }

  Param<std::int64_t> fault_percent_;
  Param<std::vector<std::string>> inputs_;
  Param<std::vector<std::string>> modes_;
  Publisher<Int64Value> out_;
  std::optional<Timer> once_;
  Phase phase_ = Phase::kNew;
};

std::string random_application(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto up_to = [&](std::uint64_t n) { return random() % (n + 1); };
  nlohmann::json application = {{"name", fmt::format("run_{}", seed)}};
  const std::size_t count = 2 + up_to(3);
  const std::size_t mode_count = 1 + up_to(2);
  std::vector<std::string> names;
  std::vector<std::string> modes;
  for (std::size_t i = 0; i < count; ++i) {
    names.push_back(fmt::format("c{}", i));
  }
  for (std::size_t i = 0; i < mode_count; ++i) {
    modes.push_back(fmt::format("m{}", i));
    auto members = nlohmann::json::array();
    for (const std::string& name : names) {
      if (up_to(1) == 0) {
        members.push_back(name);
      }
    }
    application["modes"][modes.back()] = {{"components", members}};
  }
  application["initial_mode"] = modes[up_to(mode_count - 1)];
  application["executors"] = {{{"name", "one"}}, {{"name", "two"}, {"threads", 2}}};
  for (std::size_t i = 0; i < count; ++i) {
    auto inputs = nlohmann::json::array();
    for (std::size_t j = 0; j < count; ++j) {
      if (i != j && up_to(2) != 0) {
        inputs.push_back(names[j]);
      }
    }
    nlohmann::json component = {
        {"name", names[i]},
        {"library", "mortal"},
        {"executor", up_to(1) == 0 ? "one" : "two"},
        {"serve_period_ms", 1 + up_to(4)},
        {"on_fault", up_to(2) == 0 ? "stop_component" : "restart"},
        {"restart", {{"limit", up_to(6)}, {"back_off_ms", up_to(1) * up_to(5)}}},
        {"params",
         {{"fault_percent", up_to(4)},
          {"inputs", inputs},
          {"modes", up_to(1) == 0 ? modes : std::vector<std::string>{}}}}};
    if (up_to(2) == 0) {
      component["fault_mode"] = modes[up_to(mode_count - 1)];
    }
    if (i > 0 && up_to(2) == 0) {
      component["after"] = {names[up_to(i - 1)]};
    }
    if (up_to(2) == 0) {
      application["topics"][names[i]] = {{"latched", 1 + up_to(2)}};
    }
    application["components"].push_back(std::move(component));
  }
  return application.dump();
}

/// Lives through one random application; what its components did.
std::map<std::string, std::string> live(std::uint64_t seed, const ClockOptions& clock,
                                        Duration span) {
  g_lives.clear();
  {
    TestClasses classes;
    classes.with<Mortal>("mortal");
    const auto application = make_application(random_application(seed), classes, clock);
    application->start();
    application->run(span);
    application->stop();
    for (const auto& [name, topic] : application->topics().all()) {
      for (const auto& subscription : topic->subscriptions) {
        const detail::Ledger ledger = subscription->ledger();
        EXPECT_TRUE(ledger.adds_up()) << name << " to " << subscription->component;
        EXPECT_EQ(ledger.queued, 0U) << name << " to " << subscription->component;
      }
    }
  }
  EXPECT_EQ(g_lives.objects, 0) << "seed " << seed;
  EXPECT_EQ(g_lives.wrong, 0) << "seed " << seed;
  return g_lives.stories;
}

TEST(ManyLives, GoThroughTheirStatesInOrderWhateverFaults) {
  std::size_t length = 0;
  for (std::uint64_t seed = 1; seed <= 1000 && !::testing::Test::HasFailure(); ++seed) {
    for (const auto& [name, story] : live(seed, {.is_simulated = true, .workers = 1}, 40ms)) {
      length += story.size();
    }
  }
  EXPECT_GT(length, 100'000U);
}

TEST(ManyLives, AreTheSameWithAnyNumberOfWorkers) {
  for (std::uint64_t seed = 2001; seed <= 2060 && !::testing::Test::HasFailure(); ++seed) {
    const auto one = live(seed, {.is_simulated = true, .workers = 1}, 60ms);
    EXPECT_EQ(live(seed, {.is_simulated = true, .workers = 2}, 60ms), one) << "seed " << seed;
    EXPECT_EQ(live(seed, {.is_simulated = true, .workers = 4}, 60ms), one) << "seed " << seed;
  }
}

TEST(ManyLives, GoThroughTheirStatesInOrderLive) {
  for (std::uint64_t seed = 3001; seed <= 3080 && !::testing::Test::HasFailure(); ++seed) {
    live(seed, {}, 20ms);
  }
}

}  // namespace
}  // namespace fastcycle::host
