// Calls that lead to calls: cycles, causes, origins; what start-up says; and many calls at random.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/prepare_replay.h"
#include "host/test_application.h"
#include "record/recording_reader.h"

namespace fastcycle::host {
namespace {

using detail::Cause;
using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace std::chrono_literals;

using Numbers = Client<Int64Value, Int64Value>;

Int64Value number(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message;
}

/// Serves "serves": the sum of what the services "asks" answer, and one. Asks them all at once, or,
/// "in_turn", each when the one before has answered. An error it passes on as its own.
class Relay final : public Component {
 public:
  explicit Relay(Context& context)
      : Component(context),
        in_turn_(context.param<bool>("in_turn", {.fallback = false})),
        is_independent_(context.param<bool>("independent", {.fallback = false})) {
    const auto asks =
        context.param<std::vector<std::string>>("asks", {.fallback = std::vector<std::string>()});
    for (const std::string& service : asks.get()) {
      clients_.push_back(context.create_client<Int64Value, Int64Value>(service));
    }
    context.create_service<Int64Value, Int64Value>(
        context.param<std::string>("serves").get(),
        [this](const Int64Value&, Responder<Int64Value> responder) {
          const auto task = std::make_shared<Task>(std::move(responder));
          if (clients_.empty()) {
            finish(*task);
            return;
          }
          const std::size_t count = in_turn_.get() ? 1 : clients_.size();
          for (std::size_t i = 0; i < count; ++i) {
            ask(task);
          }
        });
  }

 private:
  struct Task {
    explicit Task(Responder<Int64Value> its_responder) : responder(std::move(its_responder)) {}
    Responder<Int64Value> responder;
    std::size_t asked = 0;
    std::size_t answered = 0;
    std::int64_t sum = 1;
  };

  void ask(const std::shared_ptr<Task>& task) {
    Numbers& client = clients_[task->asked++];
    client.call(client.loan(), {.is_independent = is_independent_.get()},
                [this, task](const Reply<Int64Value>& reply) {
                  if (!reply.ok()) {
                    task->responder.reject(reply.error());
                    return;
                  }
                  task->sum += reply->value();
                  if (++task->answered == clients_.size()) {
                    finish(*task);
                  } else if (in_turn_.get()) {
                    ask(task);
                  }
                });
  }

  static void finish(Task& task) { task.responder.answer(number(task.sum)); }

  Param<bool> in_turn_;
  Param<bool> is_independent_;
  std::vector<Numbers> clients_;
};

/// Relays by name, and what each asks.
class ACallCycle : public ::testing::Test {
 protected:
  void add(const std::string& serves, const std::string& asks, const std::string& more = "") {
    bench_.add<Relay>("of_" + serves, R"({"params": {"serves": ")" + serves + R"(", "asks": [)" +
                                          asks + "]" + more + "}}");
  }

  /// What comes of a call of "a", with a deadline that must not be needed.
  fastcycle::testing::Bench::Answer<Int64Value> call() {
    auto client = bench_.client<Int64Value, Int64Value>("a");
    bench_.start();
    const Time begin = bench_.now();
    auto answer = client.call(number(0), {.deadline = 1s});
    EXPECT_TRUE(answer.is_done()) << "it hangs";
    EXPECT_EQ(bench_.now(), begin);
    return answer;
  }

