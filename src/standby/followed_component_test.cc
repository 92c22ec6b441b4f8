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

class NoComparer final : public detail::OutputComparer {
 public:
  void compare(const detail::PublisherCore&, const detail::Envelope&,
               const detail::Envelope&) noexcept override {}
  void unmatched(const detail::PublisherCore&, bool) noexcept override {}
};

constexpr std::int64_t kTheirBeginNs = 1'000'000'000;  // Of the timers there,
constexpr std::int64_t kOwnBeginNs = 3'000'000'000;    // and here.

/// A component that follows another one from a key frame on. The test serves it, in the place of a
/// worker, and asks it for the steps of a start, in the place of the control thread.
class ALateFollower : public testing::Test {
 protected:
  ALateFollower() {
    Counter::started = 0;
    Counter::in_start = [] {};
    classes_.with<Counter>("counter");
    application_ = host::make_application(R"({"name": "t", "components": [
        {"name": "counter", "library": "counter", "serve_period_ms": 10}]})",
                                          classes_);
    core_ = application_->components().front().get();
    script_ = std::make_unique<FollowedComponent>(
        *core_, comparer_,
        FollowedComponent::Listener{.found_frame = [this] { ++found_; },
                                    .lost = [](const std::string& why) { FAIL() << why; },
                                    .taken_over = [] {}},
        application_.get());
  }

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

}  // namespace
}  // namespace fastcycle::standby
