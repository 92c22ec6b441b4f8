// A recorded run, executed again by `ExactReplay`: the same bytes, or the first that are not.

#include "replay/exact_replay.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "host/test_everything.h"
#include "record/recorded_schedule.h"
#include "record/recording_reader.h"
#include "replay/recorded_driver.h"
#include "replay/stand_ins.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

using Results = std::map<std::string, ExactReplayResult>;

class ExactReplays : public testing::Test {
 protected:
  /// Runs the application of `text` live for `time`, and records it without the topics `left_out`.
  /// `beside` is called meanwhile, on a thread of its own.
  void record(const std::string& text, Duration time, const std::vector<std::string>& left_out = {},
              const std::function<void(Application&)>& beside = nullptr) {
    config::Problems problems;
    Application application(describe_text(text, problems), ClockOptions{});
    config::RecordDescription recorded;
    recorded.file = file_;
    recorded.except = left_out;
    application.record(recorded);
    application.build(classes_, problems, ConstructorFault::kFault);
    ASSERT_FALSE(problems.has_errors()) << config::to_string(problems.all().front());
    application.start();
    std::thread others([&] {
      if (beside) {
        beside(application);
      }
    });
    application.run(time);
    others.join();
    application.stop();
  }

  /// Executes the log again, in an application of `text`.
  Results replay(const std::string& text, ExactReplayOptions options = {}) {
    options.files = {file_};
    const auto schedule = record::RecordedSchedule::read(options.files);
    const record::RecordingReader reader(options.files);
    config::Problems problems;
    config::ApplicationDescription description = describe_text(text, problems);
    description.log_level = LogLevel::kError;
    StandIns stand_ins(classes_, description, reader.streams());
    auto driver = std::make_unique<RecordedDriver>();
    RecordedDriver& recorded = *driver;
    Application application(std::move(driver), stand_ins.description());
    application.own_topics_are_free = true;
    application.declare_stand_in = [&](auto& core) { stand_ins.declare(core); };
    application.build(stand_ins, problems, ConstructorFault::kFault);
    ExactReplay replay(application, recorded, schedule, options, problems);
    EXPECT_FALSE(problems.has_errors()) << config::to_string(problems.all().front());
    replay.run(nullptr);
    Results results;
    for (const ExactReplayResult& result : replay.results()) {
      results[result.component] = result;
    }
    return results;
  }

  static std::string in_words(const ExactReplayResult& result) {
    std::string text = result.component + ": " + std::to_string(result.differences) + " of " +
                       std::to_string(result.outputs) + " differ; " + result.why;
    if (const auto& first = result.first_difference) {
      text += " activation " + std::to_string(first->activation) + " by " + first->cause + ": " +
              first->topic + " " + std::to_string(first->sequence) + " " + first->field + ": " +
              first->recorded + " / " + first->now;
    }
    return text;
  }

  static void expect_equal(const Results& results) {
    for (const auto& [name, result] : results) {
      if (name.starts_with("fastcycle")) {
        EXPECT_FALSE(result.is_executed) << name;  // Its result follows from the whole run.
        continue;
      }
      EXPECT_TRUE(result.is_executed) << in_words(result);
      EXPECT_TRUE(result.is_equal()) << in_words(result);
      EXPECT_EQ(result.activations, result.recorded) << in_words(result);
      EXPECT_EQ(result.equal, result.outputs) << in_words(result);
      EXPECT_EQ(result.not_recorded, 0) << in_words(result);
    }
  }

  config::TestFolder folder_;
  TestClasses classes_;
  const std::filesystem::path file_ = folder_.path() / "log.mcap";
};

TEST_F(ExactReplays, OfALiveRunWithAllKindsOfCallsAreEqual) {
  everything::add_classes(classes_);
  const std::string text = everything::live_application();
  // Long enough for all that happens in it; how long is another one each time in a soak.
  record(text,
         750ms + std::chrono::milliseconds(testing::UnitTest::GetInstance()->random_seed() % 300));

  for (const unsigned workers : {1U, 2U, 4U}) {
    SCOPED_TRACE(workers);
    const Results results = replay(text, {.workers = workers});
    expect_equal(results);
    EXPECT_GT(results.at("watcher").outputs, 50);
    EXPECT_GT(results.at("fusion").outputs, 20);
  }
}