  fastcycle::testing::Bench bench_;
};

TEST_F(ACallCycle, OfTwoServicesIsReportedWithItsWay) {
  add("a", R"("b")");
  add("b", R"("a")");

  EXPECT_EQ(call().error(),
            "\"a\": rejected, \"b\": rejected, \"a\": cycle, its answer would wait for itself: "
            "a → b → a");
}

TEST_F(ACallCycle, OfOneServiceIsReported) {
  add("a", R"("a")");

  EXPECT_EQ(call().error(),
            "\"a\": rejected, \"a\": cycle, its answer would wait for itself: a → a");
}

TEST_F(ACallCycle, OfThreeServicesIsReported) {
  add("a", R"("b")");
  add("b", R"("c")");
  add("c", R"("a")");

  EXPECT_THAT(call().error(), HasSubstr("would wait for itself: a → b → c → a"));
}

TEST_F(ACallCycle, ThatDoesNotGoThroughTheFirstIsReported) {
  add("a", R"("b")");
  add("b", R"("c")");
  add("c", R"("b")");

  EXPECT_THAT(call().error(), HasSubstr("would wait for itself: b → c → b"));
}

TEST_F(ACallCycle, IsFoundInWhatIsCalledWhenAReplyCame) {
  add("a", R"("d", "b")", R"(, "in_turn": true)");
  add("b", R"("a")");
  add("d", "");

  EXPECT_THAT(call().error(), HasSubstr("would wait for itself: a → b → a"));
}

TEST_F(ACallCycle, IsNoneIfTwoWaysLeadToOneService) {
  add("a", R"("b", "c")");
  add("b", R"("d")");
  add("c", R"("d")");
  add("d", "");

  const auto answer = call();

  ASSERT_TRUE(answer.ok()) << answer.error();
  EXPECT_EQ(answer->value(), 5) << "itself, b, c, and d twice";
}

TEST_F(ACallCycle, IsNoneIfTheSameServiceIsAskedOneTimeAfterTheOther) {
  add("a", R"("d", "b")", R"(, "in_turn": true)");
  add("b", R"("d")");
  add("d", "");

  EXPECT_TRUE(call().ok());
}

/// Asks back, but only once, and does not wait for it.
class Echo final : public Component {
 public:
  explicit Echo(Context& context)
      : Component(context), own_(context.create_client<Int64Value, Int64Value>("a")) {
    context.create_service<Int64Value, Int64Value>(
        "a", [this](const Int64Value& request, Int64Value& reply) {
          reply.set_value(request.value() + 1);
          if (request.value() == 0) {
            auto again = own_.loan();
            again->set_value(1);
            own_.call(std::move(again), [this](const Reply<Int64Value>& echo) {
              report("echo", echo.ok() ? echo->value() : -1);
            });
          }
        });
  }

 private:
  Numbers own_;
};

TEST_F(ACallCycle, IsNoneIfTheAnswerDoesNotWait) {
  bench_.add<Echo>("echo");

  EXPECT_EQ(call()->value(), 1);
  EXPECT_EQ(bench_.result("echo", "echo"), ReportValue(std::int64_t{2}));
}

// ---- The bench ----

TEST(ABench, CallsServicesAndStandsInForThem) {
  fastcycle::testing::Bench bench;
  bench.add<Relay>("relay", R"({"params": {"serves": "a", "asks": ["b", "c"]}})");
  bench.service<Int64Value, Int64Value>(
      "b", [](const Int64Value&, Int64Value& reply) { reply.set_value(40); });
  std::optional<Responder<Int64Value>> owed;
  auto c = bench.service<Int64Value, Int64Value>(
      "c",
      [&owed](const Int64Value&, Responder<Int64Value> responder) { owed = std::move(responder); });
  auto client = bench.client<Int64Value, Int64Value>("a");
  bench.start();

  auto answer = client.call(number(0));
  EXPECT_FALSE(answer.is_done());
  EXPECT_TRUE(owed->is_open());
  c.run([&owed] { owed->answer(number(1)); });
  ASSERT_TRUE(answer.ok()) << answer.error();
  EXPECT_EQ(answer->value(), 42);

  auto second = client.call(number(0));
  second.cancel();
  EXPECT_EQ(second.status(), CallStatus::kCancelled);
}

// ---- Causes and origins ----

/// Asks "slow" for what comes on "in", with a deadline of 20 ms, and publishes on "out" when the
/// reply is there, whatever it is.
class Forwarder final : public Component {
 public:
  explicit Forwarder(Context& context)
      : Component(context),
        slow_(context.create_client<Int64Value, Int64Value>("slow")),
        out_(context.create_publisher<Int64Value>("out")) {
    context.create_subscriber<Int64Value>("in", [this](const Int64Value& value) {
      auto request = slow_.loan();
      request->CopyFrom(value);
      slow_.call(std::move(request), {.deadline = 20ms}, [this](const Reply<Int64Value>& reply) {
        auto out = out_.loan();
        out->set_value(reply.ok() ? reply->value() : -1);
        out_.publish(std::move(out));
      });
    });
  }

