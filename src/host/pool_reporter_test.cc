#include "host/pool_reporter.h"

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/status.h"
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using namespace std::chrono_literals;
using google::protobuf::Int64Value;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

/// Publishes a number each time that it is served.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    auto number = numbers_.loan();
    number->set_value(++count_);
    numbers_.publish(std::move(number));
  }

 private:
  Publisher<Int64Value> numbers_;
  std::int64_t count_ = 0;
};

/// Reads numbers, and keeps none.
class Reader final : public Component {
 public:
  explicit Reader(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) {});
  }
};

/// Keeps every sample of a callback.
class Hoarder final : public Component {
 public:
  explicit Hoarder(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Sample<Int64Value>& number) { kept_.push_back(number); });
  }

 private:
  std::vector<Sample<Int64Value>> kept_;
};

/// Keeps every sample of a view.
class Viewer final : public Component {
 public:
  explicit Viewer(Context& context)
      : Component(context), newest_(context.create_latest<Int64Value>("numbers")) {}

  void serve() override { kept_.push_back(newest_.get()); }

 private:
  Latest<Int64Value> newest_;
  std::vector<Sample<Int64Value>> kept_;
};

/// Borrows each time that it is served, and publishes nothing.
class Borrower final : public Component {
 public:
  explicit Borrower(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override { loans_.push_back(numbers_.loan()); }

 private:
  Publisher<Int64Value> numbers_;
  std::vector<Loan<Int64Value>> loans_;
};

/// Notes how much of `numbers` each component keeps, as the status says it.
class Supervisor final : public Component {
 public:
  explicit Supervisor(Context& context) : Component(context) {
    context.create_subscriber<status::Status>(
        "fastcycle/status", [this](const status::Status& status) {
          for (const auto& subscription : status.subscriptions()) {
            if (subscription.topic() == "numbers") {
              report(subscription.component(), static_cast<std::int64_t>(subscription.kept()));
            }
          }
        });
  }
};

/// The lines of the log, with the component in front.
class Lines {
 public:
  explicit Lines(Application& application) : application_(application) {
    application.log_queue().set_listener(this, [this](const detail::LogLine& line) {
      const std::lock_guard lock(mutex_);
      lines_.push_back(std::string(line.component) + ": " + std::string(line.text));
      changed_.notify_all();
    });
  }
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;
  ~Lines() { application_.log_queue().set_listener(this, {}); }

  /// Waits until there are `count`, or for a minute.
  std::vector<std::string> wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, 60s, [&] { return lines_.size() >= count; });
    return lines_;
  }

 private:
  Application& application_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> lines_;
};

TEST(AHoarder, IsNamedInTheLogWithItsTopicItsShareAndTheRemedyAndOnlyItLosesMessages) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Reader>("reader").with<Hoarder>("hoarder");
  const auto application = make_application(R"({"name": "a", "components": [
    {"name": "counter", "library": "counter", "serve_period_ms": 1},
    {"name": "reader", "library": "reader"}, {"name": "hoarder", "library": "hoarder"}]})",
                                            classes, {.is_simulated = true});
  Lines lines(*application);
  application->start();
  application->run(500ms);
  application->stop();

  EXPECT_THAT(lines.wait_for(3),
              Contains(AllOf(HasSubstr("hoarder: keeps 66 messages of \"numbers\" (publisher "
                                       "counter) beyond its callbacks, and 67 are its share"),
                             HasSubstr("SubscriberOptions::keep"))));
  const auto pool = static_cast<std::size_t>(detail::DropReason::kPool);
  const detail::Ledger reader = ledger_of(*application, "numbers", "reader");
  EXPECT_EQ(reader.dropped[pool], 0U);
  EXPECT_EQ(reader.delivered, reader.published);
  const detail::Ledger hoarder = ledger_of(*application, "numbers", "hoarder");
  EXPECT_EQ(hoarder.delivered, 66U);
  EXPECT_TRUE(hoarder.adds_up());
}