TEST_F(ExactReplays, OfOneComponentAloneAreEqual) {
  everything::add_classes(classes_);
  const std::string text = everything::live_application();
  record(text, 400ms);

  for (const char* name : {"supervisor", "fusion", "scaler", "wheel", "watcher", "loader"}) {
    const Results results = replay(text, {.components = {name}});
    EXPECT_TRUE(results.at(name).is_equal()) << in_words(results.at(name));
    EXPECT_EQ(results.at(name).activations, results.at(name).recorded);
  }
}

TEST_F(ExactReplays, GoOnWithNewMessagesIfTheyAreAskedTo) {
  everything::add_classes(classes_);
  const std::string text = everything::live_application();
  record(text, 400ms);

  expect_equal(replay(text, {.workers = 2, .input = ExactReplayOptions::Input::kNew}));
}

/// A number every 2 ms.
class Numbers final : public Component {
 public:
  explicit Numbers(Context& context)
      : Component(context),
        count_(context.state<Int64Value>("count")),
        numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    count_->set_value(count_->value() + 1);
    auto number = numbers_.loan();
    number->set_value(count_->value());
    numbers_.publish(std::move(number));
  }

 private:
  State<Int64Value> count_;
  Publisher<Int64Value> numbers_;
};

/// Says how old what it receives is, in a callback and in its view.
class Ages final : public Component {
 public:
  explicit Ages(Context& context)
      : Component(context),
        latest_(context.create_latest<Int64Value>("numbers")),
        ages_(context.create_publisher<Int64Value>("ages")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Sample<Int64Value>& number) {
      say(now() - number.info().publish_time);
    });
  }

  void serve() override {
    if (latest_.get()) {
      say(*latest_.age());
    }
  }

 private:
  void say(Duration age) {
    auto message = ages_.loan();
    message->set_value(age.count());
    ages_.publish(std::move(message));
  }

  Latest<Int64Value> latest_;
  Publisher<Int64Value> ages_;
};

TEST_F(ExactReplays, KnowWhenMessagesThatAreNotInTheLogWerePublished) {
  classes_.with<Numbers>("numbers").with<Ages>("ages");
  const std::string text = R"({"name": "left_out", "components": [
      {"name": "numbers", "library": "numbers", "serve_period_ms": 2},
      {"name": "ages", "library": "ages", "serve_period_ms": 3}]})";
  record(text, 1s, {"numbers", "numbers#*"});

  const Results results = replay(text, {.workers = 2});

  EXPECT_TRUE(results.at("ages").is_equal()) << in_words(results.at("ages"));
  EXPECT_GT(results.at("ages").equal, 20);
  EXPECT_GT(results.at("numbers").not_recorded, 10);
}

/// Fails as long as its factor is 1.
class Renewed final : public Component {
 public:
  explicit Renewed(Context& context)
      : Component(context),
        factor_(context.param<std::int64_t>("factor", {.fallback = 1, .is_tunable = true})),
        factors_(context.create_publisher<Int64Value>("factors")) {}

  void serve() override {
    auto message = factors_.loan();
    message->set_value(factor_.get());
    factors_.publish(std::move(message));
    if (factor_.get() == 1) {
      throw std::runtime_error("with this factor");
    }
  }

 private:
  Param<std::int64_t> factor_;
  Publisher<Int64Value> factors_;
};

TEST_F(ExactReplays, GiveANewObjectTheParamsThatItBeganWith) {
  classes_.with<Renewed>("renewed");
  const std::string text = R"({"name": "renewing", "components": [
      {"name": "renewed", "library": "renewed", "serve_period_ms": 2, "on_fault": "restart",
       "restart": {"limit": 100, "back_off_ms": 10}}]})";
  record(text, 200ms, {}, [](Application& application) {
    // Beside restarts: some of these are made while there is no object that could take them over.
    for (int i = 0; i < 40; ++i) {
      std::this_thread::sleep_for(4ms);
      const std::string factor = std::to_string(i % 3 == 2 ? 2 : 1);
      EXPECT_TRUE(
          application.change_params({{.param = "renewed.factor", .json = factor}}).has_changed());
    }
  });

  const Results results = replay(text);

  EXPECT_TRUE(results.at("renewed").is_equal()) << in_words(results.at("renewed"));
  EXPECT_EQ(results.at("renewed").activations, results.at("renewed").recorded);
}

/// Runs into each limit that depends on others, and reports which limit it was.
class Limited final : public Component {
 public:
  explicit Limited(Context& context)
      : Component(context),
        results_(context.create_publisher<StringValue>("results")),
        kept_(context.create_publisher<Int64Value>("kept")),
        source_(context.create_source()) {}

