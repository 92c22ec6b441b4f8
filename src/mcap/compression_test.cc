#include "mcap/compression.h"

#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::mcap {
namespace {

std::string noise(std::size_t size) {
  std::mt19937 random(1);
  std::string text(size, '\0');
  for (char& character : text) {
    character = static_cast<char>(random());
  }
  return text;
}

class Compressions : public ::testing::TestWithParam<Compression> {
 protected:
  std::vector<std::byte> compressed(const std::vector<std::string>& texts, int level = 0) {
    std::vector<Bytes> parts;
    for (const std::string& text : texts) {
      parts.push_back(bytes_of(text));
    }
    std::vector<std::byte> result;
    compressor_.compress(GetParam(), level, parts, result);
    return result;
  }

  /// What is wrong, or else the text.
  std::string decompressed(Bytes bytes, std::size_t size) {
    std::vector<std::byte> result(size);
    const std::optional<std::string> found = decompressor_.decompress(GetParam(), bytes, result);
    return found ? "wrong: " + *found : std::string(text_of(result));
  }

  bool is_wrong(Bytes bytes, std::size_t size) {
    return decompressed(bytes, size).starts_with("wrong: ");
  }

  Compressor compressor_;
  Decompressor decompressor_;
};

INSTANTIATE_TEST_SUITE_P(All, Compressions,
                         ::testing::Values(Compression::kNone, Compression::kLz4,
                                           Compression::kZstd));

/// Those that change the bytes.
class RealCompressions : public Compressions {};

INSTANTIATE_TEST_SUITE_P(All, RealCompressions,
                         ::testing::Values(Compression::kLz4, Compression::kZstd));

TEST_P(Compressions, PartsComeBackAsOne) {
  const std::vector<std::vector<std::string>> cases{
      {}, {""}, {"a"}, {"abc", "", "def"}, {noise(300'000), std::string(700'000, 'x'), noise(1)}};
  for (const auto& texts : cases) {
    std::string all;
    for (const std::string& text : texts) {
      all += text;
    }

    const std::vector<std::byte> bytes = compressed(texts);

    EXPECT_EQ(decompressed(bytes, all.size()), all);
  }
}

TEST_P(Compressions, EveryLevelIsTaken) {
  for (const int level : {-200, -5, 0, 1, 9, 12, 22, 99}) {
    EXPECT_EQ(decompressed(compressed({"message message message"}, level), 23),
              "message message message");
  }
}

TEST_P(Compressions, WhatRepeatsBecomesSmall) {
  const std::size_t size = compressed({std::string(100'000, 'x')}).size();

  EXPECT_TRUE(GetParam() == Compression::kNone ? size == 100'000 : size < 1'000) << size;
}

TEST_P(Compressions, NothingIsRefusedThatCanBe) {
  const std::vector<std::byte> bytes = compressed({std::string(50'000'000, 'x')});

  EXPECT_TRUE(can_become(GetParam(), bytes.size(), 50'000'000)) << bytes.size();
}

TEST_P(RealCompressions, AnotherSizeThanClaimedIsFound) {
  const std::vector<std::byte> bytes = compressed({std::string(1000, 'x')});

  EXPECT_TRUE(is_wrong(bytes, 999));
  EXPECT_TRUE(is_wrong(bytes, 1001));
  EXPECT_TRUE(is_wrong(bytes, 0));
  EXPECT_EQ(decompressed(bytes, 1000), std::string(1000, 'x'));
}

TEST_P(RealCompressions, MissingAndSuperfluousBytesAreFound) {
  std::vector<std::byte> bytes = compressed({std::string(1000, 'x')});

  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_TRUE(is_wrong(Bytes(bytes).first(size), 1000)) << size;
  }
  bytes.push_back(std::byte{1});
  EXPECT_TRUE(is_wrong(bytes, 1000));
}

TEST(Compression, NamesAreThoseOfTheFormat) {
  EXPECT_EQ(find_compression(""), Compression::kNone);
  EXPECT_EQ(find_compression("lz4"), Compression::kLz4);
  EXPECT_EQ(find_compression("zstd"), Compression::kZstd);
  EXPECT_EQ(find_compression("LZ4"), std::nullopt);
}

TEST(Compression, ClaimsThatNoCompressionReachesAreRefused) {
  EXPECT_FALSE(can_become(Compression::kNone, 10, 11));
  EXPECT_FALSE(can_become(Compression::kLz4, 100, 100 * 300));
  EXPECT_FALSE(can_become(Compression::kZstd, 100, 100 * 40'000));
  EXPECT_FALSE(can_become(Compression::kZstd, 100, ~std::uint64_t{0}));
}

}  // namespace
}  // namespace fastcycle::mcap