 private:
  Numbers slow_;
  Publisher<Int64Value> out_;
};

/// Answers at its next tick; 0 it never answers.
class Slow final : public Component {
 public:
  explicit Slow(Context& context) : Component(context) {
    context.create_service<Int64Value, Int64Value>(
        "slow", [this](const Int64Value& request, Responder<Int64Value> responder) {
          auto& list = request.value() == 0 ? never_ : owed_;
          list.push_back(std::move(responder));
        });
  }
  void serve() override {
    for (auto& responder : owed_) {
      responder.answer(number(1));
    }
    owed_.clear();
  }

 private:
  std::vector<Responder<Int64Value>> owed_;
  std::vector<Responder<Int64Value>> never_;
};

/// Reports how old what comes on "out" is, by its origin.
class OriginWatch final : public Component {
 public:
  explicit OriginWatch(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("out", [this](const Sample<Int64Value>& out) {
      report(out->value() < 0 ? "error" : "value",
             std::int64_t{(now() - out.info().origin.taken).count()});
    });
  }
};

TEST(AReply, HasTheOriginOfItsRequest) {
  fastcycle::testing::Bench bench;
  bench.add<Slow>("slow", R"({"serve_period_ms": 10})");
  bench.add<Forwarder>("forwarder");
  bench.add<OriginWatch>("watch");
  auto in = bench.input<Int64Value>("in");
  bench.start();

  in.publish(number(1), {.taken_at = bench.now() - 3ms});
  in.publish(number(0), {.taken_at = bench.now() - 5ms});
  bench.advance(10ms);
  EXPECT_EQ(bench.result("watch", "value"), ReportValue(std::int64_t{13'000'000}));
  bench.advance(10ms);
  EXPECT_EQ(bench.result("watch", "error"), ReportValue(std::int64_t{25'000'000}));
}

/// Asks once a tick: 0, then 1, and so on.
class Ticker final : public Component {
 public:
  explicit Ticker(Context& context)
      : Component(context), in_(context.create_publisher<Int64Value>("in")) {}
  void serve() override {
    auto in = in_.loan();
    in->set_value(count_++);
    in_.publish(std::move(in));
  }

 private:
  Publisher<Int64Value> in_;
  std::int64_t count_ = 0;
};

TEST(ACall, ShowsItsCausesInTheRing) {
  TestClasses classes;
  classes.with<Ticker>("ticker").with<Slow>("slow").with<Forwarder>("forwarder");
  const auto application = make_application(R"({"name": "test", "components": [
      {"name": "ticker", "library": "ticker", "serve_period_ms": 50},
      {"name": "slow", "library": "slow", "serve_period_ms": 10},
      {"name": "forwarder", "library": "forwarder"}]})",
                                            classes, {.is_simulated = true, .workers = 1});
  application->start();
  application->run(149ms);
  application->stop();

  std::map<std::uint32_t, std::vector<Cause>> causes;
  for (const auto& record : application->time().rings()[0]->snapshot()) {
    if (record.cause != Cause::kTick && record.cause != Cause::kMode) {
      causes[record.component].push_back(record.cause);
    }
  }
  // 0 is late, so a request and a word that nobody waits any more; 1 is answered.
  EXPECT_THAT(causes[1], ElementsAre(Cause::kRequest, Cause::kRequest, Cause::kRequest));
  EXPECT_THAT(causes[2], ElementsAre(Cause::kMessage, Cause::kTimeout, Cause::kReply,
                                     Cause::kMessage, Cause::kReply));
}

// ---- Start-up ----

/// The errors and warnings of an application of these components.
std::vector<std::string> problems_of(const std::string& components, TestClasses& classes) {
  config::Problems problems;
  Application application(
      describe_text(R"({"name": "test", "components": [)" + components + "]}", problems), {});
  application.build(classes, problems, ConstructorFault::kError);
  std::vector<std::string> texts;
  for (const config::Problem& problem : problems.all()) {
    texts.push_back((problem.warning ? "warning: " : "") + problem.message);
  }
  return texts;
}

class StringServer final : public Component {
 public:
  explicit StringServer(Context& context) : Component(context) {
    context.create_service<Int64Value, StringValue>("a", [](const Int64Value&, StringValue&) {});
  }
};

