#include "record/message_infos.h"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include "log/log.pb.h"

namespace fastcycle::record {
namespace {

constexpr std::uint64_t kLast32 = std::numeric_limits<std::uint32_t>::max();

/// A measurement, taken when it was published: the message record says all of it.
MessageFacts measurement() {
  return {.channel = 3, .sequence = 8, .publisher = 77};
}

log::MessageInfos read(const std::string& bytes) {
  log::MessageInfos infos;
  EXPECT_TRUE(infos.ParseFromString(bytes));
  return infos;
}

TEST(MessageInfos, AreNeededOnlyForWhatTheRecordDoesNotSay) {
  EXPECT_FALSE(measurement().are_needed());

  MessageFacts later = measurement();
  later.age_ns = 1;
  EXPECT_TRUE(later.are_needed());
  MessageFacts earlier = measurement();
  earlier.age_ns = -1;
  EXPECT_TRUE(earlier.are_needed()) << "published before it was taken: a clock was set";
  MessageFacts held = measurement();
  held.held = true;
  EXPECT_TRUE(held.are_needed());
}

TEST(MessageInfos, NameARootThatIsNotTheMessagesOwn) {
  MessageFacts message = measurement();
  message.root = message.publisher;
  EXPECT_FALSE(message.are_needed());
  message.root = 78;
  EXPECT_TRUE(message.are_needed());
}

TEST(MessageInfos, HaveTheBitsThatARecordHasNoPlaceFor) {
  MessageFacts message = measurement();
  message.sequence = kLast32;
  EXPECT_FALSE(message.are_needed());
  message.sequence = kLast32 + 1;
  EXPECT_TRUE(message.are_needed());
}

TEST(MessageInfos, AreEmptyIfNoneIsNeeded) {
  EXPECT_EQ(infos_of({}), "");
  EXPECT_EQ(infos_of(std::vector{measurement(), measurement()}), "");
}

TEST(MessageInfos, SayWhatIsNeededInItsOrder) {
  MessageFacts derived{.channel = 4,
                       .sequence = kLast32 + 9,
                       .age_ns = -5,
                       .publisher = 77,
                       .root = 78,
                       .held = true};
  MessageFacts own{.channel = 5, .sequence = 1, .age_ns = 2, .publisher = 77, .root = 77};

  const log::MessageInfos infos = read(infos_of(std::vector{derived, measurement(), own}));

  ASSERT_EQ(infos.infos_size(), 2);
  EXPECT_EQ(infos.infos(0).channel(), 4U);
  EXPECT_EQ(infos.infos(0).sequence(), kLast32 + 9);
  EXPECT_EQ(infos.infos(0).age_ns(), -5);
  EXPECT_EQ(infos.infos(0).root(), 78U);
  EXPECT_TRUE(infos.infos(0).held());
  EXPECT_EQ(infos.infos(1).channel(), 5U);
  EXPECT_EQ(infos.infos(1).root(), 0U) << "its own";
}

TEST(MessageInfos, HaveASchemaThatAReaderCanBuild) {
  const mcap::Schema schema = infos_schema(9);

  EXPECT_EQ(schema.id, 9);
  EXPECT_EQ(schema.name, "fastcycle.log.MessageInfos");
  EXPECT_EQ(schema.encoding, "protobuf");
  google::protobuf::FileDescriptorSet files;
  ASSERT_TRUE(files.ParseFromString(schema.data));
  EXPECT_EQ(files.file(0).package(), "fastcycle.log");
}

}  // namespace
}  // namespace fastcycle::record
