#include "host/observer.h"

#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using namespace std::chrono_literals;
using google::protobuf::Int64Value;

/// Publishes three messages each millisecond.
class Burst final : public Component {
 public:
  explicit Burst(Context& context)
      : Component(context), publisher_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    for (int i = 0; i < 3; ++i) {
      auto number = publisher_.loan();
      number->set_value(++count_);
      publisher_.publish(std::move(number));
    }
  }

 private:
  Publisher<Int64Value> publisher_;
  std::int64_t count_ = 0;
};

/// Has a queue for two, and fails at the fifth message.
class Reader final : public Component {
 public:
  explicit Reader(Context& context) : Component(context) {
    context.create_subscriber<Int64Value>("numbers", {.depth = 2}, [this](const Int64Value&) {
      if (++count_ == 5) {
        throw std::runtime_error("five");
      }
    });
  }

 private:
  int count_ = 0;
};

/// Records its notifications.
class Notes final : public Observer {
 public:
  explicit Notes(std::string name, std::vector<std::string>& notes, bool wants = true)
      : name_(std::move(name)), notes_(&notes), wants_(wants) {}

  void tap(detail::Topics& topics) override {
    note("tap " + std::to_string(topics.all().size()) + " topic");
  }
  void open(config::Problems&) override { note("open"); }
  void start(const ObserverView& view, std::vector<base::Refusal>& refusals) override {
    rings_ = view.rings;
    refusals.push_back({.what = "an observer's wish", .remedy = "none"});
    note("start of " + view.application.description().name);
  }
  void round_ended(std::uint32_t) override { ++rounds; }
  void faulted(std::string_view component, std::string_view what) noexcept override {
    note("fault of " + std::string(component) + ": " + std::string(what));
  }
  [[nodiscard]] bool wants_overflows() const override { return wants_; }
  void overflowed(const detail::Subscription& subscription) noexcept override {
    overflows.push_back(subscription.topic.name + " of " + subscription.component);
  }
  void stop(const Application& application) override {
    for (const detail::ActivationRing* ring : rings_) {
      activations += ring->size();
    }
    note(std::string("stop: ") + to_word(application.end_reason()));
  }

  std::uint64_t rounds = 0;
  std::uint64_t activations = 0;
  std::vector<std::string> overflows;

 private:
  void note(const std::string& what) { notes_->push_back(name_ + ": " + what); }

  std::string name_;
  std::vector<std::string>* notes_;
  bool wants_;
  std::vector<const detail::ActivationRing*> rings_;
};

constexpr const char* kApplication = R"({"name": "observers", "components": [
  {"name": "burst", "library": "burst", "serve_period_ms": 1},
  {"name": "reader", "library": "reader"}]})";

TEST(AnObserver, IsNotifiedOfStartFaultOverflowsActivationsAndStop) {
  std::vector<std::string> notes;
  Notes observer("a", notes);
  TestClasses classes;
  classes.with<Burst>("burst").with<Reader>("reader");
  config::Problems problems;
  Application application(describe_text(kApplication, problems), {.is_simulated = true});
  application.add(observer);
  application.build(classes, problems, ConstructorFault::kFault);
  ASSERT_FALSE(problems.has_errors());

  const auto refusals = application.start();
  application.run(4ms);
  application.stop();

  EXPECT_THAT(notes,
              testing::ElementsAre("a: tap 1 topic", "a: open", "a: start of observers",
                                   "a: fault of reader: its callback for \"numbers\" threw: five",
                                   "a: stop: time over"));
  ASSERT_EQ(refusals.size(), 1U);
  EXPECT_EQ(refusals.front().what, "an observer's wish");
  // Each of the first three bursts is one message too long; after the fault nobody waits.
  const auto dropped = ledger_of(application, "numbers", "reader")
                           .dropped[static_cast<std::size_t>(detail::DropReason::kOverflow)];
  EXPECT_EQ(observer.overflows.size(), dropped);
  EXPECT_THAT(observer.overflows, testing::SizeIs(3));
  EXPECT_THAT(observer.overflows, testing::Each(std::string("numbers of reader")));
  EXPECT_GE(observer.rounds, 8U);
  // The life cycle of two components, four ticks and five messages at least.
  EXPECT_GE(observer.activations, 9U);
}

TEST(Observers, AreCalledInTheirOrderAndNotOfOverflowsThatTheyDoNotWant) {
  std::vector<std::string> notes;
  Notes first("first", notes);
  Notes second("second", notes, false);
  TestClasses classes;
  classes.with<Burst>("burst").with<Reader>("reader");
  config::Problems problems;
  Application application(describe_text(kApplication, problems), {.is_simulated = true});
  application.add(first);
  application.add(second);
  application.build(classes, problems, ConstructorFault::kFault);
  ASSERT_FALSE(problems.has_errors());

  application.start();
  application.run(1ms);
  application.stop();

  EXPECT_THAT(notes, testing::ElementsAre("first: tap 1 topic", "second: tap 1 topic",
                                          "first: open", "second: open",
                                          "first: start of observers", "second: start of observers",
                                          "first: stop: time over", "second: stop: time over"));
  EXPECT_THAT(first.overflows, testing::SizeIs(1));
  EXPECT_THAT(second.overflows, testing::IsEmpty());
}

/// Says in its `open` that it cannot work.
class Broken final : public Observer {
 public:
  void open(config::Problems& problems) override {
    problems.add(config::make_error({}, "no room for the observer"));
  }
};

TEST(AnObserver, ThatCannotOpenKeepsTheApplicationFromStarting) {
  Broken observer;
  TestClasses classes;
  classes.with<Burst>("burst").with<Reader>("reader");
  config::Problems problems;
  Application application(describe_text(kApplication, problems), {.is_simulated = true});
  application.add(observer);

  application.build(classes, problems, ConstructorFault::kFault);

  EXPECT_TRUE(problems.has_errors());
  EXPECT_FALSE(application.is_built());
}

}  // namespace
}  // namespace fastcycle::host