  void serve() override {
    if (++turn_ > kTurns) {
      source_.finish();
      return;
    }
    const int observed = observe("first try", [] { return 7; });
    publish(std::to_string(observed) + " " + what_throws([this] {
              static_cast<void>(observe("device", []() -> int {
                throw std::system_error(ENODEV, std::generic_category(),
                                        std::to_string(next_line()));
              }));
            }));
    std::size_t jobs = 0;
    publish(what_throws([this, &jobs] {
      for (;; ++jobs) {
        context().offload("slow", [] { std::this_thread::sleep_for(1ms); }, [] {});
      }
    }));
    publish(std::to_string(jobs) + " jobs");
    std::vector<Loan<Int64Value>> loans;
    publish(what_throws([this, &loans] {
      for (;;) {
        loans.push_back(kept_.loan());
      }
    }));
    publish(std::to_string(loans.size()) + " loans");
  }

 private:
  /// Something that another run does not know.
  static int next_line() {
    static int lines = 0;
    return ++lines;
  }
  static std::string what_throws(const std::function<void()>& call) {
    try {
      call();
    } catch (const std::exception& exception) {
      return exception.what();
    }
    return "nothing";
  }
  void publish(const std::string& what) {
    auto message = results_.loan();
    message->set_value(what);
    results_.publish(std::move(message));
  }

  static constexpr int kTurns = 3;

  Publisher<StringValue> results_;
  Publisher<Int64Value> kept_;
  Source source_;
  int turn_ = 0;
};

TEST_F(ExactReplays, RefuseWhatLimitsRefused) {
  classes_.with<Limited>("limited");
  const std::string text = R"({"name": "limits",
      "executors": [{"name": "main"}, {"name": "slow"}],
      "components": [
        {"name": "limited", "library": "limited", "executor": "main", "serve_period_ms": 2}]})";
  record(text, 1min);  // It ends before.

  const Results results = replay(text);

  EXPECT_TRUE(results.at("limited").is_equal()) << in_words(results.at("limited"));
  EXPECT_EQ(results.at("limited").equal, 15);
  EXPECT_EQ(results.at("limited").activations, results.at("limited").recorded);
}

/// A client whose thread throws while it owes an answer: the text reaches who asked.
class Fragile final : public Component {
 public:
  explicit Fragile(Context& context) : Component(context) {
    context.create_service<Int64Value, Int64Value>(
        "ask", [this](const Int64Value&, Responder<Int64Value> responder) {
          owed_.push_back(std::move(responder));
          was_asked_.store(true);
        });
    context.create_thread("device", [this](const std::stop_token& stop) {
      while (!was_asked_.load() && !stop.stop_requested()) {
        std::this_thread::sleep_for(1ms);
      }
      if (was_asked_.load()) {
        throw std::runtime_error("the device is gone");
      }
    });
  }

 private:
  std::vector<Responder<Int64Value>> owed_;
  std::atomic<bool> was_asked_{false};
};

/// Asks once, and publishes the reply.
class Asks final : public Component {
 public:
  explicit Asks(Context& context)
      : Component(context),
        results_(context.create_publisher<StringValue>("results")),
        client_(context.create_client<Int64Value, Int64Value>("ask")) {}

  void serve() override {
    if (!std::exchange(has_asked_, true)) {
      client_.call(client_.loan(), [this](const Reply<Int64Value>& reply) {
        auto message = results_.loan();
        message->set_value(std::string(reply.error()));
        results_.publish(std::move(message));
      });
    }
  }

 private:
  Publisher<StringValue> results_;
  Client<Int64Value, Int64Value> client_;
  bool has_asked_ = false;
};

TEST_F(ExactReplays, KnowWhatAThreadThrew) {
  classes_.with<Fragile>("fragile").with<Asks>("asks");
  const std::string text = R"({"name": "threads", "components": [
      {"name": "fragile", "library": "fragile", "on_fault": "continue"},
      {"name": "asks", "library": "asks", "serve_period_ms": 2}]})";
  record(text, 200ms);

  const Results results = replay(text);

  EXPECT_TRUE(results.at("asks").is_equal()) << in_words(results.at("asks"));
  EXPECT_TRUE(results.at("fragile").is_equal()) << in_words(results.at("fragile"));
  EXPECT_GT(results.at("fragile").outputs, 0);
}

// ---- From the middle ----

