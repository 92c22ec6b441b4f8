#include "standby/followed_component.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "broker/followed_outputs.h"
#include "broker/publisher_core.h"
#include "component/component_core.h"
#include "component/component_state.h"
#include "component/declared_states.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::standby {
namespace {

using detail::Cause;
using detail::LifeStep;
using detail::ReadKind;
using google::protobuf::Int64Value;

/// A component with state; a test may do something in its start.
class Counter final : public Component {
 public:
  explicit Counter(Context& context) : Component(context), ticks_(context.state<Int64Value>("n")) {}
  void start() override {
    ++started;
    in_start();
  }
  void serve() override { ticks_->set_value(ticks_->value() + 1); }

  static inline int started = 0;
  static inline std::function<void()> in_start;

 private:
  State<Int64Value> ticks_;
};

/// Publishes numbers when the test does.
class Source final : public Component {
 public:
  explicit Source(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}

 private:
  Publisher<Int64Value> numbers_;
};

/// Has room for two numbers.
class Receiver final : public Component {
 public:
  explicit Receiver(Context& context) : Component(context), last_(context.state<Int64Value>("n")) {
    context.create_subscriber<Int64Value>("numbers", {.depth = 2}, [this](const Int64Value& n) {
      last_->set_value(n.value());
      received.push_back(n.value());
    });
  }

  static inline std::vector<std::int64_t> received;

 private:
  State<Int64Value> last_;
};

class NoComparer final : public detail::OutputComparer {
 public:
  void compare(const detail::PublisherCore&, const detail::Envelope&,
               const detail::Envelope&) noexcept override {}
  void unmatched(const detail::PublisherCore&, bool) noexcept override {}
  void not_compared(const detail::PublisherCore&) noexcept override {}
};

constexpr std::int64_t kTheirBeginNs = 1'000'000'000;  // Of the timers there,
constexpr std::int64_t kOwnBeginNs = 3'000'000'000;    // and here.

/// A component that follows another one from a key frame on. The test serves it, in the place of a
/// worker, and asks it for the steps of a start, in the place of the control thread.
class ALateFollower : public testing::Test {
 protected:
  explicit ALateFollower(
      const std::string& component =
          R"({"name": "counter", "library": "counter", "serve_period_ms": 10})") {
    Counter::started = 0;
    Counter::in_start = [] {};
    Receiver::received.clear();
    classes_.with<Counter>("counter").with<Receiver>("receiver").with<Source>("source");
    application_ = host::make_application(R"({"name": "t", "components": [)" + component +
                                              R"(, {"name": "source", "library": "source"}]})",
                                          classes_);
    core_ = application_->components().front().get();
    script_ = std::make_unique<FollowedComponent>(
        *core_, comparer_,
        FollowedComponent::Listener{.found_frame = [this] { ++found_; },
                                    .lost = [this](const std::string& why) { lost_ = why; },
                                    .taken_over = [] {}},
        application_.get());
  }

  void TearDown() override { EXPECT_EQ(lost_, ""); }

  void ask(LifeStep step, std::function<void()> body) {
    ++asked_;
    core_->post_and_notify(
        Cause::kMode, std::move(body), [this] { ++answered_; }, detail::to_key(step));
  }
  void ask_to_start() {
    ask(LifeStep::kStart, [this] { core_->call_start(); });
  }
  void ask_to_begin_timers() {
    ask(LifeStep::kBeginTimers, [this] { core_->begin_timers(base::from_ns(kOwnBeginNs)); });
  }
  void ask_to_activate() {
    ask(LifeStep::kActivate, [this] { core_->call_activate(); });
  }
  void ask_to_deactivate() {
    ask(LifeStep::kDeactivate, [this] { core_->call_deactivate(); });
  }
  void begin() {
    ask_to_start();
    ask_to_begin_timers();
    add_key_frame(kTheirBeginNs);
    serve();
  }

  /// The other one has executed an activation, in which it learned `reads`.
  void add(LifeStep step, std::vector<detail::Read> reads) {
    FollowedActivation activation{.record = {.component = core_->index,
                                             .cause = Cause::kMode,
                                             .number = ++last_,
                                             .key = detail::to_key(step),
                                             .time_ns = kTheirBeginNs}};
    for (detail::Read& read : reads) {
      read.activation = last_;
      activation.reads.push_back({.read = read});
    }
    script_->add(std::move(activation));
  }
  void add_key_frame(std::int64_t timers_began_ns) {
    add(LifeStep::kStart, {{.kind = ReadKind::kFrameNumber,
                            .place = detail::DeclaredStates::kTimersBegan,
                            .value = static_cast<std::uint64_t>(timers_began_ns)}});
  }

