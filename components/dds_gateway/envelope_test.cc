#include "dds_gateway/envelope.h"

#include <chrono>
#include <cstring>

#include <gmock/gmock.h>

#include "basic/basic.pb.h"
#include "broker/topics.h"
#include "dds_gateway/trail_exchange.h"
#include "ros2/error.h"

namespace fastcycle::dds_gateway {
namespace {

using namespace std::chrono_literals;

constexpr Time kStart{1'700'000'000s};

EnvelopeHead head_with_a_trail() {
  return {.clock = 11,
          .number = 12,
          .sequence = 13,
          .published = kStart + 5ms,
          .root = 14,
          .taken = kStart,
          .trails = {{.root = "lidar/points",
                      .taken = kStart,
                      .hops = {{.publisher = 21,
                                .component = "lidar",
                                .topic = "lidar/points",
                                .begin = kStart,
                                .published = kStart + 1ms},
                               {.publisher = 22,
                                .component = "perception",
                                .topic = "objects",
                                .begin = kStart + 2ms,
                                .published = kStart + 5ms}}}}};
}

TEST(Envelope, BringsAMessageAndWhatIsKnownOfIt) {
  basic::Text text;
  text.set_data("hello");
  ros2::Buffer bytes;
  write_envelope(text, head_with_a_trail(), bytes);

  basic::Text came;
  const EnvelopeHead head = read_envelope(bytes.bytes(), came);

  EXPECT_EQ(came.data(), "hello");
  EXPECT_EQ(head.clock, 11U);
  EXPECT_EQ(head.number, 12U);
  EXPECT_EQ(head.sequence, 13U);
  EXPECT_EQ(head.published, kStart + 5ms);
  EXPECT_EQ(head.root, 14U);
  EXPECT_EQ(head.taken, kStart);
  ASSERT_EQ(head.trails.size(), 1U);
  EXPECT_EQ(head.trails[0].root, "lidar/points");
  ASSERT_EQ(head.trails[0].hops.size(), 2U);
  EXPECT_EQ(head.trails[0].hops[1].component, "perception");
  EXPECT_EQ(head.trails[0].hops[1].topic, "objects");
  EXPECT_EQ(head.trails[0].hops[1].published, kStart + 5ms);
}

TEST(Envelope, WhatIsCutOrChangedIsReadOrRefused) {
  basic::Text text;
  text.set_data("hello");
  ros2::Buffer bytes;
  write_envelope(text, head_with_a_trail(), bytes);
  int refused = 0;

  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const int change : {0, 1, 0x80, 0xff}) {
      std::vector<std::byte> other(bytes.data(), bytes.data() + bytes.size());
      change == 0 ? other.resize(i) : void(other[i] ^= static_cast<std::byte>(change));
      basic::Text came;
      try {
        (void)read_envelope(other, came);
      } catch (const ros2::CdrError&) {
        ++refused;
      }
    }
  }

  EXPECT_GT(refused, static_cast<int>(bytes.size()));  // All that were cut, and more.
}

TEST(Envelope, TimesThatNoSumHasRoomForAreRefused) {
  basic::Text text;
  for (const std::int64_t time_ns : {std::int64_t{-1}, INT64_MAX, INT64_MIN}) {
    EnvelopeHead head = head_with_a_trail();
    head.taken = Time(Duration(time_ns));
    ros2::Buffer bytes;
    write_envelope(text, head, bytes);
    basic::Text came;
    EXPECT_THROW((void)read_envelope(bytes.bytes(), came), ros2::CdrError) << time_ns;
  }
}

TEST(TrailExchange, AChainThatIsKnownHereGoesOnWithTheClockOfHere) {
  detail::Topics topics;
  topics.set_chains({"camera/image", "lidar/points"}, {});
  TrailExchange exchange(topics);

  const auto trails = exchange.from_envelope(head_with_a_trail().trails, 100ms);

  ASSERT_EQ(trails.size(), 2U);
  EXPECT_FALSE(trails[0].is_known());
  ASSERT_TRUE(trails[1].is_known());
  EXPECT_EQ(trails[1].taken(), kStart + 100ms);
  ASSERT_EQ(trails[1].hops().size(), 2U);
  EXPECT_EQ(trails[1].hops()[1].publisher, 22U);
  EXPECT_EQ(trails[1].hops()[1].published, kStart + 105ms);
  EXPECT_EQ(topics.names().find(22)->component, "perception");
}

TEST(TrailExchange, WhatCameGoesOutAgainWithItsNames) {
  detail::Topics topics;
  topics.set_chains({"lidar/points"}, {});
  TrailExchange exchange(topics);
  const auto trails = exchange.from_envelope(head_with_a_trail().trails, 0ms);

  const auto out = exchange.to_envelope(trails.data());

  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out[0].root, "lidar/points");
  EXPECT_EQ(out[0].taken, kStart);
  ASSERT_EQ(out[0].hops.size(), 2U);
  EXPECT_EQ(out[0].hops[0].component, "lidar");
  EXPECT_EQ(out[0].hops[1].begin, kStart + 2ms);
}

TEST(TrailExchange, AChainThatNobodyHereKnowsIsLeftOut) {
  detail::Topics topics;
  topics.set_chains({"camera/image"}, {});
  TrailExchange exchange(topics);

  EXPECT_FALSE(exchange.from_envelope(head_with_a_trail().trails, 0ms)[0].is_known());
}

}  // namespace
}  // namespace fastcycle::dds_gateway
