// Quality of service: late joiners, deadlines, lifespans and liveliness, in whole applications.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
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
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using detail::DropReason;
using detail::Ledger;
using google::protobuf::Int64Value;
using namespace std::chrono_literals;

using Numbers = std::vector<std::int64_t>;
using Lines = std::vector<std::string>;

std::uint64_t dropped(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

/// Waits until `condition` holds; gives up, and fails the test, after a minute.
template <typename Condition>
void wait_until(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!condition()) {
    ASSERT_LT(std::chrono::steady_clock::now(), limit) << "the condition never came true";
    std::this_thread::sleep_for(1ms);
  }
}

template <typename T>
T& component(const Application& application, std::size_t index) {
  return static_cast<T&>(*application.components()[index]->component);
}

const char* word_of(QosKind kind) {
  switch (kind) {
    case QosKind::kDeadlineMissed:
      return "missed";
    case QosKind::kLivelinessLost:
      return "lost";
    case QosKind::kLivelinessGained:
      return "gained";
    case QosKind::kMessageExpired:
      return "expired";
    case QosKind::kMessageLost:
      return "missing";
  }
  return "?";
}

/// Publishes 1, 2, 3, … on "numbers", one at each of "at_ms"; throws at "throw_at_ms".
class Script final : public Component {
 public:
  explicit Script(Context& context)
      : Component(context),
        at_ms_(context.param<std::vector<double>>("at_ms", {.fallback = std::vector<double>{}})),
        throw_at_ms_(context.param<double>("throw_at_ms", {.fallback = -1.0})),
        numbers_(context.create_publisher<Int64Value>(
            "numbers", {.on_event =
                            [this](const QosEvent& event) {
                              log.push_back(fmt::format("{} {} {} since {}",
                                                        (now() - start_time()) / 1us,
                                                        word_of(event.kind), event.count,
                                                        (event.since - start_time()) / 1us));
                            }})),
        timer_(context.create_timer([this] { publish(); })),
        fault_(context.create_timer([] { throw std::runtime_error("as the script says"); })) {
    if (!at_ms_.get().empty()) {
      first_ = context.create_timer({.period = 1us}, [this] {
        first_->cancel();
        arm();
        if (throw_at_ms_.get() >= 0 && now() < time_of(throw_at_ms_.get())) {
          fault_.arm_at(time_of(throw_at_ms_.get()));
        }
      });
    }
  }

  Lines log;

 private:
  [[nodiscard]] Time time_of(double ms) const {
    return start_time() + std::chrono::nanoseconds(static_cast<std::int64_t>(ms * 1e6));
  }
  void arm() {
    while (next_ < at_ms_.get().size() && time_of(at_ms_.get()[next_]) < now()) {
      ++next_;  // Made anew in the middle of its script.
    }
    if (next_ < at_ms_.get().size()) {
      timer_.arm_at(time_of(at_ms_.get()[next_]));
    }
  }
  void publish() {
    auto loan = numbers_.loan();
    loan->set_value(static_cast<std::int64_t>(++next_));
    numbers_.publish(std::move(loan));
    arm();
  }

  Param<std::vector<double>> at_ms_;
  Param<double> throw_at_ms_;
  Publisher<Int64Value> numbers_;
  Timer timer_;
  Timer fault_;
  std::optional<Timer> first_;
  std::size_t next_ = 0;
};

/// Writes down what it receives, each with its time since the start in microseconds.
class Listener final : public Component {
 public:
  explicit Listener(Context& context) : Component(context) {
    SubscriberOptions options;
    options.on_event = [this](const QosEvent& event) {
      std::string line = fmt::format("{} {}", us(now()), word_of(event.kind));
      if (!event.publisher.empty()) {
        line += fmt::format(" {}", event.publisher);
      }
      if (!event.reason.empty()) {
        line += fmt::format(" {}", event.reason);
      }
      line += fmt::format(" {}", event.count);
      if (event.kind == QosKind::kDeadlineMissed) {
        line += fmt::format(" since {}", us(event.since));
      }
      log.push_back(line);
    };
    context.create_subscriber<Int64Value>("numbers", options, [this](const Int64Value& number) {
      log.push_back(fmt::format("{} {}", us(now()), number.value()));
    });
  }

  Lines log;

 private:
  /// In whole microseconds: a moment and the nanosecond after it read alike.
  [[nodiscard]] std::int64_t us(Time time) const { return (time - start_time()) / 1us; }
};

void add_scripted(TestClasses& classes) {
  classes.with<Script>("script").with<Listener>("listener");
}

