#include "component/credits.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/application.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using detail::Ledger;
using google::protobuf::Int64Value;
using namespace std::chrono_literals;

/// Publishes 1, 2, 3, … on "numbers" as fast as credits allow, `count` in all. The first object of
/// it throws after `throws_at`.
class Pump final : public Component {
 public:
  explicit Pump(Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 1000})),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = -1})),
        numbers_(context.create_publisher<Int64Value>("numbers", {.credits = 4,
                                                                  .on_credits =
                                                                      [this] {
                                                                        ++events_;
                                                                        pump();
                                                                      }})),
        source_(context.create_source()) {}

  void start() override { pump(); }
  void stop() override {
    report("events", events_);
    report("most_at_once", most_at_once_);
  }

 private:
  void pump() {
    std::int64_t at_once = 0;
    for (; sent_ < count_.get() && numbers_.credits() > 0; ++at_once) {
      auto loan = numbers_.loan();
      loan->set_value(++sent_);
      numbers_.publish(std::move(loan));
    }
    most_at_once_ = std::max(most_at_once_, at_once);
    if (sent_ == count_.get()) {
      source_.finish();
    }
    if (context().core().restart_count == 0 && sent_ >= throws_at_.get() && throws_at_.get() > 0) {
      throw std::runtime_error("on purpose");
    }
  }

  Param<std::int64_t> count_;
  Param<std::int64_t> throws_at_;
  Publisher<Int64Value> numbers_;
  Source source_;
  std::int64_t sent_ = 0;
  std::int64_t events_ = 0;
  std::int64_t most_at_once_ = 0;
};

/// Sums what it receives, `work` steps of computing slow; throws, or ends its subscription, at the
/// message `until`.
class Adder final : public Component {
 public:
  explicit Adder(Context& context)
      : Component(context),
        work_(context.param<std::int64_t>("work", {.fallback = 0})),
        until_(context.param<std::int64_t>("until", {.fallback = -1})),
        throws_(context.param<bool>("throws", {.fallback = false})) {
    subscriber_ = context.create_subscriber<Int64Value>(
        "numbers", {.depth = 4}, [this](const Int64Value& number) { add(number); });
  }

  void stop() override {
    report("sum", sum_);
    report("in_order", in_order_);
  }

 private:
  void add(const Int64Value& number) {
    in_order_ = in_order_ && number.value() == last_ + 1;
    last_ = number.value();
    sum_ += number.value();
    for (std::int64_t step = 0; step < work_.get(); ++step) {
      worked_ = worked_ + 1;
    }
    if (number.value() == until_.get()) {
      if (throws_.get()) {
        throw std::runtime_error("on purpose");
      }
      subscriber_.reset();
    }
  }

  Param<std::int64_t> work_;
  Param<std::int64_t> until_;
  Param<bool> throws_;
  std::optional<Subscriber> subscriber_;
  std::int64_t sum_ = 0;
  std::int64_t last_ = 0;
  bool in_order_ = true;
  volatile std::int64_t worked_ = 0;
};

/// As `Pump`, from a thread.
class ThreadPump final : public Component {
 public:
  explicit ThreadPump(Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("count", {.fallback = 1000})),
        numbers_(context.create_external_publisher<Int64Value>("numbers", {.credits = 4})),
        source_(context.create_source()) {
    context.create_thread("pump", [this](const std::stop_token& stop) {
      for (std::int64_t i = 1; i <= count_.get() && numbers_.wait_for_credit(stop); ++i) {
        auto loan = numbers_.loan();
        loan->set_value(i);
        numbers_.publish(std::move(loan), kSimulatedStart);
      }
      has_ended = true;
      source_.finish();
    });
  }

  std::atomic<bool> has_ended{false};

 private:
  Param<std::int64_t> count_;
  ExternalPublisher<Int64Value> numbers_;
  Source source_;
};

TestClasses& classes() {
  static TestClasses all;
  all.with<Pump>("pump").with<Adder>("adder").with<ThreadPump>("thread_pump");
  return all;
}

