#include "ros2/cdr.h"

#include <initializer_list>
#include <vector>

#include <gmock/gmock.h>

namespace fastcycle::ros2 {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> result;
  for (const int value : values) {
    result.push_back(static_cast<std::byte>(value));
  }
  return result;
}

TEST(CdrReader, ValuesAreAlignedToTheirSizeBehindTheHead) {
  const auto message = bytes({0, 1, 0, 0, 7, 0, 0,    0,   1, 2, 0, 0,  //
                              0, 0, 0, 0, 0, 0, 0xf0, 0x3f});
  CdrReader in(message);

  EXPECT_EQ(in.number<std::uint8_t>("a"), 7);
  EXPECT_EQ(in.number<std::uint16_t>("b"), 0);
  EXPECT_EQ(in.number<std::uint32_t>("c"), 0x201U);
  EXPECT_EQ(in.number<double>("d"), 1.0);
}

TEST(CdrReader, BothByteOrdersAreRead) {
  const auto message = bytes({0, 0, 0, 0, 0, 0, 1, 2, 0x3f, 0x80, 0, 0});
  CdrReader in(message);

  EXPECT_EQ(in.number<std::uint32_t>("a"), 0x102U);
  EXPECT_EQ(in.number<float>("b"), 1.0F);
}

TEST(CdrReader, TextEndsBeforeItsZero) {
  const auto message = bytes({0, 1, 0, 0, 3, 0, 0, 0, 'a', 'b', 0, 9, 0, 0, 0, 0});
  CdrReader in(message);

  EXPECT_EQ(in.text("name"), "ab");
  EXPECT_EQ(in.text("empty"), "");
  in.end();
}

TEST(CdrReader, LengthsBeyondTheEndAreErrors) {
  const auto message = bytes({0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0});

  EXPECT_THAT([&] { CdrReader(message).bytes("data"); },
              ThrowsMessage<CdrError>(HasSubstr("byte 8: data: expected 4294967295 elements")));
  EXPECT_THAT([&] { CdrReader(message).count("points", 8); },
              ThrowsMessage<CdrError>(HasSubstr("found 2 bytes")));
  EXPECT_THAT([&] { CdrReader(message).number<double>("x"); },
              ThrowsMessage<CdrError>(HasSubstr("x: ")));
}

TEST(CdrReader, OtherRepresentationsAreRefused) {
  EXPECT_THAT(
      [] { CdrReader(bytes({0, 7, 0, 0})); },
      ThrowsMessage<CdrError>(HasSubstr("expected plain CDR, 0x0000 or 0x0001, found 0x0007")));
  EXPECT_THAT([] { CdrReader(bytes({0})); }, ThrowsMessage<CdrError>(HasSubstr("found 1")));
}

TEST(CdrReader, TextsAreUtf8AndMessagesEnd) {
  const auto message = bytes({0, 1, 0, 0, 2, 0, 0, 0, 0xff, 0, 0, 0, 0, 0, 0, 0, 0, 0});

  EXPECT_THAT([&] { CdrReader(message).text("name"); },
              ThrowsMessage<CdrError>(HasSubstr("UTF-8")));
  EXPECT_THAT(
      [&] { CdrReader(message).end(); },
      ThrowsMessage<CdrError>(HasSubstr("expected the end of the message, found 14 bytes")));
}

}  // namespace
}  // namespace fastcycle::ros2