/// What the last component wrote down after `span` of simulated time.
Lines run_listener(const std::string& text, Duration span, unsigned workers = 1) {
  TestClasses classes;
  add_scripted(classes);
  const auto application =
      make_application(text, classes, {.is_simulated = true, .workers = workers});
  application->start();
  application->advance_to(application->start_time() + span);
  Lines log = component<Listener>(*application, application->components().size() - 1).log;
  application->stop();
  for (const auto& [name, topic] : application->topics().all()) {
    for (const auto& subscription : topic->subscriptions) {
      EXPECT_TRUE(subscription->ledger().adds_up());
    }
  }
  return log;
}

std::string script_and_listener(const std::string& script, const std::string& listener,
                                const std::string& more = "") {
  return R"({"name": "t", )" + more +
         R"("components": [{"name": "talker", "library": "script", "params": {)" + script +
         R"(}}, {"name": "ear", "library": "listener", "subscribers": {"numbers": {)" + listener +
         "}}}]}";
}

// ---- Deadline ----

TEST(ADeadline, IsMissedRightAfterItIsOverAndOnceForEachPeriod) {
  const std::string text =
      script_and_listener(R"("at_ms": [10, 20, 75, 80])", R"("deadline_ms": 20)");
  const Lines expected = {
      "10000 1", "20000 2", "40000 missed 1 since 20000", "60000 missed 2 since 20000",
      "75000 3", "80000 4", "100000 missed 3 since 80000"};

  EXPECT_EQ(run_listener(text, 110ms), expected);
  EXPECT_EQ(run_listener(text, 110ms, 2), expected);
  EXPECT_EQ(run_listener(text, 110ms, 4), expected);
}

TEST(ADeadline, IsKeptByOneMessageEachPeriodExactly) {
  const std::string text =
      script_and_listener(R"("at_ms": [10, 20, 30, 40])", R"("deadline_ms": 10)");

  EXPECT_EQ(run_listener(text, 49ms), (Lines{"10000 1", "20000 2", "30000 3", "40000 4"}));
}

TEST(ADeadline, CountsFromTheStartWhereNothingEverComes) {
  const std::string text = script_and_listener("", R"("deadline_ms": 30)");

  EXPECT_EQ(run_listener(text, 70ms), (Lines{"30000 missed 1 since 0", "60000 missed 2 since 0"}));
}

TEST(ADeadline, TellsOfAStalledWorkerWhileItIsStalled) {
  /// Stalls its worker until the test lets it go.
  class Stalling final : public Component {
   public:
    explicit Stalling(Context& context)
        : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
    void serve() override {
      numbers_.publish(numbers_.loan());
      while (is_stalled) {
        std::this_thread::yield();
      }
    }
    std::atomic<bool> is_stalled{true};

   private:
    Publisher<Int64Value> numbers_;
  };
  class Watching final : public Component {
   public:
    explicit Watching(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>("numbers",
                                            {.deadline = 20ms,
                                             .on_event =
                                                 [this](const QosEvent& event) {
                                                   ++events;
                                                   periods = event.count;
                                                   is_early =
                                                       is_early || now() <= event.since + 20ms;
                                                 }},
                                            [this](const Int64Value&) { ++received; });
    }
    std::atomic<int> events{0};
    std::atomic<std::uint64_t> periods{0};
    std::atomic<bool> is_early{false};
    std::atomic<int> received{0};
  };
  TestClasses classes;
  classes.with<Stalling>("stalling").with<Watching>("watching");
  const auto application = make_application(
      R"({"name": "t", "executors": [{"name": "one"}, {"name": "other"}], "components": [
        {"name": "stalling", "library": "stalling", "executor": "one", "serve_period_ms": 5},
        {"name": "watching", "library": "watching", "executor": "other"}]})",
      classes);
  application->start();
  auto& stalling = component<Stalling>(*application, 0);
  auto& watching = component<Watching>(*application, 1);

  wait_until([&] { return watching.events >= 3; });
  EXPECT_EQ(watching.received, 1) << "the one that was published before the stall";
  EXPECT_GE(watching.periods, static_cast<std::uint64_t>(watching.events));
  EXPECT_FALSE(watching.is_early);
  stalling.is_stalled = false;
  wait_until([&] { return watching.received > 10; });
  application->stop();
}

TEST(ADeadline, EndsWithItsSubscriptionAndBeginsAnewWithTheNextOne) {
  class Changing final : public Component {
   public:
    explicit Changing(Context& context) : Component(context) {}
    void serve() override {
      ++calls_;
      if (calls_ == 1 || calls_ == 7) {  // At 10 ms and at 70 ms.
        subscriber_ = context().create_subscriber<Int64Value>(
            "numbers",
            {.deadline = 15ms,
             .on_event =
                 [this](const QosEvent& event) {
                   log.push_back(fmt::format("{} {}", (now() - start_time()) / 1us, event.count));
                   if (event.count == 2) {
                     subscriber_.reset();
                   }
                 }},
            [](const Int64Value&) {});
      }
    }
    Lines log;

   private:
    std::optional<Subscriber> subscriber_;
    int calls_ = 0;
  };
  TestClasses classes;
  add_scripted(classes);
  classes.with<Changing>("changing");
  const auto application = make_application(
      R"({"name": "t", "components": [{"name": "talker", "library": "script"},
        {"name": "changing", "library": "changing", "serve_period_ms": 10}]})",
      classes, {.is_simulated = true});
  application->start();
  application->advance_to(application->start_time() + 110ms);

  EXPECT_EQ(component<Changing>(*application, 1).log,
            (Lines{"25000 1", "40000 2", "85000 3", "100000 4"}));
  application->stop();
}

