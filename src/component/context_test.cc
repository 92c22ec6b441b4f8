#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using fastcycle::testing::Bench;
using google::protobuf::Int64Value;
using ::testing::ElementsAre;
using namespace std::chrono_literals;

Int64Value number(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message;
}

std::vector<std::int64_t> values(const std::vector<Int64Value>& messages) {
  std::vector<std::int64_t> all;
  for (const Int64Value& message : messages) {
    all.push_back(message.value());
  }
  return all;
}

// ---- Timers ----

/// Publishes, for each tick of its timers, when it came, in ms since the start. What it receives on
/// "orders": 0 cancels, -1 resets, anything else arms in so many ms.
class Ticker final : public Component {
 public:
  explicit Ticker(Context& context)
      : Component(context),
        ticks_(context.create_publisher<Int64Value>("ticks")),
        once_(context.create_timer([this] { say(); })),
        periodic_(context.create_timer({.period = 10ms}, [this] { say(); })) {
    context.create_subscriber<Int64Value>("orders", [this](const Int64Value& order) {
      if (order.value() == 0) {
        periodic_.cancel();
      } else if (order.value() == -1) {
        periodic_.reset();
      } else {
        once_.arm_in(std::chrono::milliseconds(order.value()));
      }
    });
  }

 private:
  void say() {
    auto tick = ticks_.loan();
    tick->set_value((now() - start_time()) / 1ms);
    ticks_.publish(std::move(tick));
  }

  Publisher<Int64Value> ticks_;
  Timer once_;
  Timer periodic_;
};

TEST(ATimer, ThatIsArmedInATimeTicksOnceThatMuchLater) {
  Bench bench;
  bench.add<Ticker>("ticker");
  auto orders = bench.input<Int64Value>("orders");
  auto ticks = bench.output<Int64Value>("ticks");
  bench.start();
  orders.publish(number(0));
  bench.advance(2ms);

  orders.publish(number(5));
  bench.advance(30ms);

  EXPECT_THAT(values(ticks.take()), ElementsAre(7));
}

TEST(ATimer, ThatIsResetBeginsItsPeriodAnew) {
  Bench bench;
  bench.add<Ticker>("ticker");
  auto orders = bench.input<Int64Value>("orders");
  auto ticks = bench.output<Int64Value>("ticks");
  bench.start();

  bench.advance(14ms);
  orders.publish(number(-1));
  bench.advance(26ms);

  EXPECT_THAT(values(ticks.take()), ElementsAre(10, 24, 34));
}

TEST(ATimer, ThatWasCancelledTicksAgainWhenItIsReset) {
  Bench bench;
  bench.add<Ticker>("ticker");
  auto orders = bench.input<Int64Value>("orders");
  auto ticks = bench.output<Int64Value>("ticks");
  bench.start();
  orders.publish(number(0));
  bench.advance(25ms);
  EXPECT_TRUE(ticks.take().empty());

  orders.publish(number(-1));
  bench.advance(20ms);

  EXPECT_THAT(values(ticks.take()), ElementsAre(35, 45));
}

// ---- Its start ----

/// Says at which time it started, and when it was notified that the timers did. Its start takes a
/// while.
class Starter final : public Component {
 public:
  explicit Starter(Context& context) : Component(context), source_(context.create_source()) {}

  void start() override {
    report("start_is_now", start_time() == now());
    report("started_ns", now().time_since_epoch().count());
    const auto end = std::chrono::steady_clock::now() + 2ms;
    while (std::chrono::steady_clock::now() < end) {
    }
  }
  void serve() override {
    report("timers_ns", start_time().time_since_epoch().count());
    source_.finish();
  }

 private:
  Source source_;
};

TEST(AComponentThatStarts, TakesTheTimeOfItsActivationForTheStartUntilTheTimersHaveStarted) {
  TestClasses classes;
  classes.with<Starter>("starter");
  auto application = make_application(R"({"name": "starts", "components": [
      {"name": "first", "library": "starter", "serve_period_ms": 1},
      {"name": "second", "library": "starter", "serve_period_ms": 1, "after": ["first"]}]})",
                                      classes);
  application->start();
  EXPECT_EQ(application->run({}), EndReason::kSourcesFinished);
  application->stop();

  const auto result = [&](std::size_t component, const std::string& name) {
    return application->components()[component]->results.at(name);
  };
  EXPECT_EQ(result(0, "start_is_now"), ReportValue(true));
  EXPECT_EQ(result(1, "start_is_now"), ReportValue(true));
  EXPECT_GT(std::get<std::int64_t>(result(1, "started_ns")),
            std::get<std::int64_t>(result(0, "started_ns")));
  EXPECT_EQ(result(0, "timers_ns"), result(1, "timers_ns"));
  EXPECT_GT(std::get<std::int64_t>(result(0, "timers_ns")),
            std::get<std::int64_t>(result(1, "started_ns")));
}

