// What a reader must do with a file in which something is wrong: say so, or find the right content.
// Never anything else. The address sanitizer checks this in the preset `asan`.

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mcap/test_file.h"

namespace fastcycle::mcap {
namespace {

using ::testing::SizeIs;

/// Damage with which the sizes of a small file remain small.
constexpr ReadOptions kSmall{
    .limits = {.record_bytes = std::uint64_t{16} << 20U, .chunk_bytes = std::uint64_t{16} << 20U}};

std::optional<Lines> indexed_or_error(const std::string& file, const ReadOptions& options) {
  try {
    return indexed(file, {}, options);
  } catch (const Damage&) {
    return {};
  }
}

class Corruption : public ::testing::TestWithParam<WriterOptions> {
 protected:
  /// Calls `look(damaged file, place)` for each way to change a byte.
  template <typename Look>
  void for_each_change(const Look& look) {
    const std::string good = drive(GetParam());
    for (std::size_t at = 0; at < good.size(); ++at) {
      for (const int change : {0x01, 0x80, 0xFF}) {
        std::string file = good;
        file[at] = static_cast<char>(file[at] ^ change);
        look(file, at);
      }
    }
  }
};

WriterOptions unchunked() {
  WriterOptions options = small_chunks();
  options.chunked = false;
  return options;
}

INSTANTIATE_TEST_SUITE_P(Kinds, Corruption,
                         ::testing::Values(small_chunks(), small_chunks(Compression::kLz4),
                                           small_chunks(Compression::kZstd), unchunked(),
                                           without_summary(small_chunks())));

TEST_P(Corruption, OfAnyByteIsFoundByWhoReadsEverything) {
  for_each_change([](const std::string& file, std::size_t at) {
    const Streamed read = stream(file, kSmall);

    EXPECT_NE(read.stop.reason, Stop::Reason::kEnd) << "byte " << at;
  });
}

TEST_P(Corruption, OfAnyByteGivesTheRightMessagesOrAnErrorByTheIndex) {
  const Lines expected = indexed(drive(GetParam()));
  ASSERT_THAT(expected, SizeIs(12));

  for_each_change([&](const std::string& file, std::size_t at) {
    const std::optional<Lines> found = indexed_or_error(file, kSmall);

    if (found) {
      EXPECT_EQ(*found, expected) << "byte " << at;
    }
  });
}

TEST_P(Corruption, OfAnyByteIsSurvivedWithoutCrcs) {
  ReadOptions options = kSmall;
  options.check_crcs = false;

  for_each_change([&](const std::string& file, std::size_t /*at*/) {
    (void)stream(file, options);
    (void)indexed_or_error(file, options);
  });
}

TEST_P(Corruption, OfAnyByteLetsReadingGoOnToAnEnd) {
  for_each_change([](const std::string& file, std::size_t at) {
    const MemorySource source(bytes_of(file));
    RecordReader reader(source, kSmall);
    std::size_t rounds = 0;
    do {
      while (reader.next()) {
      }
    } while (reader.resume() && ++rounds < 1000);

    EXPECT_LT(rounds, 1000U) << "byte " << at;
  });
}

/// Each field of eight bytes, wherever it may be, says the most extreme things.
TEST_P(Corruption, ByExtremeNumbersAnywhereIsSurvived) {
  const std::string good = drive(without_crcs(GetParam()));
  for (std::size_t at = kMagic.size(); at + 8 <= good.size() - kMagic.size(); ++at) {
    for (const std::uint64_t number :
         {std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0} - 9, std::uint64_t{1} << 63U,
          std::uint64_t{1} << 32U, std::uint64_t{good.size()}}) {
      const std::string file = with(good, at, number);
      (void)stream(file, kSmall);
      (void)indexed_or_error(file, kSmall);
    }
  }
}

/// A few bytes of zstd that stand for many.
std::string bomb(std::size_t size) {
  const std::string zeroes(size, '\0');
  const Bytes part = bytes_of(zeroes);
  std::vector<std::byte> compressed;
  Compressor().compress(Compression::kZstd, 19, {&part, 1}, compressed);
  return std::string(text_of(compressed));
}

TEST(Hostile, CompressionBombsAreLimited) {
  const std::string compressed = bomb(std::size_t{64} << 20U);
  ASSERT_LT(compressed.size(), 10'000U);
  const ReadOptions options{.limits = {.chunk_bytes = std::uint64_t{1} << 20U}};
  const auto file = [&](std::uint64_t claim) {
    return file_of(chunk_around(compressed, {.uncompressed_size = claim, .compression = "zstd"}));
  };

  // That it says what it becomes does not help it; that it says less neither.
  for (const std::uint64_t claim :
       {std::uint64_t{64} << 20U, std::uint64_t{1} << 20U, std::uint64_t{0}, std::uint64_t{1}}) {
    EXPECT_EQ(stream(file(claim), options).stop.reason, Stop::Reason::kDamaged) << claim;
    EXPECT_FALSE(indexed_or_error(file(claim), options)) << claim;
  }
}

TEST(Hostile, ManyTinyRecordsAreReadOneByOne) {
  std::string records;
  for (int i = 0; i < 100'000; ++i) {
    records += raw_record(0x90, "");
  }

  EXPECT_EQ(stream(file_of(records)).stop.reason, Stop::Reason::kEnd);
  EXPECT_EQ(indexed(file_of(records)), Lines{});
}

TEST(Hostile, MessageShorterThanItsFieldsIsDamage) {
  for (std::size_t size = 0; size < kMessageHeadBytes; ++size) {
    const std::string file = file_of(encoded(kCamera) + raw_record(0x05, std::string(size, '\2')));

    EXPECT_EQ(stream(file).stop.reason, Stop::Reason::kDamaged) << size;
    EXPECT_FALSE(indexed_or_error(file, {})) << size;
  }
}

TEST(Hostile, KeyTwiceInAMapIsDamage) {
  const std::string entry = std::string("\1\0\0\0a\1\0\0\0b", 10);
  const auto metadata = [&](const std::string& entries) {
    std::string content(4, '\0');
    content += static_cast<char>(entries.size()) + std::string(3, '\0') + entries;
    return file_of(raw_record(0x0C, content));
  };

  EXPECT_EQ(stream(metadata(entry)).stop.reason, Stop::Reason::kEnd);
  EXPECT_EQ(stream(metadata(entry + entry)).stop.reason, Stop::Reason::kDamaged);
  EXPECT_EQ(stream(metadata(entry + entry.substr(0, 7))).stop.reason, Stop::Reason::kDamaged);
}

}  // namespace
}  // namespace fastcycle::mcap