TEST(ADeadline, IsInTheReportAlsoWithoutACallback) {
  class Deaf final : public Component {
   public:
    explicit Deaf(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) {});
    }
  };
  TestClasses classes;
  add_scripted(classes);
  classes.with<Deaf>("deaf");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "talker", "library": "script", "params": {"at_ms": [10]}},
        {"name": "deaf", "library": "deaf", "subscribers": {"numbers": {"deadline_ms": 20}}}]})",
      classes, {.is_simulated = true});
  application->start();
  application->advance_to(application->start_time() + 75ms);
  application->stop();

  const RunReport report = make_report(*application, 1s);
  EXPECT_EQ(to_json(report)["topics"]["numbers"]["subscribers"][0]["quality"]["deadlines_missed"],
            3);
  EXPECT_NE(to_table(report).find("3 deadlines missed"), std::string::npos) << to_table(report);
}

TEST(ADeadline, ThatAPublisherOffersIsReportedToItsOwnComponent) {
  TestClasses classes;
  add_scripted(classes);
  for (const unsigned workers : {1U, 2U, 4U}) {
    const auto application = make_application(
        R"({"name": "t", "components": [
          {"name": "talker", "library": "script", "params": {"at_ms": [10, 20, 60]},
           "publishers": {"numbers": {"deadline_ms": 15}}},
          {"name": "ear", "library": "listener"}]})",
        classes, {.is_simulated = true, .workers = workers});
    application->start();
    application->advance_to(application->start_time() + 80ms);

    EXPECT_EQ(component<Script>(*application, 0).log,
              (Lines{"35000 missed 1 since 20000", "50000 missed 2 since 20000",
                     "75000 missed 3 since 60000"}));
    application->stop();
    const auto json = to_json(make_report(*application, 1s));
    EXPECT_EQ(json["topics"]["numbers"]["offered"][0]["missed"], 3);
  }
}

TEST(ADeadline, ThatIsShorterThanTheOneOfferedIsAWarningThatNamesBoth) {
  TestClasses classes;
  add_scripted(classes);
  config::Problems problems;
  Application application(describe_text(R"({"name": "t", "components": [
        {"name": "talker", "library": "script", "publishers": {"numbers": {"deadline_ms": 15}}},
        {"name": "ear", "library": "listener", "subscribers": {"numbers": {"deadline_ms": 10}}},
        {"name": "eye", "library": "listener", "subscribers": {"numbers": {"deadline_ms": 15}}}]})",
                                        problems),
                          {.is_simulated = true});
  application.build(classes, problems, ConstructorFault::kError);

  ASSERT_EQ(problems.all().size(), 1U);
  EXPECT_TRUE(problems.all().front().warning);
  EXPECT_EQ(problems.all().front().message,
            "component \"ear\" wants a message of \"numbers\" every 10 ms, component \"talker\" "
            "promises one only every 15 ms");
  EXPECT_FALSE(problems.has_errors());
}

// ---- Lifespan ----

/// Reads its view at each tick.
class Viewer final : public Component {
 public:
  explicit Viewer(Context& context)
      : Component(context), latest_(context.create_latest<Int64Value>("numbers")) {}
  void serve() override {
    const auto newest = latest_.get();
    log.push_back(fmt::format("{} {}", (now() - start_time()) / 1us,
                              newest ? std::to_string(newest->value()) : "none"));
  }
  Lines log;

 private:
  Latest<Int64Value> latest_;
};

TEST(ALifespan, EndsWhatAViewShows) {
  TestClasses classes;
  add_scripted(classes);
  classes.with<Viewer>("viewer");
  for (const std::string where : {R"("topics": {"numbers": {"lifespan_ms": 15}}, )", ""}) {
    const std::string own =
        where.empty() ? R"(, "subscribers": {"numbers": {"lifespan_ms": 15}})" : "";
    const auto application = make_application(R"({"name": "t", )" + where + R"("components": [
          {"name": "talker", "library": "script", "params": {"at_ms": [5, 12, 41]}},
          {"name": "viewer", "library": "viewer", "serve_period_ms": 20)" +
                                                  own + "}]}",
                                              classes, {.is_simulated = true});
    application->start();
    application->advance_to(application->start_time() + 65ms);

    // At 20 ms the first has been superseded; at 60 ms the third comes too late to be shown.
    EXPECT_EQ(component<Viewer>(*application, 1).log,
              (Lines{"20000 2", "40000 none", "60000 none"}));
    application->stop();
    const Ledger ledger = ledger_of(*application, "numbers", "viewer");
    EXPECT_EQ(ledger.published, 3U);
    EXPECT_EQ(ledger.delivered, 1U);
    EXPECT_EQ(dropped(ledger, DropReason::kSuperseded), 1U);
    EXPECT_EQ(dropped(ledger, DropReason::kExpired), 1U);
    EXPECT_TRUE(ledger.adds_up());
  }
}

