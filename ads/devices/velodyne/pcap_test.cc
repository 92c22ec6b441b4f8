#include "pcap.h"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "capture.h"
#include "common/files.h"

namespace ads::velodyne {
namespace {

using testing::Capture;

constexpr std::int64_t kTime_ns = 1'700'000'000'123'456'000;
const std::vector<std::uint8_t> kPayload = {1, 2, 3, 4, 5};

class PcapTest : public ::testing::Test {
 protected:
  ~PcapTest() override { std::filesystem::remove(file_); }

  PcapReader open(const std::string& bytes) {
    write_file(file_, bytes);
    return PcapReader(file_);
  }

  std::string refusal(const std::string& bytes) {
    try {
      (void)open(bytes);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return {};
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() /
      (std::string("pcap_test_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() +
       ".pcap");
};

TEST_F(PcapTest, DatagramsAreReadInEitherByteOrderWithTheirTimes) {
  for (const bool is_big : {false, true}) {
    for (const bool has_nanoseconds : {false, true}) {
      Capture capture(is_big, has_nanoseconds);
      capture.add(kTime_ns, 2368, kPayload);
      PcapReader reader = open(capture.bytes);

      const auto found = reader.next();

      ASSERT_TRUE(found);
      EXPECT_EQ(found->time_ns, kTime_ns);
      EXPECT_EQ(found->source, 0xc0a801c9U);
      EXPECT_EQ(found->port, 2368);
      EXPECT_EQ(std::vector(found->payload.begin(), found->payload.end()), kPayload);
      EXPECT_FALSE(reader.next());
      EXPECT_EQ(reader.damage(), "");
    }
  }
}

TEST_F(PcapTest, OtherTrafficIsPassedOver) {
  Capture capture;
  std::string arp = Capture::frame_of(2368, kPayload);
  arp[13] = '\x06';
  std::string tcp = Capture::frame_of(2368, kPayload);
  tcp[23] = '\x06';
  std::string longer = Capture::frame_of(2368, kPayload);
  longer[39] = '\x7f';
  capture.add_frame(kTime_ns, arp);
  capture.add_frame(kTime_ns, tcp);
  capture.add_frame(kTime_ns, longer);
  capture.add_frame(kTime_ns, Capture::frame_of(2368, kPayload, 0x2000));
  capture.add_frame(kTime_ns, "short");
  capture.add_frame(kTime_ns, "");
  capture.add_frame(kTime_ns, Capture::frame_of(8308, kPayload, 0, true));
  PcapReader reader = open(capture.bytes);

  const auto found = reader.next();

  ASSERT_TRUE(found);
  EXPECT_EQ(found->port, 8308);
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.others(), 6);
}

TEST_F(PcapTest, AFileThatIsCutIsReadUntilThere) {
  Capture capture;
  capture.add(kTime_ns, 2368, kPayload);
  const std::size_t whole = capture.bytes.size();
  capture.add(kTime_ns, 2368, kPayload);
  for (std::size_t size = whole + 1; size < capture.bytes.size(); ++size) {
    PcapReader reader = open(capture.bytes.substr(0, size));

    EXPECT_TRUE(reader.next());
    EXPECT_FALSE(reader.next());
    EXPECT_NE(reader.damage().find("pcap: byte "), std::string::npos);
    EXPECT_NE(reader.damage().find("expected "), std::string::npos);
  }
}

TEST_F(PcapTest, OtherFilesAreRefusedWithWhatTheyAre) {
  EXPECT_NE(refusal("").find("expected a capture file of at least 24 bytes, found 0"),
            std::string::npos);
  EXPECT_NE(refusal(std::string(40, 'x')).find("found 78787878"), std::string::npos);
  EXPECT_NE(refusal("\x0a\x0d\x0d\x0a" + std::string(40, 'x')).find("pcapng"), std::string::npos);
  EXPECT_NE(refusal(Capture(false, false, 113).bytes).find("found 113"), std::string::npos);
}

}  // namespace
}  // namespace ads::velodyne