class ActionServer final : public Component {
 public:
  explicit ActionServer(Context& context) : Component(context) {
    context.create_action_server<Int64Value, Int64Value, Int64Value>(
        "a", [](const Int64Value&, ServerGoal<Int64Value, Int64Value>) {});
  }
};

class Sharp final : public Component {
 public:
  explicit Sharp(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("a#request", [](const Int64Value&) {});
  }
};

TEST(ServicesAtStartUp, HaveOneServer) {
  TestClasses classes;
  classes.with<Relay>("relay");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "relay", "params": {"serves": "a"}},
                             {"name": "y", "library": "relay", "params": {"serves": "a"}})",
                          classes),
              ElementsAre("service \"a\" has two servers, \"x\" and \"y\""));
}

TEST(ServicesAtStartUp, HaveOnePairOfTypes) {
  TestClasses classes;
  classes.with<Relay>("relay").with<StringServer>("strings");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "relay",
                              "params": {"serves": "b", "asks": ["a"]}},
                             {"name": "y", "library": "strings"})",
                          classes),
              ElementsAre(AllOf(HasSubstr("topic \"a#reply/x\" has two types"),
                                HasSubstr("component \"y\" uses it as google.protobuf.StringValue"),
                                HasSubstr("component \"x\" as google.protobuf.Int64Value"))));
}

TEST(ServicesAtStartUp, AreNoActions) {
  TestClasses classes;
  classes.with<Relay>("relay").with<ActionServer>("action");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "relay",
                              "params": {"serves": "b", "asks": ["a"]}},
                             {"name": "y", "library": "action"})",
                          classes),
              ElementsAre("component \"x\" calls \"a\" as a service, but component \"y\" serves it "
                          "as an action"));
}

TEST(ServicesAtStartUp, WithoutAServerAreAWarning) {
  TestClasses classes;
  classes.with<Relay>("relay");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "relay",
                              "params": {"serves": "b", "asks": ["a"]}})",
                          classes),
              ElementsAre("warning: service \"a\", which component \"x\" calls, is served by "
                          "nobody"));
}

TEST(ServicesAtStartUp, KeepTheirTopicsToThemselves) {
  TestClasses classes;
  classes.with<Sharp>("sharp");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "sharp"})", classes),
              Contains(HasSubstr("uses the name \"a#request\"")));
}

TEST(ServicesAtStartUp, ArePlacedAsTopicsAre) {
  TestClasses classes;
  classes.with<Relay>("relay");
  EXPECT_THAT(problems_of(R"({"name": "x", "library": "relay", "namespace": "front",
                              "params": {"serves": "b", "asks": ["a"]}, "remap": {"a": "/c"}},
                             {"name": "y", "library": "relay", "params": {"serves": "c"}})",
                          classes),
              IsEmpty());
}

// ---- Made anew while others subscribe ----

constexpr std::uint64_t kLives = 200;

/// Throws at each tick, so that it declares its client again and again.
class ShortLived final : public Component {
 public:
  explicit ShortLived(Context& context)
      : Component(context),
        client_(context.create_client<Int64Value, Int64Value>("b")),
        source_(context.create_source()) {}

  void serve() override {
    if (context().core().restart_count == kLives) {
      source_.finish();
      return;
    }
    throw std::runtime_error("on purpose");
  }

 private:
  Numbers client_;
  Source source_;
};

/// Subscribes to a topic that nobody knew, at each tick.
class Curious final : public Component {
 public:
  explicit Curious(Context& context) : Component(context), source_(context.create_source()) {}

  void serve() override {
    if (subscribers_.size() == kLives) {
      source_.finish();
      return;
    }
    subscribers_.emplace_back(context().create_subscriber<Int64Value>(
        fmt::format("topic_{}", subscribers_.size()), [](const Int64Value&) {}));
  }

 private:
  std::vector<Subscriber> subscribers_;
  Source source_;
};

