#include "modes/chains.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "report/report.h"
#include "status/status.pb.h"

namespace fastcycle::host {
namespace {

using detail::DropReason;
using google::protobuf::Int64Value;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

std::uint64_t dropped(const detail::Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

template <typename Condition>
void wait_until(const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (!condition()) {
    ASSERT_LT(std::chrono::steady_clock::now(), limit) << "the condition never came true";
    std::this_thread::sleep_for(200us);
  }
}

/// What sinks saw; a test has one at a time.
struct Seen {
  std::atomic<int> count{0};
  std::atomic<int> unasked{0};  ///< Callbacks for which no mode had been asked.
};
Seen g_seen;

/// Publishes 1, 2, 3, … on "out" at each Serve period; a `paced` one not before the sink has seen
/// the one before.
class Source final : public Component {
 public:
  explicit Source(Context& context)
      : Component(context),
        paced_(context.param<bool>("paced", {.fallback = false})),
        out_(context.create_publisher<Int64Value>("out")) {}

  void serve() override {
    if (!paced_.get() || g_seen.count + 1 >= next_) {
      auto loan = out_.loan();
      loan->set_value(next_++);
      out_.publish(std::move(loan));
    }
  }

 private:
  Param<bool> paced_;
  Publisher<Int64Value> out_;
  std::int64_t next_ = 1;
};

/// From "in" to "out". Numbers from `from` on take longer: it sleeps, or publishes later by a
/// timer.
class Relay final : public Component {
 public:
  explicit Relay(Context& context)
      : Component(context),
        from_(context.param<std::int64_t>("from", {.fallback = 0})),
        sleep_us_(context.param<std::int64_t>("sleep_us", {.fallback = 0})),
        hold_us_(context.param<std::int64_t>("hold_us", {.fallback = 0})),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = 0})),
        out_(context.create_publisher<Int64Value>("out")),
        timer_(context.create_timer([this] { publish(held_); })) {
    context.create_subscriber<Int64Value>("in", [this](const Int64Value& in) { take(in.value()); });
  }

 private:
  void take(std::int64_t value) {
    if (value == throws_at_.get()) {
      throw std::runtime_error("asked to");
    }
    if (value < from_.get()) {
      publish(value);
    } else if (hold_us_.get() > 0) {
      held_ = value;
      timer_.arm_at(now() + std::chrono::microseconds(hold_us_.get()));
    } else {
      std::this_thread::sleep_for(std::chrono::microseconds(sleep_us_.get()));
      publish(value);
    }
  }
  void publish(std::int64_t value) {
    auto loan = out_.loan();
    loan->set_value(value);
    out_.publish(std::move(loan));
  }

  Param<std::int64_t> from_;
  Param<std::int64_t> sleep_us_;
  Param<std::int64_t> hold_us_;
  Param<std::int64_t> throws_at_;
  Publisher<Int64Value> out_;
  Timer timer_;
  std::int64_t held_ = 0;
};

/// Subscribes to "in". With `resets` it goes back to the mode "nominal" after each message, and
/// counts those before which nobody had asked for "degraded".
class Sink final : public Component {
 public:
  explicit Sink(Context& context)
      : Component(context), resets_(context.param<bool>("resets", {.fallback = false})) {
    context.create_subscriber<Int64Value>("in", [this](const Int64Value&) { take(); });
  }

 private:
  void take() {
    ++g_seen.count;
    if (resets_.get()) {
      g_seen.unasked += context().mode() == "degraded" ? 0 : 1;
      context().switch_mode("nominal");
    }
  }

  Param<bool> resets_;
};

/// Looks at the newest of "in" at each Serve period.
class Viewer final : public Component {
 public:
  explicit Viewer(Context& context)
      : Component(context), in_(context.create_latest<Int64Value>("in")) {}

  void serve() override {
    if (in_.get()) {
      ++g_seen.count;
    }
  }

 private:
  Latest<Int64Value> in_;
};

/// Publishes the last number that it received on "in" at each Serve period.
class Ticker final : public Component {
 public:
  explicit Ticker(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("out")) {
    context.create_subscriber<Int64Value>("in",
                                          [this](const Int64Value& in) { last_ = in.value(); });
  }