// ---- Outputs of a bench ----

TEST(ABench, ShowsWhatTheFrameworkKnowsOfAMessage) {
  Bench bench;
  bench.add<Ticker>("ticker");
  auto ticks = bench.output<Int64Value>("ticks");
  bench.start();

  bench.advance(25ms);
  const auto received = ticks.take_with_info();

  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[1].message.value(), 20);
  EXPECT_EQ(received[1].info.sequence, 2U);
  EXPECT_EQ(received[1].info.publish_time, kSimulatedStart + 20ms);
  EXPECT_EQ(received[1].info.origin.taken, kSimulatedStart + 20ms);
  EXPECT_TRUE(ticks.take().empty());
  EXPECT_TRUE(ticks.take_with_info().empty());
}

// ---- External publishers ----

/// A thread that publishes three messages: taken 5 ms ago, without a word of that, and as it was
/// done before there were options.
class Device final : public Component {
 public:
  explicit Device(Context& context)
      : Component(context),
        numbers_(context.create_external_publisher<Int64Value>("numbers")),
        hold_(context.hold_time()) {
    context.create_thread("device", [this](const std::stop_token&) {
      const Time now = numbers_.now();
      numbers_.publish(one(1), {.taken_at = now - 5ms});
      numbers_.publish(one(2));
      numbers_.publish(one(static_cast<std::int64_t>(numbers_.subscriber_count())), now - 1ms);
      hold_.reset();
    });
  }

 private:
  Loan<Int64Value> one(std::int64_t value) {
    auto loan = numbers_.loan();
    loan->set_value(value);
    return loan;
  }

  ExternalPublisher<Int64Value> numbers_;
  std::optional<TimeHold> hold_;
};

TEST(AnExternalPublisher, KnowsTheApplicationsTimeAndTakesOptionsAsOthersDo) {
  Bench bench;
  bench.add<Device>("device");
  auto numbers = bench.output<Int64Value>("numbers");
  bench.start();

  bench.advance(1ms);
  const auto received = numbers.take_with_info();

  ASSERT_EQ(received.size(), 3U);
  EXPECT_EQ(received[0].info.origin.taken, kSimulatedStart - 5ms);
  EXPECT_EQ(received[1].info.origin.taken, kSimulatedStart);
  EXPECT_EQ(received[2].info.origin.taken, kSimulatedStart - 1ms);
  EXPECT_EQ(received[2].message.value(), 1) << "the bench";
}

// ---- Who subscribes ----

/// Says on "counts", every millisecond, how many subscribe to that.
class Counted final : public Component {
 public:
  explicit Counted(Context& context)
      : Component(context), counts_(context.create_publisher<Int64Value>("counts")) {}
  void serve() override {
    auto count = counts_.loan();
    count->set_value(static_cast<std::int64_t>(counts_.subscriber_count()));
    counts_.publish(std::move(count));
  }

 private:
  Publisher<Int64Value> counts_;
};

/// Subscribes to "counts" after 3 ms, for 2 ms.
class Visitor final : public Component {
 public:
  explicit Visitor(Context& context) : Component(context) {}
  void serve() override {
    ++ticks_;
    if (ticks_ == 3) {
      visit_ = context().create_subscriber<Int64Value>("counts", [](const Int64Value&) {});
    } else if (ticks_ == 5) {
      visit_.reset();
    }
  }

 private:
  int ticks_ = 0;
  std::optional<Subscriber> visit_;
};

/// Receives "counts", and looks at the last one too.
class Reader final : public Component {
 public:
  explicit Reader(Context& context)
      : Component(context), latest_(context.create_latest<Int64Value>("counts")) {
    context.create_subscriber<Int64Value>(
        "counts", [this](const Int64Value& count) { counts_ += std::to_string(count.value()); });
  }
  void stop() override { report("counts", counts_); }

 private:
  Latest<Int64Value> latest_;
  std::string counts_;
};

TEST(APublisher, KnowsHowManySubscribeTheSameInEveryRun) {
  for (const unsigned workers : {1U, 4U}) {
    const config::TestFolder folder;
    TestClasses classes;
    classes.with<Counted>("counted").with<Visitor>("visitor").with<Reader>("reader");
    config::Problems problems;
    Application application(describe_text(R"({"name": "t", "components": [
          {"name": "reader", "library": "reader"},
          {"name": "counted", "library": "counted", "serve_period_ms": 1},
          {"name": "visitor", "library": "visitor", "serve_period_ms": 1}]})",
                                          problems),
                            {.is_simulated = true, .workers = workers});
    config::RecordDescription record;  // Observers do not count.
    record.file = folder / "a.mcap";
    application.record(record);
    application.build(classes, problems, ConstructorFault::kFault);
    ASSERT_FALSE(problems.has_errors()) << config::text_of(problems);
    application.start();
    application.run(8ms);
    application.stop();

    EXPECT_EQ(std::get<std::string>(application.components()[0]->results.at("counts")), "22233222")
        << workers << " workers";
  }
}