// A data race, if its topics are touched when it is made anew: the thread sanitizer sees it.
TEST(AClient, IsMadeAnewWhileOthersMakeTopics) {
  TestClasses classes;
  classes.with<ShortLived>("short_lived").with<Curious>("curious").with<Relay>("relay");
  const auto application = make_application(
      R"({"name": "test", "executors": [{"name": "one"}, {"name": "two"}], "components": [
          {"name": "short_lived", "library": "short_lived", "serve_period_ms": 0.2,
           "executor": "one", "on_fault": "restart", "restart": {"limit": 1000}},
          {"name": "curious", "library": "curious", "serve_period_ms": 0.2, "executor": "two"},
          {"name": "server", "library": "relay", "executor": "two", "params": {"serves": "b"}}]})",
      classes);
  application->start();
  EXPECT_EQ(application->run(100s), EndReason::kSourcesFinished);
  application->stop();
  EXPECT_EQ(application->components()[0]->restart_count, kLives);
  EXPECT_NE(application->topics().find("topic_199"), nullptr);
}

// ---- Many calls ----

constexpr std::array kServices{"s0", "s1", "s2", "nobody"};

/// Serves "serves" in every way that there is, by chance.
class RandomServer final : public Component {
 public:
  explicit RandomServer(Context& context)
      : Component(context),
        next_(context.create_client<Int64Value, Int64Value>(
            context.param<std::string>("asks").get(), {.max_open = 16})) {
    context.create_service<Int64Value, Int64Value>(
        context.param<std::string>("serves").get(), {.depth = 12},
        [this](const Int64Value& request, Responder<Int64Value> responder) {
          take(request.value(), std::move(responder));
        });
  }

  void serve() override {
    while (!owed_.empty() && random()() % 4 != 0) {
      owed_.back().answer(number(1));
      owed_.pop_back();
    }
    if (owed_.size() > 8) {
      owed_.erase(owed_.begin());  // Unanswered.
    }
  }

 private:
  void take(std::int64_t value, Responder<Int64Value> responder) {
    const auto dice = random()() % 4000;
    if (dice == 0) {
      throw std::runtime_error("by chance");
    }
    if (dice < 300) {
      responder.reject("by chance");
    } else if (dice < 600) {
      return;
    } else if (dice < 1000) {
      owed_.push_back(std::move(responder));
    } else if (dice < 1100) {
      never_.push_back(std::move(responder));
      if (never_.size() > 100) {
        never_.erase(never_.begin(), never_.begin() + 50);
      }
    } else if (dice < 1800) {
      const auto kept = std::make_shared<Responder<Int64Value>>(std::move(responder));
      next_.call(next_.loan(), {.deadline = 30ms}, [kept](const Reply<Int64Value>& reply) {
        if (reply.ok()) {
          kept->answer(*reply);
        } else {
          kept->reject(to_word(reply.status()));
        }
      });
    } else {
      responder.answer(number(2 * value));
    }
  }

  Numbers next_;
  std::vector<Responder<Int64Value>> owed_;
  std::vector<Responder<Int64Value>> never_;
};

/// Calls by chance, "each_tick" times each tick, "calls" times in all; counts the replies of each.
class RandomClient final : public Component {
 public:
  explicit RandomClient(Context& context)
      : Component(context),
        count_(context.param<std::int64_t>("calls")),
        each_tick_(context.param<std::int64_t>("each_tick")),
        source_(context.create_source()) {
    for (const char* service : kServices) {
      clients_.push_back(context.create_client<Int64Value, Int64Value>(service, {.max_open = 24}));
    }
  }

  void serve() override {
    for (std::int64_t i = 0; i < each_tick_.get() && std::ssize(replies_) < count_.get(); ++i) {
      call();
    }
    if (!calls_.empty() && random()() % 3 == 0) {
      calls_[random()() % calls_.size()].cancel();
    }
    if (calls_.size() > 100) {
      calls_.erase(calls_.begin(), calls_.begin() + 50);
    }
    if (std::ssize(replies_) == count_.get()) {
      source_.finish();
    }
  }

  void stop() override {
    std::int64_t wrong = 0;
    for (const int replies : replies_) {
      wrong += replies == 1 ? 0 : 1;
    }
    report("calls", std::ssize(replies_));
    report("wrong", wrong);
    report("digest", static_cast<std::int64_t>(digest_));
    for (const auto& [word, count] : words_) {
      report(word, count);
    }
  }

