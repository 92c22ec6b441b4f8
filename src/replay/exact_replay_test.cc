#include "replay/exact_replay.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "component/component_core.h"
#include "component/versions.h"
#include "config/test_folder.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "record/recorded_schedule.h"
#include "record/recording_reader.h"
#include "replay/drive_comparison.h"
#include "replay/recorded_driver.h"
#include "replay/stand_ins.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using record::RecordedSchedule;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace std::chrono_literals;

/// Publishes 1, 2, 3, … on "numbers", or nothing; throws after some.
class Counting final : public Component {
 public:
  explicit Counting(Context& context)
      : Component(context),
        is_silent_(context.param<bool>("is_silent", {.fallback = false})),
        throws_at_(context.param<std::int64_t>("throws_at", {.fallback = 0})),
        numbers_(context.create_publisher<Int64Value>("numbers")) {}

  void serve() override {
    if (++serves_ == throws_at_.get()) {
      throw std::runtime_error("enough");
    }
    if (is_silent_.get()) {
      return;
    }
    auto number = numbers_.loan();
    number->set_value(serves_);
    numbers_.publish(std::move(number));
  }

 private:
  Param<bool> is_silent_;
  Param<std::int64_t> throws_at_;
  Publisher<Int64Value> numbers_;
  std::int64_t serves_ = 0;
};

std::string application_with(const std::string& params) {
  return R"({"name": "t", "components": [{"name": "driver", "library": "driver",
    "serve_period_ms": 1, "on_fault": "stop_component", "params": )" +
         params + "}]}";
}

class ExactReplays : public testing::Test {
 protected:
  ExactReplays() { classes_.with<Counting>("driver"); }

  /// Records 20 ms, and calls `then` with the driver.
  std::filesystem::path record(
      const std::string& text,
      const std::function<void(Application&, detail::ComponentCore&)>& then = {}) {
    const std::filesystem::path file = folder_ / "drive.mcap";
    config::Problems problems;
    Application application(describe_text(text, problems), {.is_simulated = true});
    config::RecordDescription recorded;
    recorded.file = file;
    application.record(recorded);
    application.build(classes_, problems, ConstructorFault::kFault);
    EXPECT_FALSE(problems.has_errors()) << config::text_of(problems);
    application.start();
    application.advance_to(application.start_time() + 20ms);
    if (then) {
      then(application, *application.components().at(0));
    }
    application.request_end(EndReason::kRequested);
    application.stop();
    return file;
  }

  /// Executes a log again, with the components of `text`. The results are in the members.
  void execute(const std::filesystem::path& file, const std::string& text) {
    const RecordedSchedule schedule = RecordedSchedule::read({file});
    const record::RecordingReader reader({file});
    config::Problems problems;
    StandIns stand_ins(classes_, describe_text(text, problems), reader.streams());
    auto driver = std::make_unique<RecordedDriver>();
    RecordedDriver& recorded = *driver;
    Application application(std::move(driver), stand_ins.description());
    application.own_topics_are_free = true;
    application.declare_stand_in = [&](auto& core) { stand_ins.declare(core); };
    application.build(stand_ins, problems, ConstructorFault::kFault);
    ASSERT_FALSE(problems.has_errors()) << config::text_of(problems);
    DriveComparison comparison(schedule);
    {
      ExactReplay replay(application, recorded, schedule, {.files = {file}}, problems);
      ASSERT_FALSE(problems.has_errors()) << config::text_of(problems);
      replay.listener = &comparison;
      replay.run({});
      comparison.finish();
      results_ = replay.results();
      topics_ = comparison.topics();
    }
    application.stop();
  }

  [[nodiscard]] ExactReplayResult result() const {
    const auto found = std::ranges::find(results_, "driver", &ExactReplayResult::component);
    return found == results_.end() ? ExactReplayResult() : *found;
  }
  [[nodiscard]] TopicChange numbers() const {
    const auto found = std::ranges::find(topics_, "numbers", &TopicChange::topic);
    return found == topics_.end() ? TopicChange() : *found;
  }

  config::TestFolder folder_;
  TestClasses classes_;
  std::vector<ExactReplayResult> results_;
  std::vector<TopicChange> topics_;
};

TEST_F(ExactReplays, ARunIsEqualToItself) {
  execute(record(application_with("{}")), application_with("{}"));

  EXPECT_TRUE(result().is_equal());
  EXPECT_EQ(result().activations, result().recorded);
  EXPECT_GT(numbers().compared, 10U);
  EXPECT_TRUE(numbers().is_equal());
}

// All of it is executed before the first recorded message is read.
TEST_F(ExactReplays, MessagesOfAPublisherThatIsSilentNowAreAllMissing) {
  const auto file = record(application_with("{}"));
  execute(file, application_with("{}"));
  const std::uint64_t published = numbers().compared;

  execute(file, application_with(R"({"is_silent": true})"));

  EXPECT_EQ(numbers().compared, 0U);
  EXPECT_EQ(numbers().missing, published);
  EXPECT_FALSE(numbers().is_equal());
}

TEST_F(ExactReplays, AReloadThatWasRefusedDoesNotEndTheExecution) {
  const std::string text = application_with(R"({"throws_at": 5})");
  std::string why_not = "nobody said";
  const auto file = record(text, [&](Application& application, detail::ComponentCore& core) {
    const auto order = std::make_shared<detail::ReloadOrder>();
    order->on_result = [&why_not](const std::string& said) { why_not = said; };
    core.post(
        detail::Cause::kMode, [&core, order] { core.versions->reload(order); }, nullptr,
        detail::to_key(detail::LifeStep::kReload));
    application.advance_to(application.start_time() + 30ms);
  });
  ASSERT_THAT(why_not, HasSubstr("failed"));

  execute(file, text);

  EXPECT_THAT(result().why, IsEmpty());
  EXPECT_EQ(result().activations, result().recorded);
  EXPECT_TRUE(result().is_equal());
}

TEST_F(ExactReplays, AReloadEndsTheExecution) {
  const auto file = record(application_with("{}"), [&](Application& application,
                                                       detail::ComponentCore& core) {
    const auto order = std::make_shared<detail::ReloadOrder>();
    order->version = {.component_class = core.component_class, .library = "new", .build_id = {}};
    order->on_result = [](const std::string& said) { EXPECT_THAT(said, IsEmpty()); };
    core.post(
        detail::Cause::kMode, [&core, order] { core.versions->reload(order); }, nullptr,
        detail::to_key(detail::LifeStep::kReload));
    application.advance_to(application.start_time() + 30ms);
  });

  execute(file, application_with("{}"));

  EXPECT_THAT(result().why, HasSubstr("it was reloaded in activation"));
  EXPECT_LT(result().activations, result().recorded);
  EXPECT_TRUE(result().is_equal());
}

}  // namespace
}  // namespace fastcycle::host
