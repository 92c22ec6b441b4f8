#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "executor/test_synchronization.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/application.h"
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using detail::DropReason;
using detail::Ledger;
using google::protobuf::Int64Value;
using namespace std::chrono_literals;

std::uint64_t dropped(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

Int64Value number(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message;
}

std::int64_t taken_ns(const MessageInfo& info) {
  return (info.origin.taken - kSimulatedStart).count();
}

/// Publishes on "out" the numbers 0, 1, 2, …: number i at `arrives_us[i]`, taken at `taken_us[i]`,
/// both since the start of simulated time.
class Sensor final : public Component {
 public:
  explicit Sensor(Context& context)
      : Component(context),
        arrives_us_(context.param<std::vector<std::int64_t>>("arrives_us")),
        taken_us_(context.param<std::vector<std::int64_t>>("taken_us")),
        out_(context.create_publisher<Int64Value>("out")),
        timer_(context.create_timer([this] { publish(); })) {}

  void start() override { arm(); }

 private:
  void arm() {
    if (next_ < arrives_us_.get().size()) {
      timer_.arm_at(kSimulatedStart + std::chrono::microseconds(arrives_us_.get()[next_]));
    }
  }
  void publish() {
    auto loan = out_.loan();
    loan->set_value(static_cast<std::int64_t>(next_));
    out_.publish(std::move(loan),
                 {.taken_at = kSimulatedStart + std::chrono::microseconds(taken_us_.get()[next_])});
    ++next_;
    arm();
  }

  Param<std::vector<std::int64_t>> arrives_us_;
  Param<std::vector<std::int64_t>> taken_us_;
  Publisher<Int64Value> out_;
  Timer timer_;
  std::size_t next_ = 0;
};

/// One message as it arrived, by its topic and its number.
struct Arrived {
  std::size_t topic;
  std::size_t number;
  std::int64_t taken_ns;
};

constexpr std::array kTopics{"t0", "t1", "t2", "t3"};

/// Notes what arrives on the topics, in its order.
class ArrivalProbe final : public Component {
 public:
  explicit ArrivalProbe(Context& context) : Component(context) {
    const auto topics = context.param<std::int64_t>("topics", {.fallback = 2});
    for (std::size_t topic = 0; topic < static_cast<std::size_t>(topics.get()); ++topic) {
      context.create_subscriber<Int64Value>(
          kTopics[topic], {.depth = 64}, [this, topic](const Sample<Int64Value>& sample) {
            arrived.push_back({topic, static_cast<std::size_t>(sample->value()),
                               fastcycle::host::taken_ns(sample.info())});
          });
    }
  }

  std::vector<Arrived> arrived;
};

/// Synchronizes the topics, and publishes on "sets" how many sets there were.
class Fusion final : public Component {
 public:
  explicit Fusion(Context& context)
      : Component(context),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = -1})),
        sets_(context.create_publisher<Int64Value>("sets")) {
    const auto topics = context.param<std::int64_t>("topics", {.fallback = 2});
    const SynchronizerOptions options{
        .policy =
            context
                .param<SyncPolicy>("policy", {.fallback = SyncPolicy::kExact,
                                              .names = {{"exact", SyncPolicy::kExact},
                                                        {"approximate", SyncPolicy::kApproximate},
                                                        {"latest", SyncPolicy::kLatest}}})
                .get(),
        .max_difference = std::chrono::microseconds(
            context.param<std::int64_t>("max_difference_us", {.fallback = 0}).get()),
        .depth =
            static_cast<std::size_t>(context.param<std::int64_t>("depth", {.fallback = 8}).get())};
    using Number = Sample<Int64Value>;
    if (topics.get() == 2) {
      context.create_synchronizer<Int64Value, Int64Value>(
          {"t0", "t1"}, options, [this](const Number& a, const Number& b) { on_set({a, b}); });
    } else if (topics.get() == 3) {
      context.create_synchronizer<Int64Value, Int64Value, Int64Value>(
          {"t0", "t1", "t2"}, options,
          [this](const Number& a, const Number& b, const Number& c) { on_set({a, b, c}); });
    } else {
      context.create_synchronizer<Int64Value, Int64Value, Int64Value, Int64Value>(
          {"t0", "t1", "t2", "t3"}, options,
          [this](const Number& a, const Number& b, const Number& c, const Number& d) {
            on_set({a, b, c, d});
          });
    }
  }

  std::vector<std::vector<std::size_t>> sets;  ///< The numbers of the members.
  std::vector<Time> called_at;
  std::vector<Time> oldest;

 private:
  void on_set(const std::vector<Sample<Int64Value>>& members) {
    std::vector<std::size_t> numbers;
    Time its_oldest = Time::max();
    for (const auto& member : members) {
      numbers.push_back(static_cast<std::size_t>(member->value()));
      its_oldest = std::min(its_oldest, member.info().origin.taken);
    }
    sets.push_back(numbers);
    called_at.push_back(now());
    oldest.push_back(its_oldest);
    auto loan = sets_.loan();
    loan->set_value(static_cast<std::int64_t>(sets.size()));
    sets_.publish(std::move(loan));
    if (static_cast<std::int64_t>(sets.size()) == throws_at_.get()) {
      throw std::runtime_error("on purpose");
    }
  }

  Param<std::int64_t> throws_at_;
  Publisher<Int64Value> sets_;
};

