#include "web/outbox.h"

#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::web {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

std::shared_ptr<const SharedMessage> message(std::size_t bytes, char letter = 'x') {
  return std::make_shared<const SharedMessage>(
      SharedMessage{.time_ns = 7, .payload = std::string(bytes, letter)});
}

/// The first letters of all that waits; of control frames the first of their text.
std::string letters_of(Outbox& outbox) {
  std::string letters;
  while (const auto frame = outbox.take()) {
    letters += frame->message == nullptr ? frame->head.front() : frame->message->payload.front();
  }
  return letters;
}

TEST(Frame, SaysItsSizeInAsManyBytesAsItNeeds) {
  const auto head_of = [](std::size_t bytes) {
    return Frame{.is_text = false, .head = "12", .message = message(bytes - 2)}.wire_head();
  };

  EXPECT_EQ((Frame{.is_text = true, .head = "abc", .message = {}}).wire_head(), "\x81\x03");
  EXPECT_EQ(head_of(125), "\x82\x7D");
  EXPECT_EQ(head_of(126), std::string("\x82\x7E\x00\x7E", 4));
  EXPECT_EQ(head_of(65'535), "\x82\x7E\xFF\xFF");
  EXPECT_EQ(head_of(65'536), std::string("\x82\x7F\0\0\0\0\0\x01\0\0", 10));
}

TEST(Outbox, GivesTurnsToItsSubscriptions) {
  Outbox outbox({});
  outbox.add(1);
  outbox.add(2);
  for (int i = 0; i < 3; ++i) {
    outbox.put(1, message(10, 'a'));
  }
  outbox.put(2, message(10, 'b'));
  outbox.put_text("t");

  EXPECT_EQ(letters_of(outbox), "tabaa");
  EXPECT_EQ(outbox.waiting(), 0);
}

TEST(Outbox, ForgetsMessagesWithoutLosingThem) {
  Outbox outbox({.large_bytes = 100});
  outbox.add(1);
  outbox.add(2);
  outbox.put(1, message(10, 'a'));
  outbox.put(2, message(100, 'b'));
  outbox.put_text("t");

  outbox.forget_messages();
  outbox.put(1, message(10, 'c'));

  EXPECT_EQ(outbox.waiting(), 11);
  EXPECT_EQ(letters_of(outbox), "tc");
  EXPECT_THAT(outbox.take_losses(), SizeIs(0));
}

TEST(Outbox, KeepsOnlyTheNewestOfLargeMessages) {
  Outbox outbox({.large_bytes = 100});
  outbox.add(1);
  outbox.add(2);
  outbox.put(1, message(100, 'a'));
  outbox.put(2, message(99, 'c'));
  outbox.put(1, message(100, 'b'));
  outbox.put(2, message(99, 'd'));

  EXPECT_EQ(letters_of(outbox), "bcd");
  const auto losses = outbox.take_losses();
  ASSERT_THAT(losses, SizeIs(1));
  EXPECT_EQ(losses[0].subscription, 1);
  EXPECT_EQ(losses[0].count, 1);
  EXPECT_THAT(outbox.take_losses(), SizeIs(0));
}

TEST(Outbox, TakesRoomFromWhoHasMost) {
  Outbox outbox({.bytes = 1000, .large_bytes = 1'000'000});
  outbox.add(1);
  outbox.add(2);
  outbox.put(2, message(50, 'b'));
  for (int i = 0; i < 100; ++i) {
    outbox.put(1, message(100, 'a'));
    EXPECT_LE(outbox.waiting(), 1000);
  }

  EXPECT_EQ(letters_of(outbox), "abaaaaaaaa");
  ASSERT_THAT(outbox.take_losses(), SizeIs(1));
}

TEST(Outbox, GivesWhatIsLargerThanAllThatMayWaitAlone) {
  Outbox outbox({.bytes = 1000, .large_bytes = 100});
  outbox.add(1);
  outbox.add(2);
  outbox.put(1, message(5000, 'a'));
  EXPECT_EQ(letters_of(outbox), "a");

  outbox.put(2, message(50, 'b'));
  outbox.put(1, message(5000, 'a'));
  EXPECT_EQ(letters_of(outbox), "b");
  ASSERT_THAT(outbox.take_losses(), SizeIs(1));
}

TEST(Outbox, LeavesEachSubscriptionItsNewestMessage) {
  Outbox outbox({.bytes = 1000, .large_bytes = 800});
  for (std::uint32_t subscription = 1; subscription <= 3; ++subscription) {
    outbox.add(subscription);
    outbox.put(subscription, message(900, static_cast<char>('a' + subscription - 1)));
  }
  EXPECT_EQ(letters_of(outbox), "abc");
}

TEST(Outbox, ForgetsWhatWaitsOfASubscriptionThatEnds) {
  Outbox outbox({});
  outbox.add(1);
  outbox.put(1, message(10));
  outbox.remove(1);
  outbox.put(1, message(10));

  EXPECT_FALSE(outbox.take());
  EXPECT_EQ(outbox.waiting(), 0);
}

TEST(Outbox, SaysThatAClientDoesNotReadWhatItAskedFor) {
  Outbox outbox({.control_bytes = 100});
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(outbox.is_overrun());
    outbox.put_binary(std::string(11, 'x'));
  }
  EXPECT_TRUE(outbox.is_overrun());
}

}  // namespace
}  // namespace fastcycle::web
