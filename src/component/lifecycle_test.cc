#include "component/lifecycle.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "report/report.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using ::testing::ElementsAre;
using ::testing::UnorderedElementsAre;
using namespace std::chrono_literals;
using State = detail::ComponentCore::State;

std::atomic<bool> g_may_go{false};
std::atomic<int> g_hanging{0};
std::atomic<int> g_alive{0};

void hang() {
  ++g_hanging;
  while (!g_may_go) {
    std::this_thread::sleep_for(1ms);
  }
}

void wait_until_hanging(int count) {
  while (g_hanging < count) {
    std::this_thread::sleep_for(1ms);
  }
}

/// Hangs where its param says, until the test lets it go.
class Hanging final : public Component {
 public:
  explicit Hanging(Context& context)
      : Component(context), where_(context.param<std::string>("where", {.fallback = ""})) {
    ++g_alive;
    if (where_.get() == "callback") {
      context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) { hang(); });
    }
    if (where_.get() == "thread") {
      context.create_thread("own", [](const std::stop_token&) { hang(); });
    }
  }
  ~Hanging() override { --g_alive; }

  void start() override { hang_in("start"); }
  void serve() override {
    hang_in("serve");
    if (where_.get() == "job" && !std::exchange(has_offloaded_, true)) {
      context().offload("jobs", [] { hang(); }, [] {});
    }
  }
  void stop() override { hang_in("stop"); }

 private:
  void hang_in(const char* where) {
    if (where_.get() == where) {
      hang();
    }
  }

  Param<std::string> where_;
  bool has_offloaded_ = false;
};

class Talker final : public Component {
 public:
  explicit Talker(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void serve() override { numbers_.publish(numbers_.loan()); }

 private:
  Publisher<Int64Value> numbers_;
};

class ALifecycle : public ::testing::Test {
 protected:
  ALifecycle() {
    classes_.with<Hanging>("hanging").with<Talker>("talker");
    g_may_go = false;
    g_hanging = 0;
    g_alive = 0;
  }

  [[nodiscard]] std::vector<std::pair<std::string, std::string>> stuck() const {
    std::vector<std::pair<std::string, std::string>> found;
    for (const StuckCall& one : application_->stuck()) {
      found.emplace_back(one.component, one.call);
    }
    return found;
  }

  [[nodiscard]] State state_of(const std::string& name) const {
    const auto& all = application_->components();
    return (*std::ranges::find_if(all, [&](const auto& core) { return core->name == name; }))
        ->state;
  }

  TestClasses classes_;
  std::unique_ptr<Application> application_;
};

TEST_F(ALifecycle, EndsWhateverComponentsDoAndNamesThoseThatHang) {
  application_ = make_application(R"({"name": "test",
    "executors": [{"name": "a"}, {"name": "b"}, {"name": "c"}, {"name": "d"}, {"name": "e"},
                  {"name": "jobs"}, {"name": "rest"}],
    "components": [
      {"name": "in_callback", "library": "hanging", "executor": "a", "params": {"where": "callback"}},
      {"name": "in_serve", "library": "hanging", "executor": "b", "serve_period_ms": 1,
       "params": {"where": "serve"}},
      {"name": "in_stop", "library": "hanging", "executor": "c", "params": {"where": "stop"}},
      {"name": "in_thread", "library": "hanging", "executor": "d", "params": {"where": "thread"}},
      {"name": "in_job", "library": "hanging", "executor": "e", "serve_period_ms": 1,
       "params": {"where": "job"}},
      {"name": "well", "library": "hanging", "executor": "rest"},
      {"name": "talker", "library": "talker", "executor": "rest", "serve_period_ms": 1}]})",
                                  classes_);
  application_->start();
  wait_until_hanging(4);
  application_->request_end(EndReason::kRequested);
  EXPECT_EQ(application_->run(std::nullopt), EndReason::kRequested);

  application_->stop();  // Returns, although all of them hang.

  using Pair = std::pair<std::string, std::string>;
  EXPECT_THAT(stuck(),
              UnorderedElementsAre(Pair("in_callback", "its callback for \"numbers\""),
                                   Pair("in_serve", "its serve()"), Pair("in_stop", "its stop()"),
                                   Pair("in_thread", "its thread \"own\""),
                                   Pair("in_job", "work that it offloaded")));
  EXPECT_EQ(state_of("well"), State::kStopped);
  EXPECT_EQ(state_of("talker"), State::kStopped);
  EXPECT_EQ(g_alive, 5);  // The objects of those that hang are left alone.
  const RunReport report = make_report(*application_, 1s);
  EXPECT_EQ(to_json(report)["components"]["in_serve"]["state"], "stuck");
  EXPECT_EQ(to_json(report)["components"]["well"]["state"], "stopped");

  g_may_go = true;
  application_.reset();
  EXPECT_EQ(g_alive, 0);
}