  void serve() override {
    if (last_ != 0) {
      auto loan = out_.loan();
      loan->set_value(last_);
      out_.publish(std::move(loan));
    }
  }

 private:
  Publisher<Int64Value> out_;
  std::int64_t last_ = 0;
};

/// Publishes for each pair of "left" and "right" of one taken time.
class Fusion final : public Component {
 public:
  explicit Fusion(Context& context)
      : Component(context), out_(context.create_publisher<Int64Value>("out")) {
    context.create_synchronizer<Int64Value, Int64Value>(
        {"left", "right"}, {.policy = SyncPolicy::kExact},
        [this](const Int64Value& left, const Int64Value&) {
          auto loan = out_.loan();
          loan->set_value(left.value());
          out_.publish(std::move(loan));
        });
  }

 private:
  Publisher<Int64Value> out_;
};

/// Answers each request `hold_us` later.
class Server final : public Component {
 public:
  explicit Server(Context& context)
      : Component(context),
        hold_us_(context.param<std::int64_t>("hold_us", {.fallback = 0})),
        timer_(context.create_timer([this] { answer(); })) {
    context.create_service<Int64Value, Int64Value>(
        "same", {.depth = 4}, [this](const Int64Value& request, Responder<Int64Value> responder) {
          values_.push_back(request.value());
          responders_.push_back(std::move(responder));
          timer_.arm_at(now() + std::chrono::microseconds(hold_us_.get()));
        });
  }

 private:
  void answer() {
    auto reply = responders_.front().loan();
    reply->set_value(values_.front());
    responders_.front().answer(std::move(reply));
    responders_.pop_front();
    values_.pop_front();
    if (!values_.empty()) {
      timer_.arm_at(now() + std::chrono::microseconds(hold_us_.get()));
    }
  }

  Param<std::int64_t> hold_us_;
  Timer timer_;
  std::deque<std::int64_t> values_;
  std::deque<Responder<Int64Value>> responders_;
};

/// Asks "same" for each number of "in", and publishes the answer on "out".
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context),
        same_(context.create_client<Int64Value, Int64Value>("same", {.max_open = 4})),
        out_(context.create_publisher<Int64Value>("out")) {
    context.create_subscriber<Int64Value>("in", [this](const Int64Value& in) {
      auto request = same_.loan();
      request->set_value(in.value());
      same_.call(std::move(request), {.deadline = 1s}, [this](const Reply<Int64Value>& reply) {
        auto loan = out_.loan();
        loan->set_value(reply.ok() ? reply->value() : -1);
        out_.publish(std::move(loan));
      });
    });
  }

 private:
  Client<Int64Value, Int64Value> same_;
  Publisher<Int64Value> out_;
};

/// Writes down what fastcycle/status said last of chains.
class Supervisor final : public Component {
 public:
  explicit Supervisor(Context& context) : Component(context) {
    context.create_subscriber<status::Status>(
        "/fastcycle/status", [this](const status::Status& status) {
          chains_ = status.chains().empty() ? "" : status.chains(0).ShortDebugString();
        });
  }
  void stop() override { report("chains", chains_); }

 private:
  std::string chains_;
};

TestClasses& classes() {
  static TestClasses all;
  return all.with<Source>("source")
      .with<Relay>("relay")
      .with<Sink>("sink")
      .with<Viewer>("viewer")
      .with<Ticker>("ticker")
      .with<Fusion>("fusion")
      .with<Server>("server")
      .with<Asker>("asker")
      .with<Supervisor>("supervisor");
}

/// `text` with ' for ".
std::string json(std::string text) {
  std::ranges::replace(text, '\'', '"');
  return text;
}

std::unique_ptr<Application> make(const std::string& text, const ClockOptions& clock = {}) {
  g_seen.count = 0;
  g_seen.unasked = 0;
  return make_application(json(text), classes(), clock);
}