/// Notes the origin of what it receives on "sets".
class Origins final : public Component {
 public:
  explicit Origins(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("sets", [this](const Sample<Int64Value>& sample) {
      taken.push_back(sample.info().origin.taken);
    });
  }
  std::vector<Time> taken;
};

TestClasses& classes() {
  static TestClasses all;
  all.with<Sensor>("sensor").with<ArrivalProbe>("probe").with<Fusion>("fusion").with<Origins>(
      "origins");
  return all;
}

template <typename T>
T& component(const Application& application, std::size_t index) {
  return static_cast<T&>(*application.components()[index]->component);
}

std::string list(const std::vector<int>& values) {
  std::string text;
  for (const int value : values) {
    text += (text.empty() ? "" : ", ") + std::to_string(value);
  }
  return "[" + text + "]";
}

/// When the messages of one topic come, and when they were taken.
struct Stream {
  std::vector<int> arrives_us;
  std::vector<int> taken_us;
};

/// A fusion (component 0), who sees its origins (1) and its inputs (2), and a sensor for each
/// stream.
std::string fusion_of(const std::vector<Stream>& streams, const std::string& params,
                      const std::string& more = {}) {
  const std::string topics = R"("topics": )" + std::to_string(streams.size());
  std::string text = R"({"name": "t", "components": [
    {"name": "fusion", "library": "fusion", "params": {)" +
                     topics + ", " + params + "}" + more + R"(},
    {"name": "origins", "library": "origins"},
    {"name": "probe", "library": "probe", "params": {)" +
                     topics + "}}";
  for (std::size_t i = 0; i < streams.size(); ++i) {
    text += R"(, {"name": "s)" + std::to_string(i) +
            R"(", "library": "sensor", "remap": {"out": ")" + kTopics[i] +
            R"("}, "params": {"arrives_us": )" + list(streams[i].arrives_us) + R"(, "taken_us": )" +
            list(streams[i].taken_us) + "}}";
  }
  return text + "]}";
}

Ledger fusion_ledger(Application& application, std::size_t topic) {
  return ledger_of(application, kTopics[topic], "fusion");
}

/// Every message of the publisher on `topic` came back. @pre The application has stopped.
bool is_whole(Application& application, const std::string& topic) {
  detail::PublisherCore& publisher = *application.topics().find(topic)->publishers.front();
  const std::uint64_t made = publisher.allocated();
  // Nobody gets it any more; but now the pool takes over all that came back before.
  publisher.deliver(publisher.loan(false));
  std::vector<detail::Envelope*> loans;
  while (publisher.allocated() == made) {
    loans.push_back(publisher.loan(false));
  }
  for (detail::Envelope* loan : loans) {
    publisher.return_loan(loan);
  }
  return loans.size() == made;  // All but the first, and the one that had to be made.
}

const std::vector<Stream> kTenEach{{{0, 100, 200, 300, 400, 500, 600, 700, 800, 900},
                                    {0, 100, 200, 300, 400, 500, 600, 700, 800, 900}},
                                   {{30, 130, 230, 330, 430, 530, 630, 730, 830, 930},
                                    {20, 120, 220, 320, 420, 520, 620, 720, 820, 920}}};
constexpr const char* kWithin30 = R"("policy": "approximate", "max_difference_us": 30)";

TEST(ASynchronizer, CallsBackWhenTheLaterOfTwoArrives) {
  const auto application =
      make_application(fusion_of(kTenEach, kWithin30), classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);

  const auto& fusion = component<Fusion>(*application, 0);
  ASSERT_EQ(fusion.sets.size(), 10U);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(fusion.sets[i], (std::vector<std::size_t>{i, i}));
    EXPECT_EQ(fusion.called_at[i],
              kSimulatedStart + std::chrono::microseconds(kTenEach[1].arrives_us[i]));
  }
  for (const std::size_t topic : {0U, 1U}) {
    const Ledger ledger = fusion_ledger(*application, topic);
    EXPECT_EQ(ledger.delivered, 10U);
    EXPECT_EQ(ledger.queued, 0U);
    EXPECT_TRUE(ledger.adds_up());
  }
}

