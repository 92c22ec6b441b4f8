#include "trace/packets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "trace/test_trace.h"

namespace fastcycle::trace {
namespace {

TEST(Packets, NamesAreWrittenOnceAndAgainAfterALoss) {
  Packets packets;
  const std::uint64_t name = packets.name("planner: serve");
  EXPECT_EQ(packets.name("planner: serve"), name);
  packets.add(Track{.id = 7, .name = "track"});
  const auto add = [&](std::int64_t time_ns) {
    packets.add(Event{.type = EventType::kInstant, .time_ns = time_ns, .track = 7, .name = name});
  };

  add(1);
  add(2);
  std::string bytes = packets.bytes();
  packets.clear();
  add(3);
  packets.clear();
  packets.begin_anew();
  add(4);
  bytes += packets.bytes();

  const TestTrace trace = read_trace(bytes);
  ASSERT_EQ(trace.events.size(), 3U);
  for (const TestEvent& event : trace.events) {
    EXPECT_EQ(event.name, "planner: serve");
  }
  EXPECT_TRUE(trace.says_that_packets_were_dropped);
  std::size_t count = 0;
  for (std::size_t at = bytes.find("planner: serve"); at != std::string::npos;
       at = bytes.find("planner: serve", at + 1)) {
    ++count;
  }
  EXPECT_EQ(count, 2U);
}

}  // namespace
}  // namespace fastcycle::trace