 private:
  void call() {
    Numbers& client = clients_[random()() % clients_.size()];
    const std::size_t index = replies_.size();
    replies_.push_back(0);
    CallOptions options;
    if (random()() % 10 != 0) {
      options.deadline = std::chrono::milliseconds(1 + random()() % 60);
    }
    auto request = client.loan();
    request->set_value(static_cast<std::int64_t>(index));
    calls_.push_back(
        client.call(std::move(request), options, [this, index](const Reply<Int64Value>& reply) {
          ++replies_[index];
          ++words_[to_word(reply.status())];
          const auto value = static_cast<std::uint64_t>(reply.ok() ? reply->value() : 0);
          for (const std::uint64_t part :
               {std::uint64_t{index}, static_cast<std::uint64_t>(reply.status()), value,
                static_cast<std::uint64_t>(now().time_since_epoch().count())}) {
            digest_ = (digest_ ^ part) * 1099511628211ULL;
          }
        }));
  }

  Param<std::int64_t> count_;
  Param<std::int64_t> each_tick_;
  Source source_;
  std::vector<Numbers> clients_;
  std::vector<Call> calls_;
  std::vector<int> replies_;
  std::map<std::string, std::int64_t> words_;
  std::uint64_t digest_ = 0;
};

using Results = std::vector<std::map<std::string, ReportValue, std::less<>>>;

/// Three clients that call three servers, which call each other.
Results run_many(std::int64_t calls, std::int64_t each_tick, double period_ms,
                 const ClockOptions& clock) {
  TestClasses classes;
  classes.with<RandomClient>("client").with<RandomServer>("server");
  std::string components;
  for (int i = 0; i < 3; ++i) {
    components += fmt::format(
        R"({{"name": "server{0}", "library": "server", "executor": "x{0}", "serve_period_ms": {1},
             "on_fault": "restart", "params": {{"serves": "s{0}", "asks": "s{2}"}}}},
           {{"name": "client{0}", "library": "client", "executor": "x{2}", "serve_period_ms": {1},
             "params": {{"calls": {3}, "each_tick": {4}}}}}{5})",
        i, period_ms, (i + 1) % 3, calls, each_tick, i < 2 ? "," : "");
  }
  const auto application = make_application(
      R"({"name": "test", "executors": [{"name": "x0", "threads": 2}, {"name": "x1"},
                                        {"name": "x2"}],
          "components": [)" +
          components + "]}",
      classes, clock);
  application->start();
  EXPECT_EQ(application->run(100s), EndReason::kSourcesFinished);
  application->stop();
  Results results;
  for (const auto& component : application->components()) {
    results.push_back(component->results);
  }
  for (const auto& [name, topic] : application->topics().all()) {
    for (const auto& subscription : topic->subscriptions) {
      const detail::Ledger ledger = subscription->ledger();
      EXPECT_TRUE(ledger.adds_up()) << name;
      for (const auto reason : {detail::DropReason::kOverflow, detail::DropReason::kPool}) {
        EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(reason)], 0U) << name;
      }
    }
  }
  return results;
}

std::map<std::string, std::uint64_t> sums(const Results& results) {
  std::map<std::string, std::uint64_t> sums;  // Some are checksums: they may go round.
  for (const auto& component : results) {
    for (const auto& [word, value] : component) {
      sums[word] += static_cast<std::uint64_t>(std::get<std::int64_t>(value));
    }
  }
  return sums;
}

TEST(ManyCalls, EndInExactlyOneReplyEachWhateverHappensAndForAnyNumberOfWorkers) {
  constexpr std::int64_t kCalls = 33'400;
  const Results first = run_many(kCalls, 30, 20, {.is_simulated = true, .workers = 1});
  auto sum = sums(first);

  EXPECT_EQ(sum["calls"], std::uint64_t{3 * kCalls});
  EXPECT_EQ(sum["wrong"], 0U);
  for (const char* word :
       {"ok", "absent", "busy", "faulted", "late", "cancelled", "rejected", "unanswered"}) {
    EXPECT_GT(sum[word], 0U) << word;
  }
  EXPECT_EQ(run_many(kCalls, 30, 20, {.is_simulated = true, .workers = 2}), first);
  EXPECT_EQ(run_many(kCalls, 30, 20, {.is_simulated = true, .workers = 4}), first);
}