TEST_F(ALifecycle, EndsInSimulatedTimeToo) {
  application_ = make_application(R"({"name": "test", "components": [
      {"name": "slow", "library": "hanging", "serve_period_ms": 1, "params": {"where": "serve"}},
      {"name": "well", "library": "hanging", "serve_period_ms": 1}]})",
                                  classes_, {.is_simulated = true, .workers = 1});
  application_->start();
  {
    const std::jthread somebody([this] {
      wait_until_hanging(1);
      application_->request_end(EndReason::kRequested);
    });
    EXPECT_EQ(application_->run(std::nullopt), EndReason::kRequested);
  }
  application_->stop();
  EXPECT_THAT(stuck(), ElementsAre(std::pair<std::string, std::string>("slow", "its serve()")));
  EXPECT_EQ(g_alive, 2);  // One thread serves all: none of their objects is touched.
  g_may_go = true;
  application_.reset();
  EXPECT_EQ(g_alive, 0);
}

TEST_F(ALifecycle, EndsAStartThatHangsWhenTheRunIsToEnd) {
  application_ = make_application(R"({"name": "test", "executors": [{"name": "a"}, {"name": "b"}],
    "components": [
      {"name": "slow", "library": "hanging", "executor": "a", "params": {"where": "start"}},
      {"name": "well", "library": "hanging", "executor": "b"}]})",
                                  classes_);
  {
    const std::jthread somebody([this] {
      wait_until_hanging(1);
      application_->request_end(EndReason::kRequested);
    });
    application_->start();
  }
  EXPECT_EQ(application_->run(std::nullopt), EndReason::kRequested);
  EXPECT_EQ(state_of("well"), State::kConstructed);
  application_->stop();
  EXPECT_THAT(stuck(), ElementsAre(std::pair<std::string, std::string>("slow", "its start()")));
  g_may_go = true;
  application_.reset();
  EXPECT_EQ(g_alive, 0);
}

TEST_F(ALifecycle, EndsAStartThatTakesLongerThanAllMay) {
  application_ = make_application(R"({"name": "test", "components": [
      {"name": "slow", "library": "hanging", "params": {"where": "start"}}]})",
                                  classes_);
  application_->start(10ms);
  EXPECT_EQ(application_->run(std::nullopt), EndReason::kFault);
  g_may_go = true;  // It comes back while the application stops.
  application_->stop();
  EXPECT_THAT(stuck(), ElementsAre());
  EXPECT_EQ(state_of("slow"), State::kFailed);
  EXPECT_EQ(g_alive, 0);
}

TEST_F(ALifecycle, DoesNotLetAStartWaitForOneThatHangsOnItsExecutor) {
  application_ = make_application(R"({"name": "test", "start_timeout_ms": 5,
    "executors": [{"name": "a"}],
    "components": [
      {"name": "slow", "library": "hanging", "executor": "a", "params": {"where": "start"}},
      {"name": "behind", "library": "hanging", "executor": "a"}]})",
                                  classes_);
  application_->start();
  EXPECT_EQ(state_of("behind"), State::kConstructed);
  g_may_go = true;
  application_->stop();
  EXPECT_THAT(application_->components()[0]->faults,
              ElementsAre("its start() takes longer than 5 ms"));
  EXPECT_THAT(application_->components()[1]->faults,
              ElementsAre("its start() could not begin within 1005 ms: its executor is busy"));
}

