#include "standby/follower.h"

#include <cstdint>
#include <memory>
#include <optional>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "component/component_core.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::standby {
namespace {

using google::protobuf::Int64Value;

class Keeper final : public Component {
 public:
  explicit Keeper(Context& context) : Component(context), n_(context.state<Int64Value>("n")) {}

 private:
  State<Int64Value> n_;
};

/// A process with two workers, as its follower sees it.
class TwoWorkers final : public Followed {
 public:
  const detail::PeerActivity::Rings& rings() const override { return rings_; }
  std::uint32_t progress() const noexcept override { return progress_; }
  bool has_ended() const noexcept override { return false; }
  std::optional<std::uint32_t> crashed_in() const noexcept override { return {}; }
  void take_rest() override {}
  void take_place() override {}

  /// An activation of the component, done by that worker.
  void execute(detail::ActivationRing& worker, std::uint64_t number, std::int64_t begin_ns) {
    const detail::ActivationRecord record{
        .outcome = detail::Outcome::kDone, .number = number, .begin_ns = begin_ns};
    worker.end(worker.begin(record), record);
    ++progress_;
  }

  detail::ActivationRing first;
  detail::ActivationRing second;

 private:
  detail::ReadRing reads_{detail::ReadRing::kWithoutViews};
  detail::PeerActivity::Rings rings_{.workers = {&first, &second}, .reads = {&reads_}};
  std::uint32_t progress_ = 0;
};

class AFollower : public testing::Test {
 protected:
  AFollower() {
    classes_.with<Keeper>("counter");
    application_ = host::make_application(
        R"({"name": "t", "components": [{"name": "counter", "library": "counter"}]})", classes_);
  }

  [[nodiscard]] std::unique_ptr<Follower> follow(bool is_late) {
    return std::make_unique<Follower>(
        *application_, followed_,
        std::vector<detail::ComponentCore*>{application_->components().front().get()},
        Follower::Options{.is_late = is_late},
        Follower::Listener{.lost = [](const std::string& why) { FAIL() << why; }});
  }

  host::TestClasses classes_;
  std::unique_ptr<host::Application> application_;
  TwoWorkers followed_;
};

TEST_F(AFollower, FollowsAProcessFromItsFirstActivationOn) {
  const auto follower = follow(false);
  followed_.execute(followed_.first, 1, 1);
  followed_.execute(followed_.second, 2, 2);
  EXPECT_TRUE(follower->look(false));
  EXPECT_EQ(follower->progress().known, 2U);
}

TEST_F(AFollower, WaitsForAnActivationThatAnotherWorkerHasNotReportedYet) {
  const auto follower = follow(false);
  followed_.execute(followed_.second, 2, 2);
  follower->look(false);
  EXPECT_EQ(follower->progress().known, 0U);
  followed_.execute(followed_.first, 1, 1);
  follower->look(false);
  EXPECT_EQ(follower->progress().known, 2U);
}

// The rings are not read at one time: of activations that end meanwhile, it has seen some of one
// worker, and not those before or after of the other one.
TEST_F(AFollower, ThatComesLateFollowsNoActivationThatMayHaveGapsAfterIt) {
  followed_.execute(followed_.second, 6, 60);
  const std::int64_t before_ns = base::monotonic_ns();
  const auto follower = follow(true);
  followed_.execute(followed_.first, 5, before_ns);
  follower->look(false);
  EXPECT_EQ(follower->progress().known, 0U);

  const std::int64_t after_ns = base::monotonic_ns() + 1;
  followed_.execute(followed_.first, 7, after_ns);
  followed_.execute(followed_.second, 8, after_ns + 1);
  follower->look(false);
  EXPECT_EQ(follower->progress().known, 2U);
}

}  // namespace
}  // namespace fastcycle::standby