/// Adds up what it receives, and the last numbers that its view has; saves it when it is asked.
class Sums final : public Component {
 public:
  explicit Sums(Context& context)
      : Component(context),
        factor_(context.param<std::int64_t>("factor", {.fallback = 1, .is_tunable = true})),
        last_(context.create_history<Int64Value>("numbers", {.depth = 5})),
        sums_(context.create_publisher<Int64Value>("sums")),
        state_(context.state<Int64Value>("sum", [this](Int64Value& sum) { sum.set_value(sum_); })),
        sum_(state_->value()) {
    context.on_change(factor_, [this](std::int64_t factor) { changed_ = factor; });
    context.create_subscriber<Int64Value>(
        "numbers", [this](const Int64Value& number) { add(number.value()); });
  }

 private:
  void add(std::int64_t number) {
    sum_ += number;
    std::int64_t last = 0;
    for (std::size_t i = 0; i < last_.size(); ++i) {
      last = last * 31 + last_[i]->value();
    }
    auto sum = sums_.loan();
    sum->set_value(sum_ * factor_.get() + last + changed_);
    sums_.publish(std::move(sum));
    if (number == 20) {
      context().change_params({{.param = "sums.factor", .json = "3"}});
    }
  }

  Param<std::int64_t> factor_;
  History<Int64Value> last_;
  Publisher<Int64Value> sums_;
  State<Int64Value> state_;
  std::int64_t sum_;
  std::int64_t changed_ = 0;  ///< Follows from params.
};

/// Adds up, and says nothing of it.
class Silent final : public Component {
 public:
  explicit Silent(Context& context)
      : Component(context), secrets_(context.create_publisher<Int64Value>("secrets")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      sum_ += number.value();
      auto sum = secrets_.loan();
      sum->set_value(sum_);
      secrets_.publish(std::move(sum));
    });
  }

 private:
  Publisher<Int64Value> secrets_;
  std::int64_t sum_ = 0;
};

/// Declares less than it remembers.
class Forgetful final : public Component {
 public:
  explicit Forgetful(Context& context)
      : Component(context),
        state_(context.state<Int64Value>("nothing")),
        all_(context.create_publisher<Int64Value>("all")) {
    context.create_subscriber<Int64Value>("numbers", [this](const Int64Value& number) {
      sum_ += number.value();
      auto sum = all_.loan();
      sum->set_value(sum_);
      all_.publish(std::move(sum));
    });
  }

 private:
  State<Int64Value> state_;
  Publisher<Int64Value> all_;
  std::int64_t sum_ = 0;
};

constexpr const char* kKeeping = R"({"name": "keeping", "state_period_s": 0.02, "components": [
  {"name": "numbers", "library": "numbers", "serve_period_ms": 2},
  {"name": "sums", "library": "sums", "subscribers": {"numbers": {"depth": 256}}},
  {"name": "silent", "library": "silent", "subscribers": {"numbers": {"depth": 256}}},
  {"name": "forgetful", "library": "forgetful", "subscribers": {"numbers": {"depth": 256}}}]})";

class FromTheMiddle : public ExactReplays {
 protected:
  FromTheMiddle() {
    classes_.with<Numbers>("numbers").with<Sums>("sums").with<Silent>("silent").with<Forgetful>(
        "forgetful");
  }
};

TEST_F(FromTheMiddle, AComponentBeginsWithTheLastKeyFrameBefore) {
  record(kKeeping, 300ms);

  for (const auto input : {ExactReplayOptions::Input::kRecorded, ExactReplayOptions::Input::kNew}) {
    const Results results = replay(kKeeping, {.input = input, .start = 200ms});

    for (const char* name : {"numbers", "sums"}) {
      const ExactReplayResult& result = results.at(name);
      EXPECT_TRUE(result.is_equal()) << in_words(result);
      EXPECT_GT(result.began_after, 0) << in_words(result);
      EXPECT_LE(result.began_ns, 200'000'000) << in_words(result);
      EXPECT_GT(result.began_ns, 100'000'000) << in_words(result);
      EXPECT_EQ(result.activations, result.recorded - result.began_after) << in_words(result);
      EXPECT_GT(result.outputs, 20) << in_words(result);
      EXPECT_EQ(result.equal, result.outputs) << in_words(result);
    }
  }
}

TEST_F(FromTheMiddle, AComponentWithoutStateBeginsWithTheLog) {
  record(kKeeping, 200ms);

  const ExactReplayResult result = replay(kKeeping, {.start = 150ms}).at("silent");

  EXPECT_EQ(result.began_after, 0);
  EXPECT_TRUE(result.is_equal()) << in_words(result);
  EXPECT_EQ(result.activations, result.recorded);
}

