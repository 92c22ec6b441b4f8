#include "common/npy.h"

#include <cstring>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace ads {
namespace {

std::string array_file(const std::string& dictionary, const std::string& bytes) {
  std::string header = dictionary + "\n";
  std::string file = "\x93NUMPY";
  file += '\x01';
  file += '\0';
  file += static_cast<char>(header.size() % 256);
  file += static_cast<char>(header.size() / 256);
  return file + header + bytes;
}

template <typename Number>
std::string bytes_of(const std::vector<Number>& numbers) {
  std::string bytes(numbers.size() * sizeof(Number), '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

std::string dictionary(const std::string& type, const std::string& shape,
                       const std::string& is_column_major = "False") {
  return "{'descr': '" + type + "', 'fortran_order': " + is_column_major + ", 'shape': " + shape +
         ", }";
}

std::string refusal(const std::string& content, std::size_t columns = 1) {
  try {
    parse_npy_numbers(content, "x.npy", columns);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(Npy, TableIsReadRowByRow) {
  const auto table = parse_npy_numbers(
      array_file(dictionary("<f8", "(2, 3)"), bytes_of<double>({1, 2, 3, 4, 5, 6})), "x.npy", 3);

  EXPECT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.columns(), 3U);
  EXPECT_EQ(table.at(1, 0), 4.0);
}

TEST(Npy, ColumnMajorTableIsTurned) {
  const auto table = parse_npy_numbers(
      array_file(dictionary("<f8", "(2, 3)", "True"), bytes_of<double>({1, 4, 2, 5, 3, 6})),
      "x.npy", 3);

  EXPECT_EQ(table.values(), (std::vector<double>{1, 2, 3, 4, 5, 6}));
}

TEST(Npy, OneColumnMayHaveOneOrTwoDimensions) {
  const std::string bytes = bytes_of<double>({7, 8});

  EXPECT_EQ(parse_npy_numbers(array_file(dictionary("<f8", "(2,)"), bytes), "x.npy", 1).at(1, 0),
            8);
  EXPECT_EQ(parse_npy_numbers(array_file(dictionary("<f8", "(2, 1)"), bytes), "x.npy", 1).rows(),
            2U);
}

TEST(Npy, EmptyArrayHasNoRows) {
  EXPECT_EQ(parse_npy_numbers(array_file(dictionary("<f8", "(0,)"), ""), "x.npy", 1).rows(), 0U);
}

TEST(Npy, IntegersAndByteStringsAreRead) {
  const auto numbers = parse_npy_integers(
      array_file(dictionary("<i8", "(2,)"), bytes_of<std::int64_t>({-1, 528})), "a");
  const auto rows = parse_npy_bytes(array_file(dictionary("|S4", "(2,)"), "abcdefgh"), "b", 4);

  EXPECT_EQ(numbers, (std::vector<std::int64_t>{-1, 528}));
  EXPECT_EQ(rows.rows(), 2U);
  EXPECT_EQ(rows.bytes[4], 'e');
}

TEST(Npy, TruncatedFileIsRefusedWithBothSizes) {
  const std::string message =
      refusal(array_file(dictionary("<f8", "(3,)"), bytes_of<double>({1, 2})));

  EXPECT_EQ(message, "x.npy: expected 3 rows of 8 bytes, found 16 bytes");
}

TEST(Npy, OtherTypeOrShapeIsRefused) {
  const std::string bytes = bytes_of<double>({1, 2});

  EXPECT_EQ(refusal(array_file(dictionary("<f4", "(4,)"), bytes)),
            "x.npy: expected values of type <f8, found <f4");
  EXPECT_EQ(refusal(array_file(dictionary("<f8", "(2,)"), bytes), 3),
            "x.npy: expected an array of the shape (n, 3), found (2,)");
}

TEST(Npy, NoPrefixOfAFileIsAccepted) {
  const std::string whole = array_file(dictionary("<f8", "(2,)"), bytes_of<double>({1, 2}));
  ASSERT_EQ(refusal(whole), "");

  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(refusal(whole.substr(0, size)), "") << size;
  }
}

// Each byte of the header in turn is replaced: what is read then may be right or refused, never
// worse.
TEST(Npy, DamagedHeaderIsReadOrRefused) {
  const std::string whole = array_file(dictionary("<f8", "(2,)"), bytes_of<double>({1, 2}));

  for (std::size_t at = 0; at + 16 < whole.size(); ++at) {
    for (const char byte : {'\0', '\xff', '9', '(', '\'', ','}) {
      std::string damaged = whole;
      damaged[at] = byte;
      refusal(damaged);
    }
  }
}

TEST(Npy, HugeShapeIsRefused) {
  EXPECT_NE(refusal(array_file(dictionary("<f8", "(99999999999999999999,)"), "")), "");
  EXPECT_NE(refusal(array_file(dictionary("<f8", "(1099511627775,)"), "12345678")), "");
}

TEST(Npy, MissingFileIsNamed) {
  try {
    read_npy_numbers("no/such/t.npy", 1);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "no/such/t.npy: expected a file, found none");
  }
}

}  // namespace
}  // namespace ads