TEST(ALifespan, DropsWhatWaitedTooLongAndTheLedgerAddsUp) {
  /// Holds its worker in the first message until what waits behind it is old.
  class Slow final : public Component {
   public:
    explicit Slow(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>("numbers",
                                            {.depth = 64,
                                             .lifespan = 10ms,
                                             .on_event =
                                                 [this](const QosEvent& event) {
                                                   if (event.kind == QosKind::kMessageExpired) {
                                                     expired = event.count;
                                                   }
                                                 }},
                                            [this](const Int64Value& number) {
                                              last = number.value();
                                              while (!may_go_on) {
                                                std::this_thread::yield();
                                              }
                                            });
    }
    std::atomic<std::uint64_t> expired{0};
    std::atomic<std::int64_t> last{0};
    std::atomic<bool> may_go_on{false};
  };
  /// Publishes as often as the test asks for.
  class Asked final : public Component {
   public:
    explicit Asked(Context& context)
        : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
    void serve() override {
      for (; published < asked_for; ++published) {
        auto loan = numbers_.loan();
        loan->set_value(published + 1);
        numbers_.publish(std::move(loan));
        last_ns = (now() - start_time()).count();
      }
      now_ns = (now() - start_time()).count();
    }
    std::atomic<std::int64_t> asked_for{0};
    std::atomic<std::int64_t> published{0};
    std::atomic<std::int64_t> last_ns{0};
    std::atomic<std::int64_t> now_ns{0};

   private:
    Publisher<Int64Value> numbers_;
  };
  TestClasses classes;
  classes.with<Asked>("asked").with<Slow>("slow");
  const auto application = make_application(
      R"({"name": "t", "executors": [{"name": "one"}, {"name": "other"}], "components": [
        {"name": "asked", "library": "asked", "executor": "one", "serve_period_ms": 1},
        {"name": "slow", "library": "slow", "executor": "other"}]})",
      classes);
  application->start();
  auto& asked = component<Asked>(*application, 0);
  auto& slow = component<Slow>(*application, 1);

  std::int64_t first = 0;  // The first may expire too, on a machine that is busy.
  while (slow.last == 0) {
    asked.asked_for = ++first;
    wait_until([&] { return slow.last == first || slow.expired >= static_cast<unsigned>(first); });
  }
  const std::uint64_t expired_before = slow.expired;
  asked.asked_for = first + 20;
  wait_until(
      [&] { return asked.published == first + 20 && asked.now_ns > asked.last_ns + 11'000'000; });
  slow.may_go_on = true;
  wait_until([&] { return slow.expired == expired_before + 20; });
  application->stop();

  const Ledger ledger = ledger_of(*application, "numbers", "slow");
  EXPECT_EQ(ledger.published, static_cast<std::uint64_t>(first) + 20);
  EXPECT_EQ(ledger.delivered, 1U);
  EXPECT_EQ(dropped(ledger, DropReason::kExpired), static_cast<std::uint64_t>(first) + 19);
  EXPECT_TRUE(ledger.adds_up());
}

// ---- Liveliness ----

TEST(Liveliness, IsLostWithAFaultAndWithTheOrderlyStop) {
  const std::string text = R"({"name": "t", "components": [
    {"name": "ear", "library": "listener"},
    {"name": "brief", "library": "script", "remap": {"numbers": "other"}},
    {"name": "talker", "library": "script", "params": {"at_ms": [10], "throw_at_ms": 12}}]})";
  TestClasses classes;
  add_scripted(classes);
  for (const unsigned workers : {1U, 2U, 4U}) {
    const auto application =
        make_application(text, classes, {.is_simulated = true, .workers = workers});
    application->start();
    application->advance_to(application->start_time() + 20ms);
    EXPECT_EQ(component<Listener>(*application, 0).log,
              (Lines{"10000 1", "12000 lost talker failed 1"}));
    application->stop();
  }
}