TEST_F(FromTheMiddle, AComponentThatDeclaresTooLittleIsFound) {
  record(kKeeping, 200ms);

  const ExactReplayResult result = replay(kKeeping, {.start = 150ms}).at("forgetful");

  EXPECT_GT(result.began_after, 0);
  ASSERT_TRUE(result.first_difference) << in_words(result);
  EXPECT_EQ(result.first_difference->topic, "all");
}

TEST_F(FromTheMiddle, KeyFramesAreComparedToo) {
  record(kKeeping, 200ms);

  // The frames are outputs as others are: there are ten of them.
  const ExactReplayResult result = replay(kKeeping).at("numbers");

  EXPECT_TRUE(result.is_equal()) << in_words(result);
  EXPECT_GT(result.outputs, result.activations);
}

// ---- What does not repeat ----

std::int64_t system_clock_ns() {
  return std::chrono::system_clock::now().time_since_epoch().count();
}
std::int64_t chance() {
  return std::rand();  // NOLINT
}
std::atomic<std::int64_t> of_a_thread{0};

/// Counts up to 5, and then publishes what `ask` says.
template <auto ask>
class Asking final : public Component {
 public:
  explicit Asking(Context& its_context)
      : Component(its_context), out_(its_context.create_publisher<Int64Value>("out")) {}

  void serve() override {
    auto out = out_.loan();
    out->set_value(++calls_ < 6 ? calls_ : ask());
    out_.publish(std::move(out));
  }

 private:
  Publisher<Int64Value> out_;
  std::int64_t calls_ = 0;
};

std::int64_t count_of_all() {
  return of_a_thread.fetch_add(1);
}

constexpr const char* kAsking = R"({"name": "asks",
    "components": [{"name": "asking", "library": "asking", "serve_period_ms": 2}]})";

class WhatDoesNotRepeat : public ExactReplays {
 protected:
  template <auto ask>
  void expect_found() {
    classes_.with<Asking<ask>>("asking");
    record(kAsking, 100ms);
    const ExactReplayResult result = replay(kAsking).at("asking");
    ASSERT_TRUE(result.first_difference) << in_words(result);
    EXPECT_EQ(result.first_difference->sequence, 6) << in_words(result);
    EXPECT_EQ(result.first_difference->field, "value");
    EXPECT_EQ(result.first_difference->topic, "out");
    EXPECT_EQ(result.first_difference->cause, "its serve()");
    EXPECT_NE(result.first_difference->recorded, result.first_difference->now);
    EXPECT_EQ(result.outputs - result.equal, result.outputs - 5) << in_words(result);
  }
};

TEST_F(WhatDoesNotRepeat, TheSystemsClockIsFound) {
  expect_found<&system_clock_ns>();
}

TEST_F(WhatDoesNotRepeat, ChanceIsFound) {
  expect_found<&chance>();
}

TEST_F(WhatDoesNotRepeat, StateOfAllObjectsIsFound) {
  expect_found<&count_of_all>();
}

TEST_F(ExactReplays, ReportWhatIsNotThereToBeExecuted) {
  classes_.with<Asking<&chance>>("asking");
  record(kAsking, 50ms);

  config::Problems problems;
  const auto schedule = record::RecordedSchedule::read({file_});
  auto driver = std::make_unique<RecordedDriver>();
  RecordedDriver& recorded = *driver;
  Application application(std::move(driver), describe_text(kAsking, problems));
  application.build(classes_, problems, ConstructorFault::kFault);
  const ExactReplay replay(application, recorded, schedule,
                           {.files = {file_}, .components = {"askin"}}, problems);

  ASSERT_TRUE(problems.has_errors());
  EXPECT_THAT(config::to_string(problems.all().back()), HasSubstr("did you mean \"asking\""));
}

TEST_F(ExactReplays, RefuseFilesOfTwoRuns) {
  classes_.with<Asking<&chance>>("asking");
  record(kAsking, 50ms);
  const std::filesystem::path second = file_.parent_path() / "second.mcap";
  std::filesystem::copy_file(file_, second);

  try {
    record::RecordedSchedule::read({file_, second});
    FAIL() << "they were read as one";
  } catch (const mcap::Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("expected files of one run, found the end of a second run"));
  }
}

}  // namespace
}  // namespace fastcycle::host