TEST(ASynchronizer, GivesWhatItsCallbackPublishesTheOldestOrigin) {
  const auto application =
      make_application(fusion_of(kTenEach, kWithin30), classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);

  EXPECT_EQ(component<Origins>(*application, 1).taken, component<Fusion>(*application, 0).oldest);
  EXPECT_EQ(component<Origins>(*application, 1).taken.at(3), kSimulatedStart + 300us);
}

TEST(ASynchronizer, CountsWhatItHoldsAsQueuedUntilTheEnd) {
  const auto application = make_application(
      fusion_of({{{0, 10, 20, 30}, {0, 10, 20, 30}}, {{15}, {10}}}, R"("policy": "exact")"),
      classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);

  const Ledger held = fusion_ledger(*application, 0);
  EXPECT_EQ(held.delivered, 1U);
  EXPECT_EQ(dropped(held, DropReason::kUnmatched), 1U);
  EXPECT_EQ(held.queued, 2U);
  EXPECT_TRUE(held.adds_up());

  application->stop();

  const Ledger ended = fusion_ledger(*application, 0);
  EXPECT_EQ(ended.queued, 0U);
  EXPECT_EQ(dropped(ended, DropReason::kShutdown), 2U);
  EXPECT_TRUE(ended.adds_up());
  EXPECT_TRUE(is_whole(*application, "t0"));
  EXPECT_TRUE(is_whole(*application, "t1"));
}

/// What the report says of the fusion's subscription to the topic with this number.
std::string why_unmatched(Application& application, std::size_t topic) {
  const RunReport report = make_report(application, 1s);
  for (const TopicReport& one : report.topics) {
    for (const SubscriberReport& subscriber : one.subscribers) {
      if (one.name == kTopics[topic] && subscriber.component == "fusion") {
        std::string text;
        for (const UnmatchedReport& unmatched : subscriber.unmatched) {
          text += (text.empty() ? "" : "\n") + unmatched.text;
        }
        return text;
      }
    }
  }
  throw std::runtime_error("the fusion does not subscribe to it");
}

