#include "fastcycle/action.h"

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"

namespace fastcycle {
namespace {

using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;
using namespace std::chrono_literals;

Int64Value number(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message;
}

/// Walks as many steps as the goal says, one each tick of its Serve Timer. Negative goals it
/// rejects; at step 13 it throws; a goal of 0 it lets go of, one of 12 it aborts after two steps.
class Walker final : public Component {
 public:
  explicit Walker(Context& context)
      : Component(context), how_(context.param<std::string>("how", {.fallback = "default"})) {
    ActionServerOptions options{.max_goals = 2};
    if (how_.get() != "default") {
      options.on_cancel = [this](std::uint64_t goal) {
        report("result", true);
        if (how_.get() == "at_once") {
          cancel(goal);
        }
      };
    }
    context.create_action_server<Int64Value, Int64Value, Int64Value>(
        "walk", options, [this](const Int64Value& goal, ServerGoal<Int64Value, Int64Value> its) {
          if (goal.value() < 0) {
            its.reject("backwards");
          } else if (goal.value() > 0) {
            walks_.push_back({goal.value(), 0, std::move(its)});
          }
        });
  }

  void serve() override {
    for (Walk& walk : walks_) {
      step(walk);
    }
    std::erase_if(walks_, [](const Walk& walk) { return !walk.goal.is_active(); });
  }

 private:
  struct Walk {
    std::int64_t steps;
    std::int64_t done;
    ServerGoal<Int64Value, Int64Value> goal;
  };

  void step(Walk& walk) {
    if (!walk.goal.is_active()) {
      return;
    }
    if (walk.goal.is_cancelled() && how_.get() == "when_asked") {
      end(walk);
      return;
    }
    report("steps", ++total_);
    if (++walk.done == 13) {
      throw std::runtime_error("stumbled");
    }
    if (walk.done == walk.steps) {
      walk.goal.succeed(number(walk.done));
      return;
    }
    if (walk.steps == 12 && walk.done == 2) {
      walk.goal.abort("tired");
      return;
    }
    auto feedback = walk.goal.loan_feedback();
    feedback->set_value(walk.done);
    walk.goal.publish(std::move(feedback));
  }

  static void end(Walk& walk) {
    auto result = walk.goal.loan();
    result->set_value(walk.done);
    walk.goal.cancelled(std::move(result));
  }

  void cancel(std::uint64_t goal) {
    for (Walk& walk : walks_) {
      if (walk.goal.number() == goal) {
        end(walk);
      }
    }
  }

  Param<std::string> how_;
  std::vector<Walk> walks_;
  std::int64_t total_ = 0;
};

/// Sends a goal for each number on "go", cancels the last one for 1000000; publishes what it
/// receives.
class Sender final : public Component {
 public:
  explicit Sender(Context& context)
      : Component(context),
        deadline_ms_(context.param<std::int64_t>("deadline_ms", {.fallback = 0})),
        walks_(context.create_action_client<Int64Value, Int64Value, Int64Value>("walk")),
        results_(context.create_publisher<StringValue>("results")) {
    context.create_subscriber<Int64Value>("go", [this](const Int64Value& go) {
      if (go.value() == 1'000'000) {
        walk_.cancel();
      } else {
        send(go);
      }
    });
  }

 private:
  void send(const Int64Value& go) {
    GoalOptions<Int64Value> options;
    if (deadline_ms_.get() > 0) {
      options.call.deadline = std::chrono::milliseconds(deadline_ms_.get());
    }
    options.on_accepted = [this] { publish("accepted"); };
    options.on_feedback = [this](const Int64Value& done) { publish(std::to_string(done.value())); };
    auto goal = walks_.loan();
    goal->CopyFrom(go);
    walk_ = walks_.send(std::move(goal), std::move(options), [this](const Reply<Int64Value>& end) {
      const bool has_end = end.has_value() && end.status() != CallStatus::kAborted;
      publish((end.ok() ? "ok" : std::string(end.error())) +
              (has_end ? ": " + std::to_string(end->value()) : ""));
    });
  }

  void publish(const std::string& text) {
    auto result = results_.loan();
    result->set_value(text);
    results_.publish(std::move(result));
  }

  Param<std::int64_t> deadline_ms_;
  ActionClient<Int64Value, Int64Value, Int64Value> walks_;
  Publisher<StringValue> results_;
  Call walk_;
};

struct AGoal : ::testing::Test {
  static constexpr std::int64_t kCancel = 1'000'000;

  void run(const std::string& walker = "{}", const std::string& sender = "{}") {
    bench.add<Walker>("walker", R"({"serve_period_ms": 10, )" + walker.substr(1));
    bench.add<Sender>("sender", sender);
    go.emplace(bench.input<Int64Value>("go"));
    results.emplace(bench.output<StringValue>("results"));
    bench.start();
  }

  std::vector<std::string> send_goal(std::int64_t value) {
    go->publish(number(value));
    return received();
  }
  std::vector<std::string> after(Duration span) {
    bench.advance(span);
    return received();
  }
  std::vector<std::string> received() {
    std::vector<std::string> texts;
    for (const StringValue& message : results->take()) {
      texts.push_back(message.value());
    }
    return texts;
  }
  [[nodiscard]] std::int64_t steps() const {
    return std::get<std::int64_t>(bench.result("walker", "steps"));
  }