TEST(Liveliness, IsLostWhenThePublisherStops) {
  class Keeper final : public Component {
   public:
    explicit Keeper(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>(
          "numbers",
          {.on_event =
               [this](const QosEvent& event) {
                 report("lost", std::string(event.publisher) + " " + std::string(event.reason));
               }},
          [](const Int64Value&) {});
    }
  };
  TestClasses classes;
  add_scripted(classes);
  classes.with<Keeper>("keeper");
  for (const bool is_simulated : {true, false}) {
    // Components stop in reverse order: this one still runs when the other stops.
    const auto application = make_application(
        R"({"name": "t", "components": [{"name": "keeper", "library": "keeper"},
                                        {"name": "talker", "library": "script"}]})",
        classes, {.is_simulated = is_simulated});
    application->start();
    application->stop();

    EXPECT_EQ(application->components()[0]->results.at("lost"),
              ReportValue(std::string("talker stopped")));
  }
}

TEST(Liveliness, IsLostAndGainedWithARestart) {
  const std::string text = R"({"name": "t", "components": [
    {"name": "talker", "library": "script", "on_fault": "restart",
     "params": {"at_ms": [10, 20], "throw_at_ms": 12}},
    {"name": "ear", "library": "listener"}]})";
  const Lines expected = {"10000 1", "12000 lost talker failed 1",
                          "12000 gained talker restarted 1", "20000 2"};
  for (const unsigned workers : {1U, 2U, 4U}) {
    EXPECT_EQ(run_listener(text, 30ms, workers), expected);
  }
}

TEST(Liveliness, IsLostByAPublisherThatIsSilentLongerThanItsLeaseAndGainedByAMessage) {
  const std::string text = R"({"name": "t", "topics": {"numbers": {"multiple_publishers": true}},
    "components": [
    {"name": "one", "library": "script", "params": {"at_ms": [10, 20, 90]}},
    {"name": "two", "library": "script", "params": {"at_ms": [15, 35, 55, 75, 95]}},
    {"name": "ear", "library": "listener",
     "subscribers": {"numbers": {"liveliness_ms": 25, "deadline_ms": 25}}}]})";
  const Lines expected = {"10000 1",
                          "15000 1",
                          "20000 2",
                          "35000 2",
                          "45000 lost one silent 1",
                          "55000 3",
                          "75000 4",
                          "90000 gained one publishes 1",
                          "90000 3",
                          "95000 5",
                          "115000 lost one silent 2",
                          "120000 missed 1 since 95000",
                          "120000 lost two silent 3"};
  for (const unsigned workers : {1U, 2U, 4U}) {
    EXPECT_EQ(run_listener(text, 130ms, workers), expected);
  }
}

// ---- Messages that are missing ----

TEST(AnEvent, SaysHowManyMessagesAreMissingBeforeTheNext) {
  class Burst final : public Component {
   public:
    explicit Burst(Context& context)
        : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
    void serve() override {
      for (int i = 0; i < 5; ++i) {
        auto loan = numbers_.loan();
        loan->set_value(++sent_);
        numbers_.publish(std::move(loan));
      }
    }

   private:
    Publisher<Int64Value> numbers_;
    std::int64_t sent_ = 0;
  };
  TestClasses classes;
  add_scripted(classes);
  classes.with<Burst>("burst");
  const auto application = make_application(
      R"({"name": "t", "components": [
        {"name": "burst", "library": "burst", "serve_period_ms": 10},
        {"name": "ear", "library": "listener", "subscribers": {"numbers": {"depth": 2}}}]})",
      classes, {.is_simulated = true});
  application->start();
  application->advance_to(application->start_time() + 25ms);

  EXPECT_EQ(component<Listener>(*application, 1).log,
            (Lines{"10000 4", "10000 5", "20000 missing burst 3", "20000 9", "20000 10"}));
  application->stop();
}

// ---- Latched messages for who comes late ----

/// Publishes 1, 2, 3, … on "numbers" at each tick of its Serve Timer.
class Talker final : public Component {
 public:
  explicit Talker(Context& context)
      : Component(context),
        first_(context.param<std::int64_t>("first", {.fallback = 1})),
        numbers_(context.create_publisher<Int64Value>("numbers")),
        sent_(first_.get() - 1) {}
  void serve() override {
    auto loan = numbers_.loan();
    loan->set_value(++sent_);
    numbers_.publish(std::move(loan));
    published = sent_;
  }
  std::atomic<std::int64_t> published{0};

 private:
  Param<std::int64_t> first_;
  Publisher<Int64Value> numbers_;
  std::int64_t sent_;
};

/// Subscribes at each of its ticks "join_at", with "history", "depth" and "drop_newest".
class Joiner final : public Component {
 public:
  explicit Joiner(Context& context)
      : Component(context),
        join_at_(context.param<std::vector<std::int64_t>>("join_at")),
        history_(context.param<std::uint64_t>("history", {.fallback = 1024})),
        depth_(context.param<std::uint64_t>("depth", {.fallback = 16})),
        drops_newest_(context.param<bool>("drop_newest", {.fallback = false})) {}
  void serve() override {
    if (std::ranges::find(join_at_.get(), ++ticks_) == join_at_.get().end()) {
      return;
    }
    subscriber_.reset();
    received.emplace_back();
    subscriber_ = context().create_subscriber<Int64Value>(
        "numbers",
        {.depth = depth_.get(),
         .overflow = drops_newest_.get() ? Overflow::kDropNewest : Overflow::kDropOldest,
         .history = history_.get()},
        [this](const Int64Value& number) { received.back().push_back(number.value()); });
  }
  std::vector<Numbers> received;