constexpr const char* kExecutors =
    R"("executors": [{"name": "a", "threads": 1}, {"name": "b", "threads": 1}])";

/// A pump on one executor, and one adder for each of `adders`, the params of which it holds, on the
/// other.
std::string pump_and(const std::vector<std::string>& adders, const std::string& pump,
                     const std::string& library = "pump") {
  std::string text = std::string(R"({"name": "t", )") + kExecutors +
                     R"(, "components": [{"name": "pump", "library": ")" + library +
                     R"(", "executor": "a", )" + pump + "}";
  for (std::size_t i = 0; i < adders.size(); ++i) {
    text += R"(, {"name": "adder)" + std::to_string(i) +
            R"(", "library": "adder", "executor": "b", "params": {)" + adders[i] + "}}";
  }
  return text + "]}";
}

ReportValue result(const Application& application, std::size_t component, const std::string& name) {
  return application.components()[component]->results.at(name);
}

std::int64_t sum_to(std::int64_t count) {
  return count * (count + 1) / 2;
}

std::unique_ptr<Application> run(const std::string& text, const ClockOptions& clock = {}) {
  auto application = make_application(text, classes(), clock);
  application->start();
  EXPECT_EQ(application->run(std::nullopt), EndReason::kSourcesFinished);
  application->stop();
  return application;
}

void expect_all(Application& application, std::size_t adder, std::int64_t count) {
  const Ledger ledger = ledger_of(application, "numbers", "adder" + std::to_string(adder));
  EXPECT_EQ(ledger.published, static_cast<std::uint64_t>(count));
  EXPECT_EQ(ledger.delivered, static_cast<std::uint64_t>(count));
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(result(application, 1 + adder, "sum"), ReportValue(sum_to(count)));
  EXPECT_EQ(result(application, 1 + adder, "in_order"), ReportValue(true));
}

constexpr std::int64_t kMany = 100'000;
constexpr const char* kManyParams = R"("params": {"count": 100000})";

TEST(ManyMessagesWithCredits, ReachASlowSubscriberLive) {
  const auto application = run(pump_and({R"("work": 500)"}, kManyParams));
  expect_all(*application, 0, kMany);
}

TEST(ManyMessagesWithCredits, ReachASlowSubscriberInSimulatedTimeWithAnyNumberOfWorkers) {
  std::vector<ReportValue> events;
  for (const unsigned workers : {1U, 2U, 4U}) {
    const auto application =
        run(pump_and({""}, kManyParams), {.is_simulated = true, .workers = workers});
    expect_all(*application, 0, kMany);
    EXPECT_EQ(result(*application, 0, "most_at_once"), ReportValue(std::int64_t{4}));
    events.push_back(result(*application, 0, "events"));
  }
  EXPECT_EQ(events, std::vector(3, events[0]));
}

TEST(ManyMessagesWithCredits, ReachTwoSubscribersOfDifferentSpeed) {
  constexpr std::int64_t kCount = 20'000;
  const std::string text = pump_and({"", R"("work": 2000)"}, R"("params": {"count": 20000})");
  for (const bool is_simulated : {false, true}) {
    const auto application = run(text, {.is_simulated = is_simulated});
    expect_all(*application, 0, kCount);
    expect_all(*application, 1, kCount);
  }
}

TEST(ManyMessagesWithCredits, ReachASlowSubscriberFromAThread) {
  constexpr std::int64_t kCount = 20'000;
  const std::string text =
      pump_and({R"("work": 500)"}, R"("params": {"count": 20000})", "thread_pump");
  for (const bool is_simulated : {false, true}) {
    const auto application = run(text, {.is_simulated = is_simulated});
    expect_all(*application, 0, kCount);
  }
}

TEST(Credits, OfASubscriberThatFailsAreGivenBack) {
  for (const bool is_simulated : {false, true}) {
    const auto application =
        run(pump_and({R"("until": 10, "throws": true)", ""}, R"("params": {"count": 1000})"),
            {.is_simulated = is_simulated});
    EXPECT_EQ(ledger_of(*application, "numbers", "adder0").delivered, 10U);
    EXPECT_TRUE(ledger_of(*application, "numbers", "adder0").adds_up());
    expect_all(*application, 1, 1000);
  }
}