  testing::Bench bench;
  std::optional<testing::Bench::Input<Int64Value>> go;
  std::optional<testing::Bench::Output<StringValue>> results;
};

constexpr const char* kPlain = "{\"on_fault\": \"stop_component\"}";

TEST_F(AGoal, IsAcceptedTellsHowFarItIsAndIsReached) {
  run(kPlain);

  EXPECT_THAT(send_goal(3), ElementsAre("accepted"));
  EXPECT_THAT(after(10ms), ElementsAre("1"));
  EXPECT_THAT(after(20ms), ElementsAre("2", "ok: 3"));
  EXPECT_THAT(after(1s), IsEmpty());
}

TEST_F(AGoal, IsRejectedWithAReason) {
  run(kPlain);

  EXPECT_THAT(send_goal(-1), ElementsAre("\"walk\": rejected, backwards"));
}

TEST_F(AGoal, ThatItsServerLetsGoOfIsUnanswered) {
  run(kPlain);

  EXPECT_THAT(send_goal(0), ElementsAre(HasSubstr("\"walk\": unanswered")));
}

TEST_F(AGoal, IsAbortedWithAReason) {
  run(kPlain);

  EXPECT_THAT(send_goal(12), ElementsAre("accepted"));
  EXPECT_THAT(after(1s), ElementsAre("1", HasSubstr("\"walk\": aborted, tired")));
}

TEST_F(AGoal, ThatIsCancelledStopsWithinOneCallback) {
  run(kPlain);
  EXPECT_THAT(send_goal(50), ElementsAre("accepted"));
  EXPECT_THAT(after(25ms), ElementsAre("1", "2"));

  EXPECT_THAT(send_goal(kCancel), ElementsAre("\"walk\": cancelled: 0"));
  EXPECT_THAT(send_goal(kCancel), IsEmpty()) << "once";
  EXPECT_THAT(after(1s), IsEmpty());
  EXPECT_EQ(steps(), 2) << "not one more";
}

TEST_F(AGoal, ThatIsCancelledIsAnActivationOfItsServerWhichSaysWhatWasReached) {
  run(R"({"params": {"how": "at_once"}})");
  EXPECT_THAT(send_goal(50), ElementsAre("accepted"));
  EXPECT_THAT(after(25ms), ElementsAre("1", "2"));

  EXPECT_THAT(send_goal(kCancel), ElementsAre("\"walk\": cancelled: 2"));
  EXPECT_THAT(after(1s), IsEmpty());
  EXPECT_EQ(steps(), 2);
}

TEST_F(AGoal, ThatIsCancelledIsSeenInTheNextCallback) {
  run(R"({"params": {"how": "when_asked"}})");
  EXPECT_THAT(send_goal(50), ElementsAre("accepted"));
  EXPECT_THAT(after(25ms), ElementsAre("1", "2"));

  EXPECT_THAT(send_goal(kCancel), IsEmpty());
  EXPECT_EQ(bench.result("walker", "result"), ReportValue(true));
  EXPECT_THAT(after(5ms), ElementsAre("\"walk\": cancelled: 2"));
  EXPECT_THAT(after(1s), IsEmpty());
  EXPECT_EQ(steps(), 2);
}

TEST_F(AGoal, MayBeReachedAllTheSameWhenItIsCancelled) {
  run(R"({"params": {"how": "never"}})");
  EXPECT_THAT(send_goal(3), ElementsAre("accepted"));

  EXPECT_THAT(send_goal(kCancel), IsEmpty());
  EXPECT_THAT(after(30ms), ElementsAre("1", "2", "ok: 3"));
  EXPECT_THAT(send_goal(kCancel), IsEmpty());
}

TEST_F(AGoal, IsLateAtItsDeadlineAndItsServerStops) {
  run(kPlain, R"({"params": {"deadline_ms": 15}})");
  EXPECT_THAT(send_goal(5), ElementsAre("accepted"));

  EXPECT_THAT(after(1s), ElementsAre("1", "\"walk\": late, 15 ms are over"));
  EXPECT_EQ(steps(), 1);
}

TEST_F(AGoal, AboveTheLimitIsBusy) {
  run(kPlain);
  EXPECT_THAT(send_goal(5), ElementsAre("accepted"));
  EXPECT_THAT(send_goal(6), ElementsAre("accepted"));

  EXPECT_THAT(send_goal(7), ElementsAre(HasSubstr("\"walk\": busy")));
  EXPECT_THAT(after(1s),
              UnorderedElementsAre("1", "1", "2", "2", "3", "3", "4", "4", "ok: 5", "5", "ok: 6"));
}

TEST_F(AGoal, OfAServerThatFailsIsFaultedOnceAndThenAbsent) {
  run(kPlain);
  EXPECT_THAT(send_goal(50), ElementsAre("accepted"));

  EXPECT_THAT(after(1s).back(), HasSubstr("\"walk\": faulted, component \"walker\": its serve() "
                                          "threw: stumbled"));
  EXPECT_THAT(after(1s), IsEmpty());
  EXPECT_THAT(send_goal(5), ElementsAre(HasSubstr("\"walk\": absent")));
}

TEST_F(AGoal, OfAServerThatIsRestartedIsFaultedAndTheNextIsReached) {
  run(R"({"on_fault": "restart"})");
  EXPECT_THAT(send_goal(50), ElementsAre("accepted"));
  EXPECT_THAT(after(1s).back(), HasSubstr("\"walk\": faulted"));

  EXPECT_THAT(send_goal(1), ElementsAre("accepted"));
  EXPECT_THAT(after(10ms), ElementsAre("ok: 1"));
}

}  // namespace
}  // namespace fastcycle
