#include "executor/round_stage.h"

#include <vector>

#include <gtest/gtest.h>

#include "executor/test_parts.h"

namespace fastcycle::detail {
namespace {

class RoundStageTest : public ActorParts {
 protected:
  RoundStageTest() : ActorParts(true) {}
};

TEST_F(RoundStageTest, HandsOverMessagesAndActionsInTheirOrder) {
  PublisherCore& speed = publisher("speed");
  subscriptions_.add(topic("speed"), {}, note());
  topics_.connect_all();
  speed.owner.stage = &stage_;
  std::vector<int> seen;
  stage_.put([&] { seen.push_back(actor_.inbox.is_quiet() ? 0 : 1); });
  publish(speed, 1);
  stage_.put([&] { seen.push_back(actor_.inbox.is_quiet() ? 0 : 1); });
  EXPECT_TRUE(actor_.inbox.is_quiet());
  EXPECT_FALSE(stage_.is_empty());

  stage_.hand_over();

  EXPECT_EQ(seen, (std::vector<int>{0, 1}));
  EXPECT_TRUE(stage_.is_empty());
  release(pop().head.envelope);
}

TEST_F(RoundStageTest, KeepsForTheNextRoundWhatIsPutWhileItHandsOver) {
  int done = 0;
  stage_.put([&] { stage_.put([&] { ++done; }); });

  stage_.hand_over();
  EXPECT_EQ(done, 0);
  EXPECT_FALSE(stage_.is_empty());
  stage_.hand_over();
  EXPECT_EQ(done, 1);
}

}  // namespace
}  // namespace fastcycle::detail