TEST(Credits, OfASubscriberThatEndsAreGivenBack) {
  for (const bool is_simulated : {false, true}) {
    for (const char* library : {"pump", "thread_pump"}) {
      const auto application =
          run(pump_and({R"("until": 10)"}, R"("params": {"count": 1000})", library),
              {.is_simulated = is_simulated});
      const Ledger ledger = ledger_of(*application, "numbers", "adder0");
      EXPECT_EQ(ledger.delivered, 10U);
      EXPECT_TRUE(ledger.adds_up());
      EXPECT_EQ(application->topics().find("numbers")->publishers[0]->published(), 1000U);
    }
  }
}

TEST(Credits, AreThereWhereNobodyListens) {
  for (const bool is_simulated : {false, true}) {
    const auto application =
        run(pump_and({}, R"("params": {"count": 100})"), {.is_simulated = is_simulated});
    EXPECT_EQ(application->topics().find("numbers")->publishers[0]->published(), 100U);
  }
}

TEST(Credits, AreAskedForAgainByARestartedComponent) {
  for (const bool is_simulated : {false, true}) {
    const auto application =
        run(pump_and({""}, R"("on_fault": "restart", "params": {"count": 100, "throws_at": 50})"),
            {.is_simulated = is_simulated});
    EXPECT_EQ(application->components()[0]->restart_count, 1U);
    const Ledger ledger = ledger_of(*application, "numbers", "adder0");
    EXPECT_GE(ledger.delivered, 150U);
    EXPECT_EQ(ledger.delivered, ledger.published);
  }
}

TEST(Credits, OfTheApplicationFileStandAboveThoseOfTheCode) {
  std::string text = pump_and({""}, R"("params": {"count": 100})");
  text.insert(text.size() - 1, R"(, "topics": {"numbers": {"credits": 2}})");
  const auto application = run(text, {.is_simulated = true});
  EXPECT_EQ(result(*application, 0, "most_at_once"), ReportValue(std::int64_t{2}));
  expect_all(*application, 0, 100);
}

// ---- No event where none is needed ----

/// Publishes one number each tick, and counts its events.
class Metronome final : public Component {
 public:
  explicit Metronome(Context& context)
      : Component(context),
        numbers_(context.create_publisher<Int64Value>(
            "numbers", {.credits = 4, .on_credits = [this] { ++events; }})) {}
  void serve() override {
    ASSERT_EQ(numbers_.credits(), 4U);
    numbers_.publish(numbers_.loan());
    ASSERT_EQ(numbers_.credits(), 3U);
  }

  int events = 0;

 private:
  Publisher<Int64Value> numbers_;
};

TEST(Credits, ThatDidNotRunOutCauseNoEvent) {
  TestClasses calm;
  calm.with<Metronome>("metronome").with<Adder>("adder");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "metronome", "library": "metronome", "serve_period_ms": 1},
        {"name": "adder0", "library": "adder"}]})",
      calm, {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 50ms);

  EXPECT_EQ(static_cast<Metronome&>(*application->components()[0]->component).events, 0);
  EXPECT_EQ(ledger_of(*application, "numbers", "adder0").delivered, 50U);
}

/// Publishes as much as it may for each event, and whenever it is poked.
class Poked final : public Component {
 public:
  explicit Poked(Context& context)
      : Component(context),
        numbers_(context.create_publisher<Int64Value>(
            "numbers", {.credits = 2, .on_credits = [this] { pump(); }})) {}

  void start() override { pump(); }
  void pump() {
    while (sent < 100 && numbers_.credits() > 0) {
      auto loan = numbers_.loan();
      loan->set_value(++sent);
      numbers_.publish(std::move(loan));
    }
  }
  std::int64_t sent = 0;

 private:
  Publisher<Int64Value> numbers_;
};

