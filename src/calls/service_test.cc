#include "fastcycle/service.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "calls/client_core.h"
#include "calls/server_core.h"
#include "fastcycle/fastcycle.h"
#include "fastcycle/testing.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace std::chrono_literals;

/// What one call ended with, in words: "7", or "late".
std::string in_words(const Reply<Int64Value>& reply) {
  return reply.ok() ? std::to_string(reply->value()) : to_word(reply.status());
}

/// Serves "double": twice what it is asked; other numbers it takes as orders.
class Doubler final : public Component {
 public:
  static constexpr std::int64_t kThrow = 1000;
  static constexpr std::int64_t kKeep = 1001;    ///< Until the next `serve`.
  static constexpr std::int64_t kForget = 1002;  ///< Lets go of the responder.
  static constexpr std::int64_t kReject = 1003;
  static constexpr std::int64_t kNever = 1004;

  explicit Doubler(Context& context) : Component(context) {
    context.create_service<Int64Value, Int64Value>(
        "double", {.depth = 4}, [this](const Int64Value& request, Responder<Int64Value> responder) {
          take(request.value(), std::move(responder));
        });
  }

  void serve() override {
    for (auto& responder : kept_) {
      auto reply = responder.loan();
      reply->set_value(77);
      responder.answer(std::move(reply));
    }
    kept_.clear();
  }

 private:
  void take(std::int64_t value, Responder<Int64Value> responder) {
    if (value == kThrow) {
      throw std::runtime_error("asked to");
    }
    if (value == kKeep) {
      kept_.push_back(std::move(responder));
    } else if (value == kReject) {
      responder.reject("no such number");
    } else if (value == kNever) {
      never_.push_back(std::move(responder));
    } else if (value != kForget) {
      auto reply = responder.loan();
      reply->set_value(2 * value);
      responder.answer(std::move(reply));
    }
  }

  std::vector<Responder<Int64Value>> kept_;
  std::vector<Responder<Int64Value>> never_;
};

/// Asks "double" for each number that it gets on "ask", and publishes on "results" what came of it.
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context),
        deadline_ms_(context.param<std::int64_t>("deadline_ms", {.fallback = 100})),
        doubler_(context.create_client<Int64Value, Int64Value>("double", {.max_open = 8})),
        results_(context.create_publisher<StringValue>("results")) {
    context.create_subscriber<Int64Value>("ask",
                                          [this](const Int64Value& value) { ask(value.value()); });
  }

 private:
  void ask(std::int64_t value) {
    if (value < 0) {
      call_.cancel();
      return;
    }
    auto request = doubler_.loan();
    request->set_value(value);
    call_ = doubler_.call(
        std::move(request), {.deadline = std::chrono::milliseconds(deadline_ms_.get())},
        [this](const Reply<Int64Value>& reply) {
          auto result = results_.loan();
          result->set_value(reply.ok() ? in_words(reply) : std::string(reply.error()));
          results_.publish(std::move(result));
        });
  }

  Param<std::int64_t> deadline_ms_;
  Client<Int64Value, Int64Value> doubler_;
  Publisher<StringValue> results_;
  Call call_;
};

Int64Value number(std::int64_t value) {
  Int64Value message;
  message.set_value(value);
  return message;
}

std::vector<std::string> texts(const std::vector<StringValue>& messages) {
  std::vector<std::string> result;
  for (const StringValue& message : messages) {
    result.push_back(message.value());
  }
  return result;
}

/// A server and who asks it.
struct AskedTest : ::testing::Test {
  void run(const std::string& of_doubler = "{}") {
    if (has_server) {
      bench.add<Doubler>("doubler", of_doubler);
    }
    bench.add<Asker>("asker");
    ask.emplace(bench.input<Int64Value>("ask"));
    results.emplace(bench.output<StringValue>("results"));
    bench.start();
  }

  std::vector<std::string> asked(std::int64_t value) {
    ask->publish(number(value));
    return texts(results->take());
  }
  std::vector<std::string> after(Duration span) {
    bench.advance(span);
    return texts(results->take());
  }

  bool has_server = true;
  fastcycle::testing::Bench bench;
  std::optional<fastcycle::testing::Bench::Input<Int64Value>> ask;
  std::optional<fastcycle::testing::Bench::Output<StringValue>> results;
};

using AService = AskedTest;

TEST_F(AService, AnswersAtOnceOrLater) {
  run(R"({"serve_period_ms": 10})");

  EXPECT_THAT(asked(4), ElementsAre("8"));
  EXPECT_THAT(asked(Doubler::kKeep), IsEmpty());
  EXPECT_THAT(after(9ms), IsEmpty());
  EXPECT_THAT(after(1ms), ElementsAre("77"));
}

TEST_F(AService, ThatNobodyGivesIsAbsent) {
  has_server = false;
  run();

  EXPECT_THAT(asked(4), ElementsAre("\"double\": absent, no component serves it"));
}

TEST_F(AService, WhoseComponentFailsAnswersFaultedAndIsAbsentAfterwards) {
  run();

  EXPECT_THAT(asked(Doubler::kThrow), ElementsAre(HasSubstr("\"double\": faulted, component "
                                                            "\"doubler\": its callback for ")));
  EXPECT_THAT(asked(4), ElementsAre("\"double\": absent, component \"doubler\", which serves it, "
                                    "has failed"));
}