/// Runs it for `span` of simulated time.
std::unique_ptr<Application> run(const std::string& text, Duration span, unsigned workers = 1) {
  auto application = make(text, {.is_simulated = true, .workers = workers});
  application->start();
  application->run(span);
  application->stop();
  return application;
}

std::string problems_of(const std::string& text) {
  config::Problems problems;
  Application application(describe_text(json(text), problems), {.is_simulated = true});
  application.build(classes(), problems, ConstructorFault::kError);
  std::string all;
  for (const config::Problem& problem : problems.all()) {
    all += config::to_string(problem) + "\n";
  }
  return all;
}

std::vector<std::string> hops_of(const ChainReport& chain) {
  std::vector<std::string> hops;
  for (const HopReport& hop : chain.hops) {
    hops.push_back(hop.component + (hop.topic.empty() ? "" : ":" + hop.topic));
  }
  return hops;
}

/// A source, and a sink behind one relay; `more` of the chain and of the relay's params.
std::string short_chain(const std::string& chain, const std::string& relay,
                        const std::string& more = "") {
  return "{'name': 'x', 'chains': [{'name': 'c', 'from': 'a', 'to': 'b', " + chain + "}]," + more +
         "'components': [{'name': 'source', 'library': 'source', 'serve_period_ms': 10,"
         " 'remap': {'out': 'a'}}, {'name': 'relay', 'library': 'relay', 'params': {" +
         relay +
         "}, 'remap': {'in': 'a', 'out': 'b'}},"
         " {'name': 'sink', 'library': 'sink', 'remap': {'in': 'b'}}]}";
}

/// A source, six relays and a sink, all on one thread; numbers from 5 on are held up at `hop`.
std::string six_hops(std::size_t hop, const std::string& delay, double deadline_ms,
                     const std::string& source) {
  std::string text = fmt::format(
      "{{'name': 'x', 'executors': [{{'name': 'one'}}], 'chains': [{{'name': 'c', 'from': 't0',"
      " 'to': 't6', 'deadline_ms': {}}}], 'components': [{{'name': 'source', 'library': 'source',"
      " 'executor': 'one', {}, 'remap': {{'out': 't0'}}}}",
      deadline_ms, source);
  for (std::size_t i = 1; i <= 6; ++i) {
    text += fmt::format(
        ", {{'name': 'r{}', 'library': 'relay', 'executor': 'one', 'params': {{'from': 5{}}},"
        " 'remap': {{'in': 't{}', 'out': 't{}'}}}}",
        i, i == hop ? ", " + delay : "", i - 1, i);
  }
  return text + ", {'name': 'sink', 'library': 'sink', 'executor': 'one', 'remap': {'in': 't6'}}]}";
}

// ---- What is judged ----

TEST(AChain, KnowsTheAgeOfWhatIsDelivered) {
  const auto application = run(short_chain("'deadline_ms': 100", "'hold_us': 3000"), 105ms);

  const auto chains = application->chains().report();

  ASSERT_EQ(chains.size(), 1U);
  EXPECT_EQ(chains[0].count, 10U);
  EXPECT_EQ(chains[0].breaches, 0U);
  EXPECT_EQ(chains[0].age.max, 3e6);
  EXPECT_THAT(hops_of(chains[0]), ElementsAre("source:a", "relay:b", "sink"));
  EXPECT_EQ(chains[0].hops[1].waiting.max, 3e6) << "until its timer";
  EXPECT_EQ(chains[0].largest_contributor(), nullptr);
}

TEST(AChain, CountsWhatIsTooOld) {
  const auto application =
      run(short_chain("'deadline_ms': 2", "'hold_us': 3000, 'from': 5"), 105ms);

  const auto chains = application->chains().report();

  EXPECT_EQ(chains[0].count, 10U);
  EXPECT_EQ(chains[0].breaches, 6U);
  EXPECT_EQ(chains[0].dropped, 0U);
  EXPECT_EQ(g_seen.count, 10);
  ASSERT_NE(chains[0].largest_contributor(), nullptr);
  EXPECT_EQ(chains[0].largest_contributor()->component, "relay");
}

