#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace ads {

/// A table of numbers read from a .npy file. An array of shape (n,) is a table of one column.
///
/// @threads  Compatible.
class NumberTable {
 public:
  NumberTable(std::size_t rows, std::size_t columns, std::vector<double> values)
      : rows_(rows), columns_(columns), values_(std::move(values)) {}

  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] std::size_t columns() const { return columns_; }

  /// @pre `row < rows()`, `column < columns()`
  [[nodiscard]] double at(std::size_t row, std::size_t column) const {
    return values_[row * columns_ + column];
  }
  /// All values, row by row.
  [[nodiscard]] const std::vector<double>& values() const { return values_; }

 private:
  std::size_t rows_;
  std::size_t columns_;
  std::vector<double> values_;
};

/// Rows of bytes of one width.
struct ByteTable {
  std::size_t width = 0;
  std::vector<std::uint8_t> bytes;

  [[nodiscard]] std::size_t rows() const { return bytes.size() / width; }
};

/// Reads a NumPy array file (NumPy Enhancement Proposal 1, "A Simple File Format for NumPy Arrays",
/// versions 1.0 to 3.0): float64 numbers of the shape (n, `columns`), or (n,) for one column.
///
/// @errors  Each of these functions throws `std::runtime_error` with the file, expected and found:
///          for a missing file, other content, type or shape, or fewer or more bytes than the shape
///          requires. No content makes them read outside the file or allocate more than its size.
NumberTable read_npy_numbers(const std::filesystem::path& file, std::size_t columns);

/// Reads int64 numbers of the shape (n,).
std::vector<std::int64_t> read_npy_integers(const std::filesystem::path& file);

/// Reads byte strings of `width` bytes each, of the shape (n,).
ByteTable read_npy_bytes(const std::filesystem::path& file, std::size_t width);

/// The same for the `content` of a file; `name` is used in error messages.
NumberTable parse_npy_numbers(std::string_view content, std::string_view name, std::size_t columns);
std::vector<std::int64_t> parse_npy_integers(std::string_view content, std::string_view name);
ByteTable parse_npy_bytes(std::string_view content, std::string_view name, std::size_t width);

}  // namespace ads
