#include "stream.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fix.h"

namespace ads::gnss_stream {
namespace {

using ::testing::ElementsAre;

struct Received {
  std::vector<std::string> sentences;
  std::vector<std::string> frames;
  StreamParser parser{[this](std::string_view body) { sentences.emplace_back(body); },
                      [this](std::uint8_t, std::uint8_t, std::span<const std::uint8_t> content) {
                        frames.emplace_back(content.begin(), content.end());
                      }};
};

const std::string kSentence =
    "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n";

TEST(Streams, MixedWithGarbageAndCutAnywhereAreReadTheSame) {
  const std::string frame = encode_frame(1, 7, "ab$c\xb5\x62");
  const std::string bytes = "\x01\xb5garbage$GPGGA,12" + kSentence + frame + "\xb5\x62\x01\x07" +
                            kSentence + frame + kSentence + std::string(3000, 'x') + kSentence;
  for (std::size_t step : {std::size_t{1}, std::size_t{7}, bytes.size()}) {
    Received received;
    for (std::size_t at = 0; at < bytes.size(); at += step) {
      received.parser.take(std::string_view(bytes).substr(at, step));
    }

    EXPECT_EQ(received.sentences.size(), 4U);
    EXPECT_THAT(received.frames, ElementsAre("ab$c\xb5\x62", "ab$c\xb5\x62"));
  }
}

TEST(Streams, WithWrongChecksumsAreLeftOutAndCounted) {
  std::string sentence = kSentence;
  sentence[10] = '9';
  std::string frame = encode_frame(1, 7, "content");
  frame[8] = 'X';
  Received received;

  received.parser.take(sentence + frame + encode_frame(1, 7, "right"));

  EXPECT_TRUE(received.sentences.empty());
  EXPECT_THAT(received.frames, ElementsAre("right"));
  EXPECT_EQ(received.parser.counts().wrong_checksums, 2);
  EXPECT_GT(received.parser.counts().bytes_left_out, 0);
}

TEST(Streams, OfASentenceWithoutAnEndDoNotGrow) {
  Received received;

  received.parser.take("$" + std::string(10'000, 'A'));
  received.parser.take(kSentence);

  EXPECT_EQ(received.sentences.size(), 1U);
}

TEST(Fixes, OfNmeaHaveThePlaceTheTimeAndTheAccuracy) {
  FixReader reader(3.0);

  const auto without =
      reader.take_sentence("GPGGA,123519.50,4807.038,N,01131.000,W,1,08,0.9,545.4,M,46.9,M,,");
  EXPECT_FALSE(reader.take_sentence("GPGST,123520,,,,,0.6,0.8,1.2"));
  const auto with =
      reader.take_sentence("GNGGA,123520,4807.038,S,01131.000,E,4,08,0.9,545.4,M,46.9,M,,");

  ASSERT_TRUE(without && with);
  EXPECT_NEAR(without->position.latitude_deg, 48.0 + 7.038 / 60.0, 1e-12);
  EXPECT_NEAR(without->position.longitude_deg, -(11.0 + 31.0 / 60.0), 1e-12);
  EXPECT_NEAR(without->position.altitude_m, 592.3, 1e-9);
  EXPECT_NEAR(*without->second_of_day, 45'319.5, 1e-9);
  EXPECT_NEAR(without->stddev_m, 2.7, 1e-9);
  EXPECT_LT(with->position.latitude_deg, 0.0);
  EXPECT_NEAR(with->stddev_m, std::sqrt(0.5), 1e-9);
}

TEST(Fixes, ComeFromTheBestSourceThatThereIs) {
  FixReader reader(3.0);
  const std::string rmc = "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W";
  const std::string gga = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,";
  const GnssFix fix{.position = {.latitude_deg = 1.0, .longitude_deg = 2.0},
                    .stddev_m = 0.5,
                    .second_of_day = 3.25};
  const auto take_pvt = [&] {
    std::optional<GnssFix> taken;
    StreamParser parser([](std::string_view) {},
                        [&](std::uint8_t message_class, std::uint8_t message,
                            std::span<const std::uint8_t> content) {
                          taken = reader.take_frame(message_class, message, content);
                        });
    parser.take(encode_nav_pvt(fix));
    return taken;
  };

  EXPECT_TRUE(reader.take_sentence(rmc));
  EXPECT_TRUE(reader.take_sentence(gga));
  EXPECT_FALSE(reader.take_sentence(rmc));
  const auto pvt = take_pvt();
  EXPECT_FALSE(reader.take_sentence(gga));

  ASSERT_TRUE(pvt);
  EXPECT_NEAR(pvt->position.latitude_deg, 1.0, 1e-9);
  EXPECT_NEAR(pvt->position.longitude_deg, 2.0, 1e-9);
  EXPECT_NEAR(pvt->stddev_m, 0.5, 1e-3);
  EXPECT_NEAR(*pvt->second_of_day, 3.25, 1e-6);
}

TEST(Fixes, AreNoneWithoutAPositionOrWithWrongFields) {
  FixReader reader(3.0);

  for (const char* const body : {"GPGGA,123519,4807.038,N,01131.000,E,0,00,99.9,,M,,M,,",
                                 "GPGGA,,,,,,0,00,99.99,,,,,,", "GPRMC,123519,V,,,,,,,230394,,"}) {
    EXPECT_FALSE(reader.take_sentence(body)) << body;
  }
  EXPECT_EQ(reader.without_fix(), 3);
  for (const char* const body :
       {"GPGGA,123519", "GPGGA,123519,9907.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4867.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,4807.038,X,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,12x519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        "GPGGA,123519,nan,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"}) {
    EXPECT_FALSE(reader.take_sentence(body)) << body;
  }
  EXPECT_EQ(reader.malformed(), 6);
  EXPECT_FALSE(reader.take_sentence("PUBX,00"));
  EXPECT_FALSE(reader.take_sentence(""));
}

TEST(Fixes, ThatAreEncodedAreReadAgain) {
  const GnssFix fix{.position = {.latitude_deg = -37.123456789,
                                 .longitude_deg = 122.987654321,
                                 .altitude_m = 12.5},
                    .stddev_m = 0.25,
                    .second_of_day = 86'399.5};
  FixReader reader(3.0);
  std::optional<GnssFix> read;
  StreamParser parser([&](std::string_view body) { read = reader.take_sentence(body); },
                      [](std::uint8_t, std::uint8_t, std::span<const std::uint8_t>) {});

  parser.take(encode_nmea(fix));

  ASSERT_TRUE(read);
  EXPECT_NEAR(read->position.latitude_deg, fix.position.latitude_deg, 2e-9);
  EXPECT_NEAR(read->position.longitude_deg, fix.position.longitude_deg, 2e-9);
  EXPECT_NEAR(read->stddev_m, 0.25, 1e-9);
  EXPECT_NEAR(*read->second_of_day, 86'399.5, 1e-3);
}

}  // namespace
}  // namespace ads::gnss_stream
