#include "executor/held_origins.h"

#include <chrono>
#include <cstdint>

#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

using namespace std::chrono_literals;

constexpr PublisherId kCamera = 11;
constexpr PublisherId kLidar = 12;
constexpr PublisherId kFusion = 21;
constexpr PublisherId kOwn = 31;

/// A component that publishes by `kOwn`, and what is delivered to it.
class HeldOriginsTest : public ::testing::Test {
 protected:
  void SetUp() override { owner_.publishers = {kOwn}; }

  void hold(PublisherId publisher, PublisherId root, int taken_ms, int published_ms,
            std::int64_t end_ns = base::kNever) {
    Envelope envelope;
    envelope.info.publisher = publisher;
    envelope.info.publish_time = Time(std::chrono::milliseconds(published_ms));
    envelope.info.origin = {.taken = Time(std::chrono::milliseconds(taken_ms)), .root = root};
    held_.hold(envelope, end_ns);
  }
  [[nodiscard]] Origin oldest(int now_ms = 1000) const {
    return held_.oldest(now_ms * 1'000'000LL);
  }

  PublishingComponent owner_;
  HeldOrigins held_{owner_};
};

TEST_F(HeldOriginsTest, SayNothingBeforeAnythingWasDelivered) {
  EXPECT_EQ(oldest().root, 0U);
}

TEST_F(HeldOriginsTest, SayTheOldestOfTheNewestOfEachRoot) {
  hold(kCamera, kCamera, 10, 11);
  hold(kLidar, kLidar, 20, 21);
  hold(kCamera, kCamera, 30, 31);
  EXPECT_EQ(oldest().root, kLidar);
  EXPECT_EQ(oldest().taken, Time(20ms));
  EXPECT_TRUE(oldest().held);
}

TEST_F(HeldOriginsTest, DistinguishThousandsOfPublishers) {
  constexpr PublisherId kPublishers = 5000;
  const auto id = [](PublisherId i) { return (i * 7919) % kPublishers + 1000; };
  for (PublisherId i = 0; i < kPublishers; ++i) {
    hold(id(i), kLidar, 10, 11);
  }
  for (PublisherId i = 0; i < kPublishers; i += 2) {
    held_.forget(id(i));
  }
  for (PublisherId i = 1; i < kPublishers; i += 2) {
    hold(id(i), kCamera, 50, 51);  // Each in the place of what it said before.
  }

  EXPECT_EQ(oldest().root, kCamera);
  EXPECT_EQ(oldest().taken, Time(50ms));
  hold(id(0), kLidar, 5, 60);
  EXPECT_EQ(oldest().taken, Time(5ms));
}

TEST_F(HeldOriginsTest, TakeTheNewestOfARootThatComesByTwoWays) {
  hold(kLidar, kLidar, 40, 41);
  hold(kFusion, kLidar, 20, 45);
  EXPECT_EQ(oldest().taken, Time(40ms));
}

TEST_F(HeldOriginsTest, EndARootWithTheNextMessageOfWhoSaidIt) {
  hold(kFusion, kFusion, 10, 11);
  hold(kFusion, kLidar, 50, 55);
  EXPECT_EQ(oldest().root, kLidar);
}

TEST_F(HeldOriginsTest, EndARootWithItsLifespan) {
  hold(kCamera, kCamera, 10, 11, 100'000'000);
  EXPECT_EQ(oldest(99).root, kCamera);
  EXPECT_EQ(oldest(100).root, 0U);
}

TEST_F(HeldOriginsTest, EndARootWithTheSubscription) {
  hold(kCamera, kCamera, 10, 11);
  hold(kLidar, kLidar, 20, 21);
  held_.forget(kCamera);
  EXPECT_EQ(oldest().root, kLidar);
}

TEST_F(HeldOriginsTest, KeepTheOthersWhenOneSubscriptionEnds) {
  hold(kCamera, kCamera, 30, 31);
  hold(kLidar, kLidar, 10, 11);
  hold(kFusion, kFusion, 20, 21);

  held_.forget(kCamera);
  hold(kFusion, kFusion, 25, 26);

  EXPECT_EQ(oldest().root, kLidar);
  held_.forget(kLidar);
  EXPECT_EQ(oldest().root, kFusion);
  EXPECT_EQ(oldest().taken, Time(25ms));
  held_.forget(kFusion);
  EXPECT_EQ(oldest().root, 0U);
}

TEST_F(HeldOriginsTest, DoNotHoldWhatTheComponentMeasuredItself) {
  hold(kFusion, kOwn, 10, 20);
  EXPECT_EQ(oldest().root, 0U);
}

TEST_F(HeldOriginsTest, AreNotSetBackByAnOlderMessageOfTheSamePublisher) {
  hold(kCamera, kCamera, 30, 31);
  hold(kCamera, kCamera, 10, 11);
  EXPECT_EQ(oldest().taken, Time(30ms));
}

TEST_F(HeldOriginsTest, FindTheOldestAmongMoreRootsThanThereArePlaces) {
  for (int i = 0; i < 40; ++i) {
    const auto root = static_cast<PublisherId>(100 + i);
    hold(root, root, i == 23 ? 5 : 500 + i, 600 + i);
  }
  EXPECT_EQ(oldest().taken, Time(5ms));
}

}  // namespace
}  // namespace fastcycle::detail