 private:
  Param<std::vector<std::int64_t>> join_at_;
  Param<std::uint64_t> history_;
  Param<std::uint64_t> depth_;
  Param<bool> drops_newest_;
  std::optional<Subscriber> subscriber_;
  std::int64_t ticks_ = 0;
};

/// What `Joiner`, the last component, received in `span`, by subscription.
std::vector<Numbers> join(const std::string& text, Duration span, unsigned workers = 1) {
  TestClasses classes;
  classes.with<Talker>("talker").with<Joiner>("joiner");
  const auto application =
      make_application(text, classes, {.is_simulated = true, .workers = workers});
  application->start();
  application->advance_to(application->start_time() + span);
  auto received = component<Joiner>(*application, application->components().size() - 1).received;
  application->stop();
  EXPECT_TRUE(ledger_of(*application, "numbers", "joiner").adds_up());
  return received;
}

std::string talker_and_joiner(const std::string& topic, const std::string& joiner) {
  return R"({"name": "t", "topics": {"numbers": {)" + topic + R"(}}, "components": [
    {"name": "talker", "library": "talker", "serve_period_ms": 10},
    {"name": "joiner", "library": "joiner", "serve_period_ms": 11, "params": {)" +
         joiner + "}}]}";
}

TEST(ALatchedTopic, GivesALateJoinerTheLastMessagesOnceAndInOrder) {
  // It comes at 55 ms, when 5 were published.
  const std::string text = talker_and_joiner(R"("latched": 3)", R"("join_at": [5])");
  for (const unsigned workers : {1U, 2U, 4U}) {
    EXPECT_EQ(join(text, 75ms, workers), (std::vector<Numbers>{{3, 4, 5, 6, 7}}));
  }
}

TEST(ALatchedTopic, GivesAgainToWhoSubscribesAgain) {
  const std::string text = talker_and_joiner(R"("latched": 2)", R"("join_at": [2, 5])");

  EXPECT_EQ(join(text, 65ms), (std::vector<Numbers>{{1, 2, 3, 4, 5}, {4, 5, 6}}));
}

TEST(ALatchedTopic, GivesOnlyAsManyAsTheSubscriberAsksFor) {
  const auto with = [](const std::string& wishes) {
    return join(talker_and_joiner(R"("latched": 4)", R"("join_at": [5], )" + wishes), 65ms).at(0);
  };
  EXPECT_EQ(with(R"("history": 2)"), (Numbers{4, 5, 6}));
  EXPECT_EQ(with(R"("history": 0)"), (Numbers{6}));
  EXPECT_EQ(with(R"("history": 4)"), (Numbers{2, 3, 4, 5, 6}));
}

TEST(ALatchedTopic, GivesTheNewestThatFitIntoAQueueWhateverThatDropsLater) {
  const auto with = [](const std::string& wishes) {
    return join(talker_and_joiner(R"("latched": 4)", R"("join_at": [5], )" + wishes), 65ms).at(0);
  };
  EXPECT_EQ(with(R"("depth": 2)"), (Numbers{4, 5, 6}));
  EXPECT_EQ(with(R"("depth": 2, "drop_newest": true)"), (Numbers{4, 5, 6}));
}

TEST(ALatchedTopic, GivesNothingThatIsTooOld) {
  const std::string text =
      talker_and_joiner(R"("latched": 4, "lifespan_ms": 20)", R"("join_at": [5])");

  // At 55 ms: those of 40 ms and 50 ms.
  EXPECT_EQ(join(text, 65ms), (std::vector<Numbers>{{4, 5, 6}}));
}

TEST(ALatchedTopic, GivesTheLastOfEachOfSeveralPublishers) {
  const std::string text = R"({"name": "t",
    "topics": {"numbers": {"latched": 2, "multiple_publishers": true}}, "components": [
    {"name": "a", "library": "talker", "serve_period_ms": 10},
    {"name": "b", "library": "talker", "serve_period_ms": 20, "serve_phase_ms": 3,
     "params": {"first": 101}},
    {"name": "joiner", "library": "joiner", "serve_period_ms": 11, "params": {"join_at": [5]}}]})";
  for (const unsigned workers : {1U, 2U, 4U}) {
    // In the order in which they were published: at 23, 40, 43, 50; then 60, 63.
    EXPECT_EQ(join(text, 65ms, workers), (std::vector<Numbers>{{101, 4, 102, 5, 6, 103}}));
  }
}