TEST(AChain, MayTakeExactlyItsDeadline) {
  const auto application = run(short_chain("'deadline_ms': 3", "'hold_us': 3000"), 105ms);

  EXPECT_EQ(application->chains().report()[0].breaches, 0U);
}

TEST(AChain, DropsWhatIsTooOldBeforeTheCallbackAndTheLedgerAddsUp) {
  const auto application = run(
      short_chain("'deadline_ms': 2, 'on_breach': 'drop'", "'hold_us': 3000, 'from': 5"), 105ms);

  const detail::Ledger ledger = ledger_of(*application, "b", "sink");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.delivered, 4U);
  EXPECT_EQ(dropped(ledger, DropReason::kStale), 6U);
  EXPECT_EQ(g_seen.count, 4);
  EXPECT_EQ(application->chains().report()[0].dropped, 6U);
}

TEST(AChain, DropsWhatAViewWouldShow) {
  std::string text =
      short_chain("'deadline_ms': 2, 'on_breach': 'drop'", "'hold_us': 3000, 'from': 5");
  text.replace(text.find("'library': 'sink'"), 17, "'library': 'viewer', 'serve_period_ms': 10");

  const auto application = run(text, 105ms);

  const detail::Ledger ledger = ledger_of(*application, "b", "sink");
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_GT(dropped(ledger, DropReason::kStale), 0U);
  EXPECT_EQ(ledger.published, application->chains().report()[0].count +
                                  dropped(ledger, DropReason::kShutdown) +
                                  dropped(ledger, DropReason::kSuperseded) + ledger.queued);
}

TEST(AChain, SwitchesTheModeOnceAndDeliversAll) {
  const auto application = run(
      short_chain("'deadline_ms': 2, 'on_breach': 'degrade', 'mode': 'degraded'", "'hold_us': 3000",
                  "'modes': {'nominal': {}, 'degraded': {}}, 'initial_mode': 'nominal',"),
      105ms);

  EXPECT_EQ(application->chains().report()[0].breaches, 10U);
  ASSERT_EQ(application->modes().switches().size(), 1U);
  EXPECT_EQ(application->modes().switches()[0].by, "sink");
  EXPECT_THAT(application->modes().switches()[0].why, HasSubstr("\"c\" took longer than 2 ms"));
  EXPECT_EQ(g_seen.count, 10) << "all are delivered";
}

// ---- What leads to a message ----

TEST(AChain, GoesOnThroughATimer) {
  const auto application = run(json(R"({
      "name": "x", "chains": [{"name": "c", "from": "a", "to": "b", "deadline_ms": 100}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 20, "remap": {"out": "a"}},
        {"name": "ticker", "library": "ticker", "serve_period_ms": 10, "serve_phase_ms": 4,
         "remap": {"in": "a", "out": "b"}},
        {"name": "sink", "library": "sink", "remap": {"in": "b"}}]})"),
                               205ms);

  const ChainReport chain = application->chains().report()[0];

  EXPECT_EQ(chain.age.max, 14e6) << "each is published twice";
  EXPECT_THAT(hops_of(chain), ElementsAre("source:a", "ticker:b", "sink"));
  EXPECT_EQ(chain.hops[1].waiting.max, 14e6);
}

TEST(AChain, CountsFromTheOldestOfASynchronizedSet) {
  // Both of one source: by way of a relay that takes 3 ms, and directly.
  const auto application = run(json(R"({
      "name": "x", "chains": [{"name": "c", "from": "a", "to": "b", "deadline_ms": 100}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 20, "remap": {"out": "a"}},
        {"name": "relay", "library": "relay", "params": {"hold_us": 3000},
         "remap": {"in": "a", "out": "slow"}},
        {"name": "fusion", "library": "fusion",
         "remap": {"left": "a", "right": "slow", "out": "b"}},
        {"name": "sink", "library": "sink", "remap": {"in": "b"}}]})"),
                               205ms);

  const ChainReport chain = application->chains().report()[0];

  EXPECT_EQ(chain.count, 10U);
  EXPECT_EQ(chain.age.max, 3e6);
  EXPECT_EQ(chain.age.mean, 3e6);
}