  void serve() {
    while (script_->serve(ring_)) {
    }
  }

  host::TestClasses classes_;
  NoComparer comparer_;
  detail::ActivationRing ring_;
  std::unique_ptr<host::Application> application_;
  detail::ComponentCore* core_ = nullptr;
  std::unique_ptr<FollowedComponent> script_;
  std::uint64_t last_ = 0;
  int asked_ = 0;
  int answered_ = 0;
  int found_ = 0;
  std::string lost_;  ///< Why it follows no longer.
};

TEST_F(ALateFollower, BeginsAtAKeyFrameOnceItsProcessHasStarted) {
  add_key_frame(kTheirBeginNs);
  serve();
  EXPECT_EQ(found_, 0);
  ask_to_start();
  serve();
  EXPECT_EQ(found_, 0);
  ask_to_begin_timers();
  serve();

  EXPECT_EQ(found_, 1);
  EXPECT_EQ(answered_, asked_);
  EXPECT_EQ(Counter::started, 1) << "the object that has the state of the key frame";
  EXPECT_EQ(core_->timers_began, base::from_ns(kTheirBeginNs));
}

TEST_F(ALateFollower, AnswersTheCallOfItsStartThatComesWhileItBegins) {
  Counter::in_start = [this] {
    if (asked_ == 0) {
      ask_to_start();
    }
  };
  add_key_frame(kTheirBeginNs);
  serve();  // If it begins now, it is asked meanwhile.
  if (asked_ == 0) {
    ask_to_start();
  }
  serve();

  EXPECT_EQ(answered_, asked_) << "whoever starts the process waits for ever";
}

TEST_F(ALateFollower, BeginsTheTimersOfAProcessThatItFollowsFromItsStartOn) {
  ask_to_start();
  ask_to_begin_timers();
  add_key_frame(0);
  add(LifeStep::kBeginTimers, {{.kind = ReadKind::kBegan, .value = kTheirBeginNs}});
  serve();

  EXPECT_EQ(found_, 1);
  EXPECT_EQ(script_->executed(), 2U);
  EXPECT_EQ(core_->timers_began, base::from_ns(kTheirBeginNs));
}

TEST_F(ALateFollower, AnswersASwitchOfModesThatItsKeyFrameHasSeen) {
  begin();
  ask_to_activate();
  serve();

  EXPECT_EQ(answered_, asked_) << "the switch waits for ever";
  EXPECT_EQ(core_->state, detail::ComponentState::kActive);
}

TEST_F(ALateFollower, ChangesModesWhenTheOneDoesThatItFollows) {
  begin();
  ask_to_deactivate();
  serve();
  EXPECT_EQ(core_->state, detail::ComponentState::kActive);
  add(LifeStep::kDeactivate, {});
  serve();

  EXPECT_EQ(answered_, asked_);
  EXPECT_EQ(core_->state, detail::ComponentState::kStandby);
}

TEST_F(ALateFollower, ChangesModesAlsoWhereItWasAskedBeforeItsKeyFrame) {
  ask_to_deactivate();
  begin();
  add(LifeStep::kDeactivate, {});
  serve();
  EXPECT_EQ(script_->executed(), 2U);
  EXPECT_EQ(core_->state, detail::ComponentState::kStandby);

  add(LifeStep::kActivate, {});
  serve();
  ask_to_activate();  // It is notified of this switch last.
  serve();

  EXPECT_EQ(answered_, asked_);
  EXPECT_EQ(script_->executed(), 3U);
  EXPECT_EQ(core_->state, detail::ComponentState::kActive);
}

class ALateFollowerOfMessages : public ALateFollower {
 protected:
  explicit ALateFollowerOfMessages(
      const std::string& receiver = R"({"name": "receiver", "library": "receiver"})")
      : ALateFollower(receiver) {
    source_ = application_->components().back()->declared.publishers.front();
  }