TEST(ALatchedTopic, IsGivenAgainToARestartedComponent) {
  /// Forgets all when it is made anew.
  class Forgetful final : public Component {
   public:
    explicit Forgetful(Context& context) : Component(context) {
      context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
        received.push_back(number.value());
        if (number.value() == 4 && received.front() == 1) {
          throw std::runtime_error("4 is too much");
        }
      });
    }
    Numbers received;
  };
  TestClasses classes;
  classes.with<Talker>("talker").with<Forgetful>("forgetful");
  for (const unsigned workers : {1U, 2U, 4U}) {
    const auto application = make_application(
        R"({"name": "t", "topics": {"numbers": {"latched": 3}}, "components": [
          {"name": "talker", "library": "talker", "serve_period_ms": 10},
          {"name": "forgetful", "library": "forgetful", "on_fault": "restart"}]})",
        classes, {.is_simulated = true, .workers = workers});
    application->start();
    application->advance_to(application->start_time() + 65ms);

    EXPECT_EQ(component<Forgetful>(*application, 1).received, (Numbers{2, 3, 4, 5, 6}));
    application->stop();
    EXPECT_TRUE(ledger_of(*application, "numbers", "forgetful").adds_up());
  }
}

TEST(ALatchedTopic, OfAnExternalPublisherGivesTheLastMessagesToo) {
  class Device final : public Component {
   public:
    explicit Device(Context& context)
        : Component(context), numbers_(context.create_external_publisher<Int64Value>("numbers")) {
      context.create_thread("device", [this](const std::stop_token& stop) {
        std::int64_t sent = 0;
        while (!stop.stop_requested()) {
          auto loan = numbers_.loan();
          loan->set_value(++sent);
          numbers_.publish(std::move(loan), kSimulatedStart);
          published = sent;
          std::this_thread::sleep_for(50us);
        }
      });
    }
    std::atomic<std::int64_t> published{0};

   private:
    ExternalPublisher<Int64Value> numbers_;
  };
  /// Joins once the device has published 10, and checks what it is given.
  class Late final : public Component {
   public:
    explicit Late(Context& context) : Component(context) {}
    void serve() override {
      if (!has_joined_ && device->published >= 10) {
        has_joined_ = true;
        before_ = device->published;
        context().create_subscriber<Int64Value>(
            "numbers", {.depth = 4096, .history = 5}, [this](const Int64Value& number) {
              is_right = is_right && (received == 0 ? number.value() > before_ - 5
                                                    : number.value() == last_ + 1);
              last_ = number.value();
              ++received;
            });
      }
    }
    const Device* device = nullptr;
    std::atomic<bool> is_right{true};
    std::atomic<int> received{0};

   private:
    bool has_joined_ = false;
    std::int64_t before_ = 0;
    std::int64_t last_ = 0;
  };
  TestClasses classes;
  classes.with<Device>("device").with<Late>("late");
  const auto application = make_application(
      R"({"name": "t", "topics": {"numbers": {"latched": 8}}, "components": [
        {"name": "device", "library": "device"},
        {"name": "late", "library": "late", "serve_period_ms": 1}]})",
      classes);
  component<Late>(*application, 1).device = &component<Device>(*application, 0);
  application->start();
  auto& late = component<Late>(*application, 1);
  wait_until([&] { return late.received > 50; });
  const bool is_right = late.is_right;
  application->stop();

  EXPECT_TRUE(is_right);
}

// ---- Many of them, live ----

/// Publishes without a rest on four topics that keep 1, 3, 8 and 64 messages.
class Fountain final : public Component {
 public:
  explicit Fountain(Context& context) : Component(context) {
    for (int i = 0; i < 4; ++i) {
      numbers_.push_back(context.create_publisher<Int64Value>("n" + std::to_string(i)));
    }
  }
  void serve() override {
    const std::size_t count = random_() % 4;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t topic = random_() % 4;
      auto loan = numbers_[topic].loan();
      loan->set_value(published[topic] + 1);
      numbers_[topic].publish(std::move(loan));
      ++published[topic];
    }
  }
  std::array<std::atomic<std::int64_t>, 4> published{};

 private:
  std::vector<Publisher<Int64Value>> numbers_;
  std::mt19937_64 random_{11};
};

/// Comes late and goes again, 500 times, each time with other wishes.
class Restless final : public Component {
 public:
  explicit Restless(Context& context) : Component(context) {}

  void serve() override {
    if (joins == 500) {
      return;
    }
    if (subscriber_) {
      if (received_ > kept() + enough_) {
        end();
      }
      return;
    }
    topic_ = random_() % 4;
    enough_ = random_() % 8;
    history_ = random_() % (kLatched[topic_] + 1);
    depth_ = random_() % 2 == 0 ? 4096 : 1 + random_() % 16;
    received_ = 0;
    before_ = fountain->published[topic_];
    if (before_ < 64) {
      return;  // Not all that is kept is there.
    }
    subscriber_ = context().create_subscriber<Int64Value>(
        "n" + std::to_string(topic_),
        {.depth = depth_,
         .overflow = random_() % 2 == 0 ? Overflow::kDropOldest : Overflow::kDropNewest,
         .history = history_},
        [this](const Int64Value& number) { take(number.value()); });
  }