TEST(AChain, GoesOnThroughAService) {
  const auto application = run(json(R"({
      "name": "x", "chains": [{"name": "c", "from": "a", "to": "b", "deadline_ms": 4}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 20, "remap": {"out": "a"}},
        {"name": "server", "library": "server", "params": {"hold_us": 5000}},
        {"name": "asker", "library": "asker", "remap": {"in": "a", "out": "b"}},
        {"name": "sink", "library": "sink", "remap": {"in": "b"}}]})"),
                               199ms);

  const ChainReport chain = application->chains().report()[0];

  EXPECT_EQ(chain.count, 9U);
  EXPECT_EQ(chain.breaches, chain.count);
  EXPECT_EQ(chain.age.max, 5e6);
  ASSERT_EQ(chain.hops.size(), 5U) << "source, request, reply, answer, sink";
  ASSERT_NE(chain.largest_contributor(), nullptr);
  EXPECT_EQ(chain.largest_contributor()->component, "server");
}

TEST(AChain, OutlivesARestartOnItsWay) {
  const auto application = run(short_chain("'deadline_ms': 2, 'on_breach': 'drop'",
                                           "'throws_at': 5", "'on_fault': 'restart',"),
                               105ms);

  const ChainReport chain = application->chains().report()[0];
  const detail::Ledger ledger = ledger_of(*application, "b", "sink");
  EXPECT_EQ(chain.count, 9U);
  EXPECT_EQ(chain.dropped, 0U);
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.delivered, 9U);
}

TEST(AChain, IsOneOfSeveral) {
  const auto application = run(json(R"({
      "name": "x", "chains": [
        {"name": "whole", "from": "a", "to": "c", "deadline_ms": 1},
        {"name": "half", "from": "b", "to": "c", "deadline_ms": 4, "on_breach": "drop"},
        {"name": "other", "from": "a", "to": "b", "deadline_ms": 4}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 20, "remap": {"out": "a"}},
        {"name": "first", "library": "relay", "params": {"hold_us": 3000},
         "remap": {"in": "a", "out": "b"}},
        {"name": "second", "library": "relay", "remap": {"in": "b", "out": "c"}},
        {"name": "sink", "library": "sink", "remap": {"in": "c"}}]})"),
                               205ms);

  const auto chains = application->chains().report();

  EXPECT_EQ(chains[0].breaches, 10U);
  EXPECT_EQ(chains[1].breaches, 0U);
  EXPECT_EQ(chains[1].age.max, 3e6) << "from the time at which its root's message was taken";
  EXPECT_EQ(chains[2].breaches, 0U);
  EXPECT_THAT(hops_of(chains[1]), ElementsAre("first:b", "second:c", "sink"));
}

// ---- The largest contributor ----

TEST(AChain, BlamesTheHopThatIsHeldUp) {
  for (std::size_t hop = 1; hop <= 6; ++hop) {
    const auto application =
        run(six_hops(hop, "'hold_us': 5000", 3, "'serve_period_ms': 20"), 215ms);

    const ChainReport chain = application->chains().report()[0];

    EXPECT_EQ(chain.count, 10U);
    EXPECT_EQ(chain.breaches, 6U);
    ASSERT_NE(chain.largest_contributor(), nullptr);
    EXPECT_EQ(chain.largest_contributor()->component, fmt::format("r{}", hop));
    EXPECT_EQ(chain.largest_contributor()->breaches_by_waiting, 6U);
  }
}

/// Runs it live until 14 messages came through, one after the other; the largest contributor then.
std::string contributor_live(std::size_t hop, int delay_us, double deadline_ms) {
  const auto application = make(six_hops(hop, fmt::format("'sleep_us': {}", delay_us), deadline_ms,
                                         "'serve_period_ms': 1, 'params': {'paced': true}"));
  application->start();
  wait_until([] { return g_seen.count >= 14; });
  application->stop();
  const ChainReport chain = application->chains().report()[0];
  return chain.largest_contributor() == nullptr ? "nobody" : chain.largest_contributor()->component;
}