/// Pokes who published what it receives, in the round in which it gives the credit back.
class Poker final : public Component {
 public:
  explicit Poker(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", {.depth = 2}, [this](const Int64Value&) {
      poked->post(
          detail::Cause::kEvent, [this] { static_cast<Poked*>(poked->component)->pump(); },
          &this->context().core());
    });
  }

  detail::ComponentCore* poked = nullptr;  ///< Set before the start.
};

TEST(Credits, ThatWereUsedUpInTheRoundInWhichTheyCameAreAwaitedAfterIt) {
  TestClasses two;
  two.with<Poked>("poked").with<Poker>("poker");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "poked", "library": "poked"},
                                      {"name": "poker", "library": "poker"}]})",
      two, {.is_simulated = true});
  static_cast<Poker&>(*application->components()[1]->component).poked =
      application->components()[0].get();
  application->start();  // Its last round would never end.
  application->advance_to(kSimulatedStart + 1ms);

  EXPECT_EQ(static_cast<Poked&>(*application->components()[0]->component).sent, 100);
  EXPECT_EQ(ledger_of(*application, "numbers", "poker").delivered, 100U);
  application->stop();
}

// ---- A thread that waits at the end ----

/// Does not return from its callback before it may.
class Stubborn final : public Component {
 public:
  explicit Stubborn(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value&) {
      while (!may_go) {
        std::this_thread::yield();
      }
    });
  }
  std::atomic<bool> may_go{false};
};

TEST(Credits, AThreadThatWaitsForThemEndsWithTheRun) {
  TestClasses slow;
  slow.with<ThreadPump>("pump").with<Stubborn>("stubborn");
  const auto application =
      make_application(std::string(R"({"name": "t", )") + kExecutors +
                           R"(, "components": [{"name": "pump", "library": "pump", "executor": "a"},
                              {"name": "s", "library": "stubborn", "executor": "b"}]})",
                       slow);
  application->start();
  auto& pump = static_cast<ThreadPump&>(*application->components()[0]->component);
  auto& stubborn = static_cast<Stubborn&>(*application->components()[1]->component);
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (ledger_of(*application, "numbers", "s").published < 4 &&
         std::chrono::steady_clock::now() < limit) {
    std::this_thread::yield();
  }
  // The fifth has to wait until the end of the run asks the thread to end.
  std::thread lets_go([&] {
    while (!pump.has_ended) {
      std::this_thread::yield();
    }
    stubborn.may_go = true;
  });
  application->request_end(EndReason::kRequested);
  application->stop();
  lets_go.join();

  EXPECT_EQ(ledger_of(*application, "numbers", "s").published, 4U);
}

// ---- Errors ----

class Windowless final : public Component {
 public:
  explicit Windowless(Context& context) : Component(context) {
    static_cast<void>(context.create_publisher<Int64Value>("numbers", {.on_credits = [] {}}));
  }
};

std::string problems_of(const std::string& text, TestClasses& its_classes) {
  config::Problems problems;
  Application application(describe_text(text, problems), {.is_simulated = true});
  application.build(its_classes, problems, ConstructorFault::kError);
  std::string all;
  for (const config::Problem& problem : problems.all()) {
    all += config::to_string(problem) + "\n";
  }
  return all;
}

TEST(Credits, MoreThanAQueueHoldsAreAnError) {
  std::string text = pump_and({""}, R"("params": {"count": 100})");
  text.insert(text.size() - 1, R"(, "topics": {"numbers": {"credits": 5}})");
  EXPECT_NE(problems_of(text, classes())
                .find(R"(component "adder0" lets 4 messages of topic "numbers" wait, fewer than )"
                      "its 5 credits"),
            std::string::npos);
}

TEST(Credits, AnEventWithoutAWindowIsAnError) {
  TestClasses invalid;
  invalid.with<Windowless>("windowless");
  EXPECT_NE(problems_of(R"({"name": "t", "components": [{"name": "w", "library": "windowless"}]})",
                        invalid)
                .find(R"(its publisher on "numbers" has on_credits, but no credits)"),
            std::string::npos);
}

}  // namespace
}  // namespace fastcycle::host
