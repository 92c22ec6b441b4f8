// What activations learn, beside their causes, is in the log of a run.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "log/log.pb.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "record/log_format.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using testing::ElementsAre;
using namespace std::chrono_literals;

/// Publishes 1, 2, 3, … on "numbers", three in each tick, as far as there are credits for "paid".
class Counting final : public Component {
 public:
  explicit Counting(Context& its_context)
      : Component(its_context),
        numbers_(its_context.create_publisher<Int64Value>("numbers")),
        paid_(its_context.create_publisher<Int64Value>("paid", {.credits = 4})) {}

  void serve() override {
    for (int i = 0; i < 3; ++i) {
      send(numbers_);
    }
    if (paid_.credits() > 0 && paid_.credits() > 1) {
      send(paid_);
    }
  }

 private:
  void send(Publisher<Int64Value>& publisher) {
    auto number = publisher.loan();
    number->set_value(++sent_);
    publisher.publish(std::move(number));
  }

  Publisher<Int64Value> numbers_;
  Publisher<Int64Value> paid_;
  std::int64_t sent_ = 0;
};

/// Looks at its views, at the mode and at who listens.
class Looking final : public Component {
 public:
  explicit Looking(Context& its_context)
      : Component(its_context),
        paid_(its_context.create_latest<Int64Value>("paid")),
        numbers_(its_context.create_history<Int64Value>("numbers", {.depth = 100})),
        out_(its_context.create_publisher<Int64Value>("out")) {
    its_context.create_subscriber<Int64Value>("paid", [](const Int64Value&) {});
    its_context.create_subscriber<Int64Value>("numbers", [](const Int64Value&) {});
  }

  void serve() override {
    if (context().mode() == "drive" && out_.subscriber_count() == 0) {
      report("seen", static_cast<std::int64_t>(numbers_.size()));
    }
  }

 private:
  Latest<Int64Value> paid_;
  History<Int64Value> numbers_;
  Publisher<Int64Value> out_;
};

