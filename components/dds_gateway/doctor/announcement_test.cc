#include "dds_gateway/doctor/announcement.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>

namespace fastcycle::dds_gateway {
namespace {

using ::testing::ElementsAre;

/// An announcement as a participant sends it.
class Packet {
 public:
  Packet() {
    add("RTPS");
    add(std::string("\2\1\1\x10", 4));
    add(
        std::string("\1\x10"
                    "abcdefghij",
                    12));
    add(
        std::string("\x09\1\x08\0"
                    "timestmp",
                    12));             // A submessage that is none of an announcement.
    add(std::string("\x15\x05", 2));  // DATA, little-endian, with data.
    size_at_ = bytes_.size();
    add(std::string("\0\0", 2));
    add(
        std::string("\0\0\x10\0"
                    "\0\0\0\0"
                    "\0\1\0\xc2"
                    "\0\0\0\0\1\0\0\0",
                    20));
    add(std::string("\0\3\0\0", 4));  // Parameters, little-endian.
  }
  Packet& parameter(std::uint16_t id, const std::string& value) {
    add(std::string{static_cast<char>(id), static_cast<char>(id >> 8U),
                    static_cast<char>(value.size()), static_cast<char>(value.size() >> 8U)});
    add(value);
    return *this;
  }
  Packet& end() {
    add(std::string("\1\0\0\0", 4));
    const std::size_t size = bytes_.size() - size_at_ - 2;
    bytes_[size_at_] = static_cast<std::byte>(size);
    bytes_[size_at_ + 1] = static_cast<std::byte>(size >> 8U);
    return *this;
  }
  std::vector<std::byte>& bytes() { return bytes_; }

 private:
  void add(const std::string& text) {
    const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
    bytes_.insert(bytes_.end(), begin, begin + text.size());
  }
  std::vector<std::byte> bytes_;
  std::size_t size_at_ = 0;
};

std::string locator(const std::string& address, char kind = 1) {
  return std::string{kind, 0, 0, 0} + std::string("\xf2\x1c\0\0", 4) + std::string(12, '\0') +
         address;
}

Packet whole() {
  return Packet()
      .parameter(0x0032, locator(std::string("\xc0\xa8\1\7", 4)))
      .parameter(0x0031, locator(std::string("\xc0\xa8\1\7", 4)))
      .parameter(0x0031, locator(std::string("\x7f\0\0\1", 4)))
      .parameter(0x0031, locator(std::string("\1\2\3\4", 4), 2))  // Of IPv6.
      .parameter(0x0062, std::string("\6\0\0\0lidar\0\0\0", 12))
      .parameter(0x1001, std::string("token", 5))
      .end();
}

TEST(Announcement, SaysWhoWantsToBeAnsweredWhere) {
  const auto found = read_announcement(whole().bytes());

  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(std::string(found->participant.begin(), found->participant.end()),
            std::string("\1\x10"
                        "abcdefghij"
                        "\0\0\1\xc1",
                        16));
  EXPECT_EQ(found->name, "lidar");
  EXPECT_THAT(found->addresses, ElementsAre("192.168.1.7", "127.0.0.1"));
  EXPECT_TRUE(found->is_secured);
}

TEST(Announcement, IsNoneIfItIsCut) {
  const std::vector<std::byte> bytes = whole().bytes();

  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(read_announcement(std::span(bytes).first(size)).has_value()) << size;
  }
}

TEST(Announcement, KeepsFewAddressesOfMany) {
  Packet packet;
  for (char i = 0; i < 100; ++i) {
    packet.parameter(0x0032, locator(std::string{10, 0, 0, i}));
  }

  const auto found = read_announcement(packet.end().bytes());

  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->addresses.size(), 16U);
}

// What comes on a port that is open to everybody may be anything.
TEST(Announcement, IsReadOrNotWhateverTheBytesAre) {
  std::mt19937 random(1);  // NOLINT: the same bytes each time.
  const std::vector<std::byte> bytes = whole().bytes();
  int read = 0;
  constexpr int kTries = 200'000;

  for (int i = 0; i < kTries; ++i) {
    std::vector<std::byte> changed = bytes;
    for (unsigned change = 1 + random() % 4; change > 0; --change) {
      changed[random() % changed.size()] = static_cast<std::byte>(random());
    }
    changed.resize(changed.size() - random() % 8);
    read += read_announcement(changed).has_value() ? 1 : 0;
  }

  EXPECT_GT(read, 0);
  EXPECT_LT(read, kTries);
}

TEST(Announcement, TellsTheImplementationByTheFirstBytes) {
  Guid guid{};
  guid[0] = 1;
  guid[1] = 0x0f;
  EXPECT_EQ(implementation_of(guid), "Fast DDS");
  guid[1] = 0x10;
  EXPECT_EQ(implementation_of(guid), "Cyclone DDS");
  guid[1] = 0x7f;
  EXPECT_EQ(implementation_of(guid), "vendor 01.7f");
}

}  // namespace
}  // namespace fastcycle::dds_gateway