  /// One whose activation began there at a time.
  void add_key_frame_of(std::int64_t begin_ns) {
    script_->add({.record = {.component = core_->index,
                             .cause = Cause::kMode,
                             .number = ++last_,
                             .key = detail::to_key(LifeStep::kStart),
                             .time_ns = kTheirBeginNs,
                             .begin_ns = begin_ns},
                  .reads = {{.read = {.activation = last_,
                                      .kind = ReadKind::kFrameNumber,
                                      .place = detail::DeclaredStates::kTimersBegan,
                                      .value = static_cast<std::uint64_t>(kTheirBeginNs)}}}});
  }

  void publish(int count) {
    for (int i = 0; i < count; ++i) {
      source_->owner.enter();
      detail::Envelope* loan = source_->loan(true);
      static_cast<Int64Value&>(*loan->own).set_value(++published_);
      source_->publish(loan, {});
    }
  }

  /// The other one has executed an activation with this message.
  void add_message(std::uint64_t sequence) {
    script_->add({.record = {.component = core_->index,
                             .cause = Cause::kMessage,
                             .subscription = 0,
                             .number = ++last_,
                             .publisher = source_->id,
                             .key = sequence,
                             .time_ns = kTheirBeginNs}});
  }

  detail::PublisherCore* source_ = nullptr;
  std::int64_t published_ = 0;
};

TEST_F(ALateFollowerOfMessages, BeginsAtAKeyFrameAfterWhichItHasAllMessages) {
  publish(4);  // The first two have been displaced.
  add_key_frame(kTheirBeginNs);
  add_message(1);
  add_message(2);
  add_key_frame(kTheirBeginNs);
  add_message(3);
  add_message(4);
  ask_to_start();
  ask_to_begin_timers();
  serve();

  EXPECT_EQ(found_, 1);
  EXPECT_EQ(script_->executed(), last_);
  EXPECT_EQ(Receiver::received, (std::vector<std::int64_t>{3, 4}));
}

TEST_F(ALateFollowerOfMessages, WaitsForAMessageThatHasNotArrivedHere) {
  add_key_frame(kTheirBeginNs);
  add_message(1);
  ask_to_start();
  ask_to_begin_timers();
  serve();
  EXPECT_EQ(found_, 0);

  publish(1);
  serve();
  EXPECT_EQ(found_, 1);
  EXPECT_EQ(Receiver::received, (std::vector<std::int64_t>{1}));
}

TEST_F(ALateFollowerOfMessages, NamesTheQueueThatHadTooFewPlacesForItsInput) {
  begin();
  publish(4);
  add_message(1);
  serve();
  EXPECT_EQ(std::exchange(lost_, {}),
            "a message of \"numbers\" that activation 2 of \"receiver\" was given never came "
            "(dropped on the way to the standby so far: 2); a larger \"depth\" than 2 has room for "
            "more");
}

TEST_F(ALateFollowerOfMessages, BeginsAtALaterKeyFrameIfAMessageOfAnEarlierOneDoesNotArrive) {
  add_key_frame(kTheirBeginNs);
  add_message(1);
  add_key_frame(kTheirBeginNs);
  ask_to_start();
  ask_to_begin_timers();
  serve();

  EXPECT_EQ(found_, 1);
  EXPECT_EQ(script_->executed(), last_);
}

/// Its lane drops the newest messages.
class ALateFollowerThatKeepsTheOldest : public ALateFollowerOfMessages {
 protected:
  ALateFollowerThatKeepsTheOldest()
      : ALateFollowerOfMessages(R"({"name": "receiver", "library": "receiver",
          "subscribers": {"numbers": {"overflow": "drop_newest"}}})") {}
};

TEST_F(ALateFollowerThatKeepsTheOldest, BeginsAfterTheGapThatItsStartHasLeft) {
  publish(3);  // The third one is dropped, the first two wait.
  add_key_frame_of(base::monotonic_ns());
  add_message(1);
  add_message(2);
  add_message(3);
  ask_to_start();
  ask_to_begin_timers();
  serve();
  EXPECT_EQ(found_, 0);

  publish(2);  // There is room again.
  add_key_frame_of(base::monotonic_ns());
  add_message(4);
  add_message(5);
  serve();

  EXPECT_EQ(found_, 1);
  EXPECT_EQ(script_->executed(), last_);
  EXPECT_EQ(Receiver::received, (std::vector<std::int64_t>{4, 5}));
}

}  // namespace
}  // namespace fastcycle::standby