TEST_F(AService, ThatIsRestartedAnswersFaultedToAllThatItOwedAndGoesOn) {
  run(R"({"on_fault": "restart"})");

  EXPECT_THAT(asked(Doubler::kNever), IsEmpty());
  EXPECT_THAT(asked(Doubler::kThrow), ElementsAre(HasSubstr("faulted"), HasSubstr("asked to")));
  EXPECT_THAT(asked(4), ElementsAre("8"));
}

TEST_F(AService, ThatDoesNotAnswerIsLateAtItsDeadline) {
  run(R"({"serve_period_ms": 150})");

  EXPECT_THAT(asked(Doubler::kKeep), IsEmpty());
  EXPECT_THAT(after(99ms), IsEmpty());
  EXPECT_THAT(after(1ms), ElementsAre("\"double\": late, 100 ms are over"));
  EXPECT_THAT(after(1s), IsEmpty()) << "the later answer reaches nobody";
}

TEST_F(AService, RejectsWithAReason) {
  run();

  EXPECT_THAT(asked(Doubler::kReject), ElementsAre("\"double\": rejected, no such number"));
}

TEST_F(AService, WhoseResponderIsDroppedSaysSo) {
  run();

  EXPECT_THAT(asked(Doubler::kForget),
              ElementsAre("\"double\": unanswered, the server let go of the request without an "
                          "answer"));
}

TEST_F(AService, ThatOwesTooManyAnswersIsBusy) {
  run();
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(asked(Doubler::kNever), IsEmpty());
  }

  EXPECT_THAT(asked(4), ElementsAre("\"double\": busy, component \"doubler\" owes 4 answers, and "
                                    "takes no more requests"));
  EXPECT_THAT(after(100ms), SizeIs(4)) << "those are late";
  EXPECT_THAT(asked(4), ElementsAre("8")) << "what nobody waits for is not owed any more";
}

TEST_F(AService, IsCancelledByItsCaller) {
  run();
  EXPECT_THAT(asked(Doubler::kNever), IsEmpty());

  EXPECT_THAT(asked(-1), ElementsAre("\"double\": cancelled"));
  EXPECT_THAT(asked(-1), IsEmpty()) << "once";
  EXPECT_THAT(after(1s), IsEmpty());
}

TEST_F(AService, OfAComponentThatIsNotActiveIsAbsent) {
  run();
  EXPECT_THAT(asked(Doubler::kNever), IsEmpty());

  bench.deactivate("doubler");
  EXPECT_THAT(texts(results->take()),
              ElementsAre("\"double\": absent, component \"doubler\" is not active"));
  EXPECT_THAT(asked(4), ElementsAre("\"double\": absent, component \"doubler\", which serves it, "
                                    "is not active"));
  bench.activate("doubler");
  EXPECT_THAT(asked(4), ElementsAre("8"));
}

TEST_F(AService, OwesNothingToAComponentThatIsNotActiveAnyMore) {
  run();
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(asked(Doubler::kNever), IsEmpty());
  }

  bench.deactivate("asker");
  EXPECT_THAT(texts(results->take()), SizeIs(4)) << "they are cancelled";
  bench.activate("asker");
  EXPECT_THAT(asked(4), ElementsAre("8"));
}

/// The result of one call of `Asker` in a live application.
class LiveAsker final : public Component {
 public:
  explicit LiveAsker(Context& context)
      : Component(context),
        order_(context.param<std::int64_t>("order")),
        doubler_(context.create_client<Int64Value, Int64Value>("double")),
        source_(context.create_source()) {}

  void start() override {
    auto request = doubler_.loan();
    request->set_value(order_.get());
    doubler_.call(std::move(request), {.deadline = 5ms}, [this](const Reply<Int64Value>& reply) {
      report("result", in_words(reply));
      source_.finish();
    });
  }

 private:
  Param<std::int64_t> order_;
  Client<Int64Value, Int64Value> doubler_;
  Source source_;
};

std::string live_result(std::int64_t order, bool has_server = true) {
  TestClasses classes;
  classes.with<LiveAsker>("asker").with<Doubler>("doubler");
  const auto application = make_application(
      fmt::format(
          R"({{"name": "test", "executors": [{{"name": "a"}}, {{"name": "b"}}],
                      "components": [{}
        {{"name": "asker", "library": "asker", "executor": "b", "params": {{"order": {}}}}}]}})",
          has_server ? R"({"name": "doubler", "library": "doubler", "executor": "a"},)" : "",
          order),
      classes);
  application->start();
  EXPECT_EQ(application->run(60s), EndReason::kSourcesFinished);
  application->stop();
  return std::get<std::string>(application->components().back()->results.at("result"));
}

TEST(ALiveService, AnswersOrSaysWhyNot) {
  EXPECT_THAT(live_result(4), ::testing::AnyOf("8", "late"));
  EXPECT_EQ(live_result(Doubler::kNever), "late");
  EXPECT_EQ(live_result(4, false), "absent");
  EXPECT_THAT(live_result(Doubler::kThrow), ::testing::AnyOf("faulted", "late"));
}

}  // namespace
}  // namespace fastcycle::host