// Times 50 us apart, where 30 are allowed.
TEST(ASynchronizer, SaysHowFarTimesAreApartThatAreTooFar) {
  const auto application =
      make_application(fusion_of({kTenEach[0],
                                  {{60, 160, 260, 360, 460, 560, 660, 760, 860, 960},
                                   {-50, 50, 150, 250, 350, 450, 550, 650, 750, 850}}},
                                 kWithin30),
                       classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);

  EXPECT_EQ(why_unmatched(*application, 0),
            "9 unmatched: taken times of \"t0\" and \"t1\" differ by at least 0.05 ms, "
            "max_difference is 0.03 ms");
  EXPECT_EQ(why_unmatched(*application, 1),
            "10 unmatched: taken times of \"t1\" and \"t0\" differ by at least 0.05 ms, "
            "max_difference is 0.03 ms");
  const RunReport report = make_report(*application, 1s);
  EXPECT_THAT(to_table(report), ::testing::HasSubstr("differ by at least 0.05 ms"));
  EXPECT_THAT(to_json(report).dump(),
              ::testing::HasSubstr(R"({"reason":"too_far","count":9,"topic":"t1",)"
                                   R"("difference_ms":0.05,"text":"9 unmatched: )"));
}

TEST(ASynchronizer, SaysThatATopicHasHadNoMessage) {
  const auto application = make_application(fusion_of({kTenEach[0], {{}, {}}}, kWithin30),
                                            classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);
  application->stop();

  EXPECT_EQ(why_unmatched(*application, 0),
            "2 unmatched: they waited, while 8 younger ones came, for \"t1\", which has had no "
            "message\n8 waited for \"t1\", which has had no message");
  EXPECT_EQ(why_unmatched(*application, 1), "");
}

TEST(ASynchronizer, ThatMatchesAllHasNothingToSay) {
  const auto application =
      make_application(fusion_of(kTenEach, kWithin30), classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);

  EXPECT_EQ(why_unmatched(*application, 0), "");
  EXPECT_EQ(why_unmatched(*application, 1), "");
  EXPECT_EQ(to_json(make_report(*application, 1s)).dump().find("unmatched"), std::string::npos);
}

TEST(ASynchronizer, TakesTheQueuesOfTheApplicationFile) {
  const auto application = make_application(
      fusion_of(kTenEach, kWithin30,
                R"(, "subscribers": {"t0": {"depth": 3, "overflow": "drop_newest"}})"),
      classes(), {.is_simulated = true});

  const auto& subscription = *application->topics().find("t0")->subscriptions.front();
  EXPECT_EQ(subscription.depth, 3U);
  EXPECT_EQ(subscription.overflow, Overflow::kDropNewest);
  EXPECT_EQ(application->topics().find("t1")->subscriptions.front()->depth, 8U);
}

TEST(ASynchronizer, ThatFailsLeavesNoMessageBehind) {
  const auto application =
      make_application(fusion_of(kTenEach, R"("throws_at": 4, "policy": "latest")"), classes(),
                       {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);
  application->stop();

  for (const std::size_t topic : {0U, 1U}) {
    const Ledger ledger = fusion_ledger(*application, topic);
    EXPECT_EQ(ledger.delivered, 4U);
    EXPECT_EQ(ledger.queued, 0U);
    EXPECT_EQ(dropped(ledger, DropReason::kFault), topic == 0 ? 5U : 6U);
    EXPECT_TRUE(ledger.adds_up());
    EXPECT_TRUE(is_whole(*application, kTopics[topic]));
  }
}

TEST(ASynchronizer, IsDeclaredAgainWhenItsComponentIsRestarted) {
  // Each message of t0 is held for a while: a restart must let it go.
  const Stream fast{{0, 5, 100, 105, 200, 205, 300, 305}, {0, 5, 100, 105, 200, 205, 300, 305}};
  const Stream slow{{20, 120, 220, 320}, {0, 100, 200, 300}};
  const auto application = make_application(
      fusion_of({fast, slow}, R"("throws_at": 2, "policy": "exact")", R"(, "on_fault": "restart")"),
      classes(), {.is_simulated = true});
  application->start();
  application->advance_to(kSimulatedStart + 1ms);
  application->stop();

  EXPECT_EQ(application->components()[0]->restart_count, 2U);
  for (const std::size_t topic : {0U, 1U}) {
    const Ledger ledger = fusion_ledger(*application, topic);
    EXPECT_EQ(ledger.delivered, 4U);
    EXPECT_EQ(ledger.queued, 0U);
    EXPECT_TRUE(ledger.adds_up());
    EXPECT_TRUE(is_whole(*application, kTopics[topic]));
  }
  // What came while the first of each pair was held gave way to nothing but the restart.
  EXPECT_EQ(dropped(fusion_ledger(*application, 0), DropReason::kFault), 2U);
  EXPECT_EQ(dropped(fusion_ledger(*application, 0), DropReason::kUnmatched), 2U);
}

// ---- Errors ----

class Invalid final : public Component {
 public:
  explicit Invalid(Context& context) : Component(context) {
    const auto nothing = [](const Int64Value&, const Int64Value&) {};
    context.create_synchronizer<Int64Value, Int64Value>({"a", "b#request"}, {}, nothing);
    context.create_synchronizer<Int64Value, Int64Value>({"a", "a"}, {}, nothing);
    context.create_synchronizer<Int64Value, Int64Value>({"a", "b"}, {.depth = 0}, nothing);
    context.create_synchronizer<Int64Value, Int64Value>(
        {"c", "d"}, {.policy = SyncPolicy::kApproximate}, nothing);
    context.create_synchronizer<Int64Value, Int64Value>(
        {"c", "d"}, {.policy = SyncPolicy::kLatest, .max_difference = 1ms}, nothing);
  }
};

TEST(ASynchronizer, ErrorsInItAreFoundBeforeTheStart) {
  TestClasses invalid;
  invalid.with<Invalid>("invalid");
  config::Problems problems;
  Application application(
      describe_text(R"({"name": "t", "components": [{"name": "m", "library": "invalid"}]})",
                    problems),
      {.is_simulated = true});
  application.build(invalid, problems, ConstructorFault::kError);

  std::string text;
  for (const config::Problem& problem : problems.all()) {
    text += config::to_string(problem) + "\n";
  }
  for (const char* part :
       {R"(component "m" uses the name "b#request")",
        R"(component "m": its synchronizer of "a", "a" names one topic twice)",
        R"(its synchronizer of "a", "b" has depth 0)",
        R"(its synchronizer of "c", "d" has no max_difference above zero)",
        R"(its synchronizer of "c", "d" has a max_difference, which only)", "/components/0"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

// ---- In tests of components ----

class Pairs final : public Component {
 public:
  explicit Pairs(Context& context)
      : Component(context), sum_(context.create_publisher<Int64Value>("sum")) {
    context.create_synchronizer<Int64Value, Int64Value>(
        {"left", "right"}, {.policy = SyncPolicy::kExact, .time = SyncTime::kPublished},
        [this](const Int64Value& left, const Int64Value& right) {
          auto loan = sum_.loan();
          loan->set_value(left.value() + right.value());
          sum_.publish(std::move(loan));
        });
  }

 private:
  Publisher<Int64Value> sum_;
};

TEST(ASynchronizer, WorksOnABench) {
  testing::Bench bench;
  bench.add<Pairs>("pairs");
  auto left = bench.input<Int64Value>("left");
  auto right = bench.input<Int64Value>("right");
  auto sum = bench.output<Int64Value>("sum");
  bench.start();

  left.publish(number(3));
  bench.advance(1ms);
  left.publish(number(4));
  EXPECT_TRUE(sum.take().empty());
  right.publish(number(5));

  const auto sums = sum.take();
  ASSERT_EQ(sums.size(), 1U);
  EXPECT_EQ(sums[0].value(), 9);
}

// ---- Any streams, through whole applications ----

struct Outcome {
  std::vector<std::vector<std::size_t>> sets;
  std::vector<Ledger> ledgers;
  std::vector<Arrived> arrived;
};

/// The sets as places in the order of arrival, as the oracle names them.
std::vector<std::vector<std::size_t>> places_of(const Outcome& outcome) {
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> places;
  for (std::size_t place = 0; place < outcome.arrived.size(); ++place) {
    places[{outcome.arrived[place].topic, outcome.arrived[place].number}] = place;
  }
  std::vector<std::vector<std::size_t>> sets;
  for (const auto& set : outcome.sets) {
    auto& members = sets.emplace_back();
    for (std::size_t topic = 0; topic < set.size(); ++topic) {
      members.push_back(places.at({topic, set[topic]}));
    }
  }
  return sets;
}

Outcome run(const std::string& text, std::size_t topics, unsigned workers) {
  const auto application =
      make_application(text, classes(), {.is_simulated = true, .workers = workers});
  application->start();
  application->advance_to(kSimulatedStart + 10ms);
  Outcome outcome{.sets = component<Fusion>(*application, 0).sets,
                  .ledgers = {},
                  .arrived = component<ArrivalProbe>(*application, 2).arrived};
  for (std::size_t topic = 0; topic < topics; ++topic) {
    const Ledger running = fusion_ledger(*application, topic);
    EXPECT_TRUE(running.adds_up());
    outcome.ledgers.push_back(running);
  }
  application->stop();
  for (std::size_t topic = 0; topic < topics; ++topic) {
    const Ledger ended = fusion_ledger(*application, topic);
    EXPECT_TRUE(ended.adds_up());
    EXPECT_EQ(dropped(ended, DropReason::kShutdown), outcome.ledgers[topic].queued);
    EXPECT_TRUE(is_whole(*application, kTopics[topic]));
  }
  return outcome;
}

TEST(ManySynchronizedApplications, CallTheSetsThatTheRuleSays) {
  constexpr int kApplications = 1000;
  std::mt19937_64 random(5);
  std::size_t sets = 0;
  for (int i = 0; i < kApplications; ++i) {
    const auto policy = static_cast<SyncPolicy>(random() % 3);
    const std::size_t topics = 2 + random() % 3;
    const int difference =
        policy == SyncPolicy::kApproximate ? 1 + static_cast<int>(random() % 15) : 0;
    const std::size_t depth = 1 + random() % 6;
    std::vector<Stream> streams(topics);
    int moment = 0;
    for (const detail::TestArrival& arrival : detail::random_streams(random, topics)) {
      // Some arrive at one moment, in one round.
      moment += random() % 4 == 0 ? 0 : 1;
      auto& stream = streams[arrival.topic];
      stream.arrives_us.push_back(
          stream.arrives_us.empty() ? moment : std::max(moment, stream.arrives_us.back() + 1));
      stream.taken_us.push_back(arrival.time);
    }
    constexpr std::array kNames{"exact", "approximate", "latest"};
    const std::string text = fusion_of(
        streams, std::string(R"("policy": ")") + kNames[static_cast<std::size_t>(policy)] +
                     R"(", "max_difference_us": )" + std::to_string(difference) + R"(, "depth": )" +
                     std::to_string(depth));

    const Outcome outcome = run(text, topics, 1);

    std::vector<detail::TestArrival> arrivals;
    for (const Arrived& arrived : outcome.arrived) {
      arrivals.push_back({arrived.topic, static_cast<int>(arrived.taken_ns / 1000)});
    }
    const detail::Matched expected =
        detail::Oracle(arrivals, topics, policy, difference, depth).run();
    ASSERT_EQ(places_of(outcome), expected.sets) << text;
    std::vector<std::uint64_t> unmatched(topics);
    for (const auto& [message, when] : expected.unmatched) {
      ++unmatched[arrivals[message].topic];
    }
    for (std::size_t topic = 0; topic < topics; ++topic) {
      ASSERT_EQ(dropped(outcome.ledgers[topic], DropReason::kUnmatched), unmatched[topic]) << text;
      ASSERT_EQ(outcome.ledgers[topic].published, streams[topic].arrives_us.size());
    }
    sets += expected.sets.size();
    if (i % 20 == 0) {
      for (const unsigned workers : {2U, 4U}) {
        const Outcome again = run(text, topics, workers);
        ASSERT_EQ(again.sets, outcome.sets) << text;
      }
    }
  }
  EXPECT_GT(sets, 5'000U);
}

// ---- Live ----

/// Publishes `count` numbers on "out", each taken a millisecond after the one before, as its serve
/// timer ticks.
class LiveSensor final : public Component {
 public:
  explicit LiveSensor(Context& context)
      : Component(context),
        out_(context.create_publisher<Int64Value>("out")),
        source_(context.create_source()) {}

  void serve() override {
    for (int i = 0; i < 3 && sent_ < kCount; ++i) {
      auto loan = out_.loan();
      loan->set_value(++sent_);
      out_.publish(std::move(loan), {.taken_at = kSimulatedStart + sent_ * 1ms});
    }
    if (sent_ == kCount) {
      source_.finish();
    }
  }

  static constexpr std::int64_t kCount = 300;

 private:
  Publisher<Int64Value> out_;
  Source source_;
  std::int64_t sent_ = 0;
};

TEST(ASynchronizer, FindsAllSetsOfTwoThreads) {
  TestClasses live;
  live.with<LiveSensor>("sensor").with<Fusion>("fusion");
  const auto application = make_application(
      R"({"name": "t", "executors": [{"name": "a", "threads": 1}, {"name": "b", "threads": 1}],
       "components": [
        {"name": "fusion", "library": "fusion", "executor": "a", "params": {"depth": 300}},
        {"name": "s0", "library": "sensor", "executor": "a", "serve_period_ms": 0.2,
         "remap": {"out": "t0"}},
        {"name": "s1", "library": "sensor", "executor": "b", "serve_period_ms": 0.2,
         "remap": {"out": "t1"}}]})",
      live);

  application->start();
  application->run(std::nullopt);
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (fusion_ledger(*application, 1).delivered < LiveSensor::kCount &&
         std::chrono::steady_clock::now() < limit) {
    std::this_thread::yield();
  }
  application->stop();

  for (const std::size_t topic : {0U, 1U}) {
    const Ledger ledger = fusion_ledger(*application, topic);
    EXPECT_EQ(ledger.delivered, static_cast<std::uint64_t>(LiveSensor::kCount));
    EXPECT_TRUE(ledger.adds_up());
  }
}

}  // namespace
}  // namespace fastcycle::host