/// Observes more in one activation than the recorder has room for.
class Observing final : public Component {
 public:
  using Component::Component;
  void serve() override {
    std::ignore = observe("text", [] { return std::string(100'000, 'x'); });
  }
};

class Reads : public testing::Test {
 protected:
  Reads() {
    classes_.with<Counting>("counting").with<Looking>("looking").with<Observing>("observing");
  }

  /// Runs both for `time`, and reads what the log says of the component that looks.
  void run(const ClockOptions& clock, Duration time) {
    run(clock, time, R"({"name": "looks",
        "modes": {"stand": {}, "drive": {"components": ["looking"]}}, "initial_mode": "drive",
        "components": [
          {"name": "counting", "library": "counting", "serve_period_ms": 2},
          {"name": "looking", "library": "looking", "serve_period_ms": 3}]})");
  }
  void run(const ClockOptions& clock, Duration time, const char* description) {
    const std::filesystem::path file = folder_.path() / "log.mcap";
    {
      config::Problems problems;
      const auto application =
          std::make_unique<Application>(describe_text(description, problems), clock);
      config::RecordDescription recorded;
      recorded.file = file;
      application->record(recorded);
      application->build(classes_, problems, ConstructorFault::kFault);
      ASSERT_FALSE(problems.has_errors());
      application->start();
      application->run(time);
      application->stop();
      counted_lost_ = application->recorder()->reads_lost();
      if (const auto* const numbers = application->topics().find("numbers")) {
        for (const auto& subscription : numbers->subscriptions) {
          if (subscription->kind == detail::Subscription::Kind::kHistory) {
            delivered_ = subscription->ledger().delivered;
          }
        }
      }
    }
    const mcap::FileSource source(file);
    const mcap::Reader reader(source);
    mcap::MessageReader messages = reader.messages();
    while (const std::optional<mcap::StoredMessage> message = messages.next()) {
      if (message->channel->topic != record::kActivationsTopic) {
        continue;
      }
      log::Activations activations;
      ASSERT_TRUE(
          activations.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
      for (const log::Activation& activation : activations.activations()) {
        lost_ += activation.reads_lost();
        (activation.component() == 0 ? counting_ : looking_)[activation.number()] = activation;
      }
    }
  }

  config::TestFolder folder_;
  TestClasses classes_;
  std::map<std::uint64_t, log::Activation> counting_;  ///< By number.
  std::map<std::uint64_t, log::Activation> looking_;
  std::uint64_t delivered_ = 0;  ///< To the view of "numbers".
  std::uint64_t lost_ = 0;
  std::uint64_t counted_lost_ = 0;  ///< By the recorder.
};

TEST_F(Reads, SayWhichMessagesAViewTookOverInWhichActivation) {
  run({.is_simulated = true, .workers = 2}, 100ms);

  std::vector<std::uint64_t> taken;
  std::uint64_t first = 0;
  for (const auto& [number, activation] : looking_) {
    for (const log::Read& read : activation.reads()) {
      if (read.kind() == log::READ_KIND_TAKEN && read.place() == 1) {
        taken.push_back(read.value());
        EXPECT_EQ(read.publisher(), detail::publisher_id("counting", "numbers"));
        first = first == 0 ? number : first;
      }
    }
  }
  EXPECT_EQ(lost_, 0U);
  EXPECT_EQ(taken.size(), delivered_);
  for (std::size_t i = 0; i < taken.size(); ++i) {
    EXPECT_EQ(taken[i], i + 1);
  }
  // The three messages of the first tick were there when it was called with the first of them.
  const log::Activation& activation = looking_[first];
  EXPECT_EQ(activation.cause(), log::CAUSE_MESSAGE);
  EXPECT_EQ(activation.reads_size(), 4);  // And the one of "paid".
}

TEST_F(Reads, SayWhichSubscriptionWasGivenTheMessage) {
  run({.is_simulated = true, .workers = 1}, 20ms);

  bool has_paid = false;
  for (const auto& [number, activation] : looking_) {
    if (activation.cause() != log::CAUSE_MESSAGE) {
      EXPECT_FALSE(activation.has_subscription());
      continue;
    }
    const bool is_paid = activation.publisher() == detail::publisher_id("counting", "paid");
    EXPECT_EQ(activation.subscription(), is_paid ? 0U : 1U);
    has_paid = has_paid || is_paid;
  }
  EXPECT_TRUE(has_paid);
}

TEST_F(Reads, SayWhatAnswersWereGiven) {
  run({.is_simulated = true, .workers = 1}, 10ms);

  for (const auto& [number, activation] : counting_) {
    if (activation.cause() == log::CAUSE_TICK) {
      ASSERT_EQ(activation.reads_size(), 1) << "the second answer follows from the first one";
      EXPECT_EQ(activation.reads(0).kind(), log::READ_KIND_CREDITS);
      EXPECT_EQ(activation.reads(0).publisher(), detail::publisher_id("counting", "paid"));
      EXPECT_EQ(activation.reads(0).value(), 4U);
    }
  }
  int ticks = 0;
  for (const auto& [number, activation] : looking_) {
    if (activation.cause() == log::CAUSE_TICK) {
      ++ticks;
      std::vector<log::ReadKind> kinds;
      for (const log::Read& read : activation.reads()) {
        kinds.push_back(read.kind());
        EXPECT_EQ(read.value(), read.kind() == log::READ_KIND_MODE ? 1U : 0U);
      }
      EXPECT_THAT(kinds, ElementsAre(log::READ_KIND_MODE, log::READ_KIND_SUBSCRIBERS));
    }
  }
  EXPECT_GT(ticks, 2);
}

TEST_F(Reads, ThatAreTooManyAreCounted) {
  run({.is_simulated = true, .workers = 1}, 20ms,
      R"({"name": "observes", "components": [
        {"name": "observing", "library": "observing", "serve_period_ms": 5}]})");

  EXPECT_GT(lost_, 0U);
  EXPECT_EQ(counted_lost_, lost_);
}

TEST_F(Reads, AreAllThereAfterALiveRun) {
  run({}, 300ms);

  std::vector<std::uint64_t> taken;
  for (const auto& [number, activation] : looking_) {
    for (const log::Read& read : activation.reads()) {
      if (read.kind() == log::READ_KIND_TAKEN && read.place() == 1) {
        taken.push_back(read.value());
      }
    }
  }
  EXPECT_EQ(lost_, 0U);
  EXPECT_EQ(taken.size(), delivered_);
  EXPECT_TRUE(std::ranges::is_sorted(taken));
}

}  // namespace
}  // namespace fastcycle::host