// ---- Broken contracts ----

/// Lets a test do with it what only its callbacks may.
class Misused final : public Component {
 public:
  explicit Misused(Context& context)
      : Component(context),
        out_(context.create_publisher<Int64Value>("out")),
        latest_(context.create_latest<Int64Value>("in")),
        history_(context.create_history<Int64Value>("in", {.depth = 4})),
        once_(context.create_timer([] {})),
        periodic_(context.create_timer({.period = 1s}, [] {})) {
    instance = this;
    context.create_subscriber<Int64Value>("in", [this](const Int64Value&) {
      kept_.emplace(out_.loan());
      if (in_callback) {
        in_callback(*this);
      }
    });
    periodic_.cancel();  // A constructor may, and so may a destructor.
  }
  ~Misused() override { once_.cancel(); }

  static inline Misused* instance = nullptr;
  static inline std::function<void(Misused&)> in_callback;

  Publisher<Int64Value> out_;
  Latest<Int64Value> latest_;
  History<Int64Value> history_;
  Timer once_;
  Timer periodic_;
  std::optional<Loan<Int64Value>> kept_;
  using Component::context;
};

void misuse(const std::function<void(Misused&)>& outside,
            const std::function<void(Misused&)>& inside = {}) {
  Misused::in_callback = inside;
  Bench bench;
  bench.add<Misused>("misused");
  auto in = bench.input<Int64Value>("in");
  bench.start();
  in.publish(number(1));
  outside(*Misused::instance);
}

class BrokenContractDeathTest : public ::testing::Test {
 protected:
  void SetUp() override { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
};

TEST_F(BrokenContractDeathTest, OutsideOfACallbackNamesComponentTopicAndRemedy) {
  const std::string head = "broken contract: component \"misused\": ";
  const std::string own_thread =
      "outside of a callback; publish from your own thread with create_external_publisher";
  EXPECT_DEATH(misuse([](Misused& it) { static_cast<void>(it.out_.loan()); }),
               head + "loan\\(\\) for \"out\" " + own_thread);
  EXPECT_DEATH(misuse([](Misused& it) { it.out_.publish(std::move(*it.kept_)); }),
               head + "publish on \"out\" " + own_thread);
  EXPECT_DEATH(misuse([](Misused& it) { static_cast<void>(it.out_.subscriber_count()); }),
               head + "subscriber_count\\(\\) of \"out\" outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { static_cast<void>(it.latest_.get()); }),
               head + "its view of \"in\" is read outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { static_cast<void>(it.history_.size()); }),
               head + "its view of \"in\" is read outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { it.once_.cancel(); }),
               head + "Timer::cancel\\(\\) of \"timer 0\" outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { it.once_.arm_in(1ms); }),
               head + "Timer::arm_in\\(\\) of \"timer 0\" outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { it.periodic_.reset(); }),
               head + "Timer::reset\\(\\) of \"timer 1\" outside of a callback");
  EXPECT_DEATH(misuse([](Misused& it) { it.context().switch_mode("night"); }),
               head + "switch_mode\\(\\) to \"night\" outside of a callback");
}

TEST_F(BrokenContractDeathTest, WithinACallbackNamesComponentTopicAndRemedy) {
  const std::string head = "broken contract: component \"misused\": ";
  const auto nothing = [](Misused&) {};
  EXPECT_DEATH(misuse(nothing,
                      [](Misused& it) {
                        it.out_.publish(std::move(*it.kept_));
                        it.out_.publish(std::move(*it.kept_));
                      }),
               head + "a loan for \"out\" is used after it was published, or moved from; borrow");
  EXPECT_DEATH(misuse(nothing, [](Misused& it) { static_cast<void>(it.out_.credits()); }),
               head + "its publisher on \"out\" is asked for credits, and has none; say");
  EXPECT_DEATH(misuse(nothing, [](Misused& it) { it.periodic_.arm_at(Time()); }),
               head + "timer 1 is armed, but has a period, and arms itself; use Timer::reset");
  EXPECT_DEATH(misuse(nothing, [](Misused& it) { it.once_.reset(); }),
               head + "timer 0 is reset, but has no period; use Timer::arm_in");
  EXPECT_DEATH(
      misuse(nothing, [](Misused& it) { static_cast<void>(it.context().create_timer([] {})); }),
      head + "create_timer\\(\\) outside of its constructor; declare it there");
  EXPECT_DEATH(misuse(nothing, [](Misused& it) { it.out_.publish(Sample<Int64Value>()); }),
               head + "a sample without a message is forwarded on \"out\"");
}

}  // namespace
}  // namespace fastcycle::host