TEST(ManyCalls, EndInExactlyOneReplyEachWithThreads) {
  auto sum = sums(run_many(1000, 10, 2, {}));

  EXPECT_EQ(sum["calls"], 3000U);
  EXPECT_EQ(sum["wrong"], 0U);
  EXPECT_GT(sum["ok"], 0U);
}

// ---- Replay ----

constexpr const char* kRandom = R"({"name": "test", "components": [
  {"name": "client0", "library": "client", "serve_period_ms": 10,
   "params": {"calls": 600, "each_tick": 6}},
  {"name": "client1", "library": "client", "serve_period_ms": 10,
   "params": {"calls": 600, "each_tick": 6}},
  {"name": "server0", "library": "server", "serve_period_ms": 10, "on_fault": "restart",
   "params": {"serves": "s0", "asks": "s1"}},
  {"name": "server1", "library": "server", "serve_period_ms": 10, "on_fault": "restart",
   "params": {"serves": "s1", "asks": "s2"}},
  {"name": "server2", "library": "server", "serve_period_ms": 10,
   "params": {"serves": "s2", "asks": "s0"}}]})";

/// Everything that `publisher` published, in order, with all that is known of it.
std::vector<std::string> published_by(const std::string& publisher,
                                      const std::filesystem::path& file) {
  record::RecordingReader reader({file});
  std::vector<bool> wanted;
  for (const record::RecordedStream& stream : reader.streams()) {
    wanted.push_back(stream.publisher == publisher);
  }
  reader.rewind({.wanted = wanted, .from = reader.begin(), .to = reader.end()});
  std::vector<std::string> lines;
  for (auto moment = reader.next(); !moment.empty(); moment = reader.next()) {
    for (const record::RecordedMessage& message : moment) {
      lines.push_back(fmt::format(
          "{} {} at {} taken {} root {} step {}: {:02x}", reader.streams()[message.stream].topic,
          message.info.sequence, message.info.publish_time.time_since_epoch().count(),
          message.info.origin.taken.time_since_epoch().count(), message.info.origin.root,
          message.step, fmt::join(message.data, "")));
    }
  }
  return lines;
}

class CallsReplayed : public ::testing::Test {
 protected:
  CallsReplayed() { classes_.with<RandomClient>("client").with<RandomServer>("server"); }

  void run(Application& application, ComponentClasses& classes, const std::string& file) {
    config::RecordDescription record;
    record.file = folder_ / file;
    application.record(record);
    config::Problems problems;
    application.build(classes, problems, ConstructorFault::kFault);
    EXPECT_FALSE(problems.has_errors());
    application.start();
    application.run(std::nullopt);
    application.stop();
  }

  /// Replays into `component` alone, and compares what it publishes.
  void expect_the_same_of(const std::string& component) {
    config::Problems problems;
    const auto replay = prepare_replay({.files = {folder_ / "whole.mcap"}, .into = {component}},
                                       describe_text(kRandom, problems), classes_, problems);
    ASSERT_NE(replay, nullptr);
    const std::string file = component + ".mcap";
    Application application(replay->description(), {.is_simulated = true, .workers = 2});
    application.replay(*replay);
    run(application, *replay, file);
    const auto before = published_by(component, folder_ / "whole.mcap");
    const auto after = published_by(component, folder_ / file);
    ASSERT_GT(before.size(), 300U);
    for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
      ASSERT_EQ(before[i], after[i]) << component << ", message " << i;
    }
    EXPECT_EQ(before.size(), after.size());
  }

  config::TestFolder folder_;
  TestClasses classes_;
};

TEST_F(CallsReplayed, ByACallerWithoutItsServersAndByAServerWithoutItsCallers) {
  config::Problems problems;
  Application application(describe_text(kRandom, problems), {.is_simulated = true, .workers = 1});
  run(application, classes_, "whole.mcap");

  expect_the_same_of("client0");
  expect_the_same_of("server0");
  expect_the_same_of("server2");
}

}  // namespace
}  // namespace fastcycle::host
