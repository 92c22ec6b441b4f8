#include "component/declared_states.h"

#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "component/component_core.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

/// Counts its ticks in its state, and throws at every fourth.
class Counter final : public Component {
 public:
  explicit Counter(Context& context)
      : Component(context),
        ticks_(context.state<Int64Value>("ticks")),
        begins_at_(ticks_->value()) {}
  void serve() override {
    ticks_->set_value(ticks_->value() + 1);
    if (ticks_->value() % 4 == 0) {
      throw std::runtime_error("on purpose");
    }
  }
  void stop() override {
    report("ticks", ticks_->value());
    report("begins_at", begins_at_);
  }

 private:
  State<Int64Value> ticks_;
  const std::int64_t begins_at_;
};

/// The same with a member of its own.
class Saver final : public Component {
 public:
  explicit Saver(Context& context)
      : Component(context),
        state_(context.state<Int64Value>("ticks",
                                         [this](Int64Value& state) { state.set_value(ticks_); })),
        ticks_(state_->value()),
        begins_at_(ticks_) {}
  void serve() override {
    if (++ticks_ % 4 == 0) {
      throw std::runtime_error("on purpose");
    }
  }
  void stop() override {
    report("ticks", ticks_);
    report("begins_at", begins_at_);
  }

 private:
  State<Int64Value> state_;
  std::int64_t ticks_;
  const std::int64_t begins_at_;
};

constexpr const char* kText = R"({"name": "t", "components": [
  {"name": "counter", "library": "counter", "serve_period_ms": 10, "on_fault": "restart",
   "restart": {"limit": 2, "within_s": 60, "back_off_ms": 0}}]})";

template <typename T>
std::unique_ptr<Application> run(const char* text, Duration time) {
  TestClasses classes;
  classes.with<T>("counter");
  auto application = make_application(text, classes, {.is_simulated = true});
  application->start();
  application->run(time);
  application->stop();
  return application;
}

template <typename T>
class AState : public testing::Test {};
using BothForms = testing::Types<Counter, Saver>;
TYPED_TEST_SUITE(AState, BothForms);

TYPED_TEST(AState, OutlivesTheObjectsOfItsComponent) {
  // Faults at the ticks 4 and 8; it is stopped after the eleventh.
  const auto application = run<TypeParam>(kText, 105ms);

  const detail::ComponentCore& core = *application->components().front();
  EXPECT_EQ(core.restart_count, 2);
  EXPECT_EQ(core.results.at("begins_at"), ReportValue(std::int64_t{8}));
  EXPECT_GT(std::get<std::int64_t>(core.results.at("ticks")), 9);
}

TYPED_TEST(AState, HasATopicOfItsOwnThatStaysEmptyWhereNobodyRecords) {
  const auto application = run<TypeParam>(kText, 105ms);

  const detail::Topic* topic = application->topics().find("counter#state/ticks");
  ASSERT_NE(topic, nullptr);
  EXPECT_EQ(topic->type, "google.protobuf.Int64Value");
  EXPECT_EQ(topic->publishers.front()->published(), 0);
}

template <int which>
class Invalid final : public Component {
 public:
  explicit Invalid(Context& context) : Component(context) {
    if (which == 0) {
      static_cast<void>(context.state<Int64Value>("Not a name"));
    } else {
      static_cast<void>(context.state<Int64Value>("twice"));
      if (which == 1) {
        static_cast<void>(context.state<Int64Value>("twice"));
      } else {
        static_cast<void>(context.state<StringValue>("twice"));
      }
    }
  }
};

template <int which>
std::string error_of() {
  TestClasses classes;
  classes.with<Invalid<which>>("counter");
  config::Problems problems;
  Application application(describe_text(kText, problems), {.is_simulated = true});
  application.build(classes, problems, ConstructorFault::kFault);
  std::string text;
  for (const config::Problem& problem : problems.all()) {
    text += config::to_string(problem) + "\n";
  }
  return text;
}

TEST(DeclaredStates, ReportWhatIsWrongWithADeclaration) {
  EXPECT_THAT(error_of<0>(), HasSubstr("state \"Not a name\" is no name: expected"));
  EXPECT_THAT(error_of<1>(), HasSubstr("component \"counter\": state \"twice\" is declared twice"));
  EXPECT_THAT(error_of<2>(), HasSubstr("is declared twice, with two types"));
}

}  // namespace
}  // namespace fastcycle::host