TEST(AChain, BlamesTheHopThatSleepsLive) {
  EXPECT_EQ(contributor_live(3, 20'000, 10), "r3");
}

TEST(ManyChains, BlameTheHopThatSleepsFiveMilliseconds) {
  for (std::size_t i = 0; i < 100; ++i) {
    const std::size_t hop = 1 + i % 6;
    ASSERT_EQ(contributor_live(hop, 5'000, 3), fmt::format("r{}", hop)) << "run " << i;
  }
}

// ---- How soon ----

TEST(ManyChains, ActOnEachBreachBeforeItsCallbackLive) {
  const auto application = make(json(R"({
      "name": "x", "modes": {"nominal": {}, "degraded": {}}, "initial_mode": "nominal",
      "chains": [{"name": "c", "from": "a", "to": "b", "deadline_ms": 0.01,
                  "on_breach": "degrade", "mode": "degraded"}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 1, "remap": {"out": "a"}},
        {"name": "relay", "library": "relay", "params": {"sleep_us": 20},
         "remap": {"in": "a", "out": "b"}},
        {"name": "sink", "library": "sink", "params": {"resets": true}, "remap": {"in": "b"}}]})"));
  application->start();
  wait_until([] { return g_seen.count >= 1000; });
  const int unasked = g_seen.unasked;  // While the run ends, no mode is switched any more.
  application->stop();

  const ChainReport chain = application->chains().report()[0];
  EXPECT_GE(chain.count, 1000U);
  EXPECT_EQ(chain.breaches, chain.count);
  EXPECT_EQ(unasked, 0);
}

TEST(ManyChains, DropEachStaleMessageLive) {
  std::string text = short_chain("'deadline_ms': 0.01, 'on_breach': 'drop'", "'sleep_us': 20");
  const std::string period = "'serve_period_ms': 10";
  text.replace(text.find(period), period.size(), "'serve_period_ms': 1");
  const auto application = make(text);
  application->start();
  wait_until([&] { return application->chains().report()[0].dropped >= 1000; });
  application->stop();

  const detail::Ledger ledger = ledger_of(*application, "b", "sink");
  EXPECT_EQ(g_seen.count, 0);
  EXPECT_TRUE(ledger.adds_up());
  EXPECT_EQ(ledger.delivered, 0U);
}

// ---- The same with any number of workers ----

TEST(AChain, IsTheSameWithAnyNumberOfWorkers) {
  const std::string text = json(R"({
      "name": "x", "modes": {"nominal": {}, "degraded": {"components": ["late"]}},
      "initial_mode": "nominal",
      "topics": {"b": {"multiple_publishers": true}},
      "chains": [{"name": "c", "from": "a", "to": "d", "deadline_ms": 4, "on_breach": "degrade",
                  "mode": "degraded"},
                 {"name": "e", "from": "a", "to": "b", "deadline_ms": 2, "on_breach": "drop"}],
      "components": [
        {"name": "source", "library": "source", "serve_period_ms": 7, "remap": {"out": "a"}},
        {"name": "left", "library": "relay", "params": {"hold_us": 1000},
         "remap": {"in": "a", "out": "b"}},
        {"name": "right", "library": "relay", "params": {"hold_us": 5000, "from": 4},
         "remap": {"in": "a", "out": "b"}},
        {"name": "late", "library": "relay", "remap": {"in": "a", "out": "d0"}},
        {"name": "asker", "library": "asker", "remap": {"in": "b", "out": "e"}},
        {"name": "server", "library": "server", "params": {"hold_us": 2000}},
        {"name": "ticker", "library": "ticker", "serve_period_ms": 5,
         "remap": {"in": "e", "out": "d"}},
        {"name": "sink", "library": "sink", "remap": {"in": "d"}},
        {"name": "other", "library": "sink", "remap": {"in": "d"}}]})");
  const auto result = [&](unsigned workers) {
    const auto application = run(text, 500ms, workers);
    std::string report = to_json(application->chains().report()).dump();
    for (const ModeSwitch& made : application->modes().switches()) {
      report += fmt::format("\n{} {} {}", made.stamp.time_since_epoch().count(), made.to, made.by);
    }
    return report;
  };

  const std::string one = result(1);

  EXPECT_THAT(one, HasSubstr("degraded"));
  EXPECT_EQ(result(2), one);
  EXPECT_EQ(result(4), one);
}

// ---- What is reported ----

TEST(AChain, StandsInReportTableAndStatus) {
  std::string text = short_chain("'deadline_ms': 2, 'on_breach': 'drop'", "'hold_us': 3000",
                                 "'status_period_ms': 50,");
  text.insert(text.size() - 2, ", {'name': 'supervisor', 'library': 'supervisor'}");

  const auto application = run(text, 105ms);
  const RunReport report = make_report(*application, 1s);

  EXPECT_THAT(to_table(report),
              HasSubstr("10 of 10 took longer than 2.00 ms, 10 dropped; largest contributor "
                        "to 10: relay, by waiting"));
  const nlohmann::ordered_json chain = to_json(report)["chains"][0];
  EXPECT_EQ(chain["name"], "c");
  EXPECT_EQ(chain["deadline_ms"], 2);
  EXPECT_EQ(chain["on_breach"], "drop");
  EXPECT_EQ(chain["breaches"], 10);
  EXPECT_EQ(chain["dropped"], 10);
  EXPECT_EQ(chain["age_us"]["max"], 3000);
  EXPECT_EQ(chain["hops"].size(), 3U);
  EXPECT_EQ(chain["hops"][1]["component"], "relay");
  EXPECT_EQ(chain["hops"][1]["topic"], "b");
  EXPECT_EQ(chain["hops"][2]["topic"], nullptr);
  EXPECT_EQ(chain["largest_contributor"]["component"], "relay");
  EXPECT_EQ(chain["largest_contributor"]["part"], "waiting");
  EXPECT_EQ(to_json(report)["results"]["chains"], "name: \"c\" count: 9 breaches: 9 dropped: 9");
}

TEST(AChain, IsReportedWrongWhereNothingGetsThrough) {
  const auto with = [](const std::string& from, const std::string& to,
                       const std::string& more = "") {
    std::string text = short_chain("'deadline_ms': 2", "", more);
    text.replace(text.find("'from': 'a', 'to': 'b'"), 22,
                 "'from': '" + from + "', 'to': '" + to + "'");
    return text;
  };

  EXPECT_EQ(problems_of(with("a", "b")), "");
  EXPECT_THAT(
      problems_of(with("aa", "b")),
      HasSubstr("/chains/0/from: the chain \"c\" begins at \"aa\", which nobody publishes"));
  EXPECT_THAT(
      problems_of(with("a", "bb")),
      HasSubstr("/chains/0/to: the chain \"c\" ends at \"bb\", to which nobody subscribes"));
  EXPECT_THAT(
      problems_of(with("b", "a")),
      HasSubstr("ends at \"a\", which nothing of \"b\" reaches; no component that subscribes to it "
                "publishes anything"));
  EXPECT_THAT(problems_of(with("a", "b", "'topics': {'a': {'latched': 1}},")),
              HasSubstr("begins at \"a\", whose messages do not grow old"));
}

TEST(AChain, CostsMessagesOfOtherApplicationsNothing) {
  std::string text = short_chain("'deadline_ms': 2", "");
  text.erase(text.find("'chains'"), text.find("'components'") - text.find("'chains'"));

  const auto application = run(text, 105ms);

  EXPECT_EQ(sizeof(detail::Envelope), 128U) << "two lines, as ever";
  EXPECT_EQ(application->chains().root_count(), 0U);
  EXPECT_EQ(application->chains().report().size(), 0U);
  EXPECT_EQ(to_json(make_report(*application, 1s)).count("chains"), 0U);
  for (const auto& subscription : application->topics().find("b")->subscriptions) {
    EXPECT_EQ(subscription->chain_end, nullptr);
    EXPECT_FALSE(subscription->lanes().front()->options.is_judged);
  }
}

}  // namespace
}  // namespace fastcycle::host
