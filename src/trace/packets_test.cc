#include "trace/packets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "trace/test_trace.h"

namespace fastcycle::trace {
namespace {

TEST(Fields, AreWrittenInProtobufsWireFormat) {
  std::string bytes;
  Fields fields(bytes);

  fields.number(1, 150);
  fields.text(2, "testing");
  fields.fixed(3, 1);
  fields.message(4, [](Fields& inner) { inner.number(1, 1); });

  // The first two are the examples of the format's description.
  EXPECT_EQ(bytes, std::string("\x08\x96\x01"
                               "\x12\x07testing"
                               "\x19\x01\0\0\0\0\0\0\0"
                               "\x22\x02\x08\x01",
                               25));
}

TEST(Fields, AMessageThatIsLongHasALengthOfSeveralBytes) {
  for (const std::size_t size : {127U, 128U, 16'383U, 16'384U, 100'000U}) {
    std::string bytes;
    const std::string text(size, 'x');

    Fields(bytes).message(4, [&](Fields& inner) { inner.text(1, text); });

    EXPECT_EQ(read_message(read_message(bytes).text(4)).text(1), text);
  }
}

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