  const Fountain* fountain = nullptr;
  std::atomic<int> joins{0};
  std::atomic<int> errors{0};
  std::atomic<int> exact{0};  ///< Joins at which nothing was published meanwhile.

 private:
  static constexpr std::array<std::size_t, 4> kLatched = {1, 3, 8, 64};

  [[nodiscard]] std::size_t kept() const { return std::min(history_, depth_); }

  void take(std::int64_t number) {
    if (received_++ == 0) {
      // What was published when it subscribed, and what is now, bound what it may be given first.
      const auto given = static_cast<std::int64_t>(kept());
      const std::int64_t after = fountain->published[topic_] + 1;  // One may be under way.
      const bool is_right =
          number >= before_ - given + 1 && (number <= after - given + 1 || depth_ < 4096);
      errors += is_right ? 0 : 1;
      exact += after == before_ + 1 && given > 0 ? 1 : 0;
    } else {
      errors += number > last_ && (number == last_ + 1 || depth_ < 4096) ? 0 : 1;
    }
    last_ = number;
  }

  void end() {
    subscriber_.reset();
    ++joins;
  }

  std::mt19937_64 random_{7};
  std::optional<Subscriber> subscriber_;
  std::size_t topic_ = 0;
  std::size_t enough_ = 0;
  std::size_t history_ = 0;
  std::size_t depth_ = 0;
  std::size_t received_ = 0;
  std::int64_t before_ = 0;
  std::int64_t last_ = 0;
};

constexpr const char* kRestless = R"({"name": "t",
  "topics": {"n0": {"latched": 1}, "n1": {"latched": 3}, "n2": {"latched": 8},
             "n3": {"latched": 64}},
  "executors": [{"name": "a"}, {"name": "b"}, {"name": "c", "threads": 2}], "components": [
  {"name": "fountain", "library": "fountain", "executor": "a", "serve_period_ms": 0.1},
  {"name": "one", "library": "restless", "executor": "b", "serve_period_ms": 0.11},
  {"name": "two", "library": "restless", "executor": "c", "serve_period_ms": 0.13}]})";

TEST(ManyLateJoiners, AreGivenTheLastMessagesOnceAndInOrderWhilePublishersRun) {
  TestClasses classes;
  classes.with<Fountain>("fountain").with<Restless>("restless");
  for (const bool is_simulated : {true, false}) {
    const auto application = make_application(kRestless, classes, {.is_simulated = is_simulated});
    std::vector<Restless*> late;
    for (const std::size_t index : {1U, 2U}) {
      late.push_back(&component<Restless>(*application, index));
      late.back()->fountain = &component<Fountain>(*application, 0);
    }
    const auto is_done = [&] { return late[0]->joins == 500 && late[1]->joins == 500; };
    application->start();
    if (is_simulated) {
      for (int i = 0; i < 6000 && !is_done(); ++i) {
        application->advance_to(application->clock().now() + 1ms);
      }
      EXPECT_TRUE(is_done());
    } else {
      wait_until(is_done);
    }
    int exact = 0;
    for (const Restless* one : late) {
      EXPECT_EQ(one->errors, 0);
      exact += one->exact;
    }
    EXPECT_GT(exact, 0) << "some came while nothing was published, and left no doubt";
    application->stop();
    for (const auto& [name, topic] : application->topics().all()) {
      for (const auto& subscription : topic->subscriptions) {
        EXPECT_TRUE(subscription->ledger().adds_up());
      }
    }
  }
}

// ---- The file ----

TEST(QualityOfService, ErrorsInTheFileAreNamed) {
  const auto error = [](const std::string& topics, const std::string& subscriber) {
    config::Problems problems;
    static_cast<void>(describe_text(R"({"name": "t", "topics": {)" + topics + R"(},
      "components": [{"name": "ear", "library": "x", "subscribers": {"numbers": {)" +
                                        subscriber + "}}}]}",
                                    problems));
    return problems.all().empty() ? "" : problems.all().front().message;
  };
  EXPECT_EQ(error("", R"("history": 2)"),
            "a \"history\" of 2, but the topic \"numbers\" is not latched");
  EXPECT_EQ(error(R"("numbers": {"latched": 1})", R"("history": 2)"),
            "a \"history\" of 2, but the topic \"numbers\" keeps only 1");
  EXPECT_EQ(error(R"("numbers": {"latched": 2})", R"("history": 2)"), "");
}

}  // namespace
}  // namespace fastcycle::host