/// Throws whenever it is called.
class Throwing final : public Component {
 public:
  explicit Throwing(Context& context) : Component(context) {}
  void serve() override { throw std::runtime_error("on purpose"); }
};

/// A run of one that always throws, and may be made anew twice. Returns why it ended.
EndReason run_throwing(const std::string& then, std::unique_ptr<Application>& application) {
  TestClasses classes;
  classes.with<Throwing>("throwing");
  application = make_application(
      R"({"name": "t", "components": [{"name": "throwing", "library": "throwing",
          "serve_period_ms": 10, "on_fault": "restart",
          "restart": {"limit": 2, "within_s": 60, "then": ")" +
          then + R"("}}]})",
      classes, {.is_simulated = true});
  application->start();
  const EndReason reason = application->run(1s);
  application->stop();
  return reason;
}

TEST(RestartsThatAreUsedUp, LeaveTheComponentStopped) {
  // In one process there is none that could be restarted instead.
  for (const char* then : {"stay", "process"}) {
    std::unique_ptr<Application> application;
    EXPECT_FALSE(is_failure(run_throwing(then, application))) << then;

    const detail::ComponentCore& core = *application->components().front();
    EXPECT_EQ(core.state, State::kFailed);
    EXPECT_EQ(core.renewals(), 2U);
    EXPECT_EQ(core.last_fault,
              "its serve() threw: on purpose (restarted 2 times within 60 s: it stays stopped)");
  }
}

/// Loses its device in its first callback: so many of the next starts throw.
int g_starts_that_throw = 0;
class Unplugged final : public Component {
 public:
  explicit Unplugged(Context& context) : Component(context) {}
  void start() override {
    if (g_starts_that_throw > 0) {
      --g_starts_that_throw;
      throw std::runtime_error("no device");
    }
  }
  void serve() override {
    if (std::exchange(is_first, false)) {
      g_starts_that_throw = starts_that_will_throw;
      throw std::runtime_error("device lost");
    }
    ++served;
  }
  static inline bool is_first = true;
  static inline int starts_that_will_throw = 0;
  static inline int served = 0;
};

class StartsThatThrow : public ::testing::TestWithParam<int> {
 protected:
  StartsThatThrow() {
    Unplugged::is_first = true;
    Unplugged::served = 0;
    Unplugged::starts_that_will_throw = GetParam();
    classes_.with<Unplugged>("unplugged");
    application_ = make_application(
        R"({"name": "t", "components": [{"name": "unplugged", "library": "unplugged",
            "serve_period_ms": 10, "on_fault": "restart",
            "restart": {"limit": 3, "within_s": 60, "back_off_ms": 20}}]})",
        classes_, {.is_simulated = true});
    application_->start();
    application_->run(1s);
    application_->stop();
  }
  TestClasses classes_;
  std::unique_ptr<Application> application_;
};

TEST_P(StartsThatThrow, AreRepeatedUpToTheLimit) {
  const detail::ComponentCore& core = *application_->components().front();
  if (GetParam() < 3) {
    EXPECT_EQ(core.state, State::kStopped);
    EXPECT_GT(Unplugged::served, 50);
    EXPECT_EQ(core.fault_count, 1U + static_cast<unsigned>(GetParam()));
  } else {
    EXPECT_EQ(core.state, State::kFailed);
    EXPECT_EQ(Unplugged::served, 0);
    EXPECT_EQ(core.last_fault,
              "its start() threw when it was restarted: no device (restarted 3 times within 60 s: "
              "it stays stopped)");
  }
}
INSTANTIATE_TEST_SUITE_P(Times, StartsThatThrow, ::testing::Values(0, 1, 2, 3, 10));

TEST(RestartsThatAreUsedUp, StopTheApplicationWhereItSaysSo) {
  std::unique_ptr<Application> application;
  EXPECT_EQ(run_throwing("stop", application), EndReason::kFault);

  EXPECT_EQ(application->components().front()->fault_count, 3U);
  EXPECT_THAT(application->components().front()->last_fault,
              ::testing::HasSubstr("the application stops"));
}

}  // namespace
}  // namespace fastcycle::host