TEST(AHoarder, KeepsWhatTheFileSaysOfThePublisher) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Reader>("reader").with<Hoarder>("hoarder");
  const auto application = make_application(R"({"name": "a", "components": [
    {"name": "counter", "library": "counter", "serve_period_ms": 1,
     "publishers": {"numbers": {"keep": 1000}}},
    {"name": "reader", "library": "reader"}, {"name": "hoarder", "library": "hoarder"}]})",
                                            classes, {.is_simulated = true});
  application->start();
  application->run(500ms);
  application->stop();

  const detail::Ledger hoarder = ledger_of(*application, "numbers", "hoarder");
  EXPECT_GT(hoarder.published, 400U);
  EXPECT_EQ(hoarder.delivered, hoarder.published);
}

TEST(AHoarder, ThatMayKeepAllThatAPoolHasIsAnErrorOfTheFile) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Reader>("reader");
  const std::string text = R"({"name": "a", "topics": {"numbers": {"pool_max": 8, "latched": 2}},
    "components": [{"name": "counter", "library": "counter", "serve_period_ms": 1,
                    "publishers": {"numbers": {"keep": 6}}},
                   {"name": "reader", "library": "reader"}]})";
  EXPECT_THAT([&] { make_application(text, classes); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr(
                  "the pool of \"numbers\" has at most 8 messages (\"pool_max\" of the topic), and "
                  "8 are kept or latched")));
}

TEST(AHoarder, OfWhatAViewShowsIsNamedToo) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Reader>("reader").with<Viewer>("viewer");
  const auto application = make_application(R"({"name": "a", "components": [
    {"name": "counter", "library": "counter", "serve_period_ms": 1},
    {"name": "reader", "library": "reader"},
    {"name": "viewer", "library": "viewer", "serve_period_ms": 1}]})",
                                            classes, {.is_simulated = true});
  Lines lines(*application);
  application->start();
  application->run(500ms);
  application->stop();

  EXPECT_THAT(lines.wait_for(1), Contains(HasSubstr("viewer: keeps ")));
  EXPECT_EQ(ledger_of(*application, "numbers", "reader")
                .dropped[static_cast<std::size_t>(detail::DropReason::kPool)],
            0U);
}

TEST(AHoarder, IsSeenInTheStatus) {
  TestClasses classes;
  classes.with<Counter>("counter").with<Reader>("reader").with<Hoarder>("hoarder");
  classes.with<Supervisor>("supervisor");
  const auto application = make_application(
      R"({"name": "a", "status_period_ms": 10, "components": [
    {"name": "counter", "library": "counter", "serve_period_ms": 1},
    {"name": "reader", "library": "reader"}, {"name": "hoarder", "library": "hoarder"},
    {"name": "supervisor", "library": "supervisor"}]})",
      classes, {.is_simulated = true});
  application->start();
  application->run(500ms);
  application->stop();

  const auto& supervisor = *application->components()[3];
  EXPECT_EQ(supervisor.results.at("hoarder"), ReportValue(std::int64_t{66}));
  EXPECT_EQ(supervisor.results.at("reader"), ReportValue(std::int64_t{0}));
}

TEST(AHoarder, OfLoansIsNamedAndFailsBeforeItTakesAllMemory) {
  TestClasses classes;
  classes.with<Borrower>("borrower").with<Reader>("reader");
  const auto application = make_application(R"({"name": "a", "components": [
    {"name": "borrower", "library": "borrower", "serve_period_ms": 1},
    {"name": "reader", "library": "reader"}]})",
                                            classes, {.is_simulated = true});
  Lines lines(*application);
  application->start();
  application->run(2s);
  application->stop();

  EXPECT_THAT(lines.wait_for(1),
              Contains(HasSubstr("component \"borrower\" holds 166 loans of \"numbers\"")));
}

TEST(AHoarder, OfLoansIsNamedBeforeItFailsWhenItRunsLive) {
  TestClasses classes;
  classes.with<Borrower>("borrower").with<Reader>("reader");
  const auto application = make_application(R"({"name": "a", "components": [
    {"name": "borrower", "library": "borrower", "serve_period_ms": 1},
    {"name": "reader", "library": "reader"}]})",
                                            classes);
  Lines lines(*application);
  application->start();

  const auto seen = lines.wait_for(3);

  application->stop();
  EXPECT_THAT(seen, Contains(HasSubstr("borrower: holds 102 loans of \"numbers\"")));
  EXPECT_THAT(seen, Contains(HasSubstr("component \"borrower\" holds 166 loans")));
}

}  // namespace
}  // namespace fastcycle::host
