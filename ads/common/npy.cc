#include "common/npy.h"

#include <bit>
#include <cstring>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "common/files.h"

namespace ads {
namespace {

static_assert(std::endian::native == std::endian::little, "the data files are little-endian");

constexpr std::string_view kMagic = "\x93NUMPY";

struct Array {
  std::string_view type;
  std::vector<std::size_t> shape;
  bool is_column_major = false;
  std::string_view bytes;
};

[[noreturn]] void fail(std::string_view name, std::string_view expected, std::string_view found) {
  throw std::runtime_error(fmt::format("{}: expected {}, found {}", name, expected, found));
}

// The header is a Python dictionary. This reads the part of Python that NumPy writes.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, std::string_view name) : text_(text), name_(name) {}

  void read_into(Array& array) {
    bool has_type = false;
    bool has_order = false;
    bool has_shape = false;
    take('{');
    while (!accept('}')) {
      const std::string_view key = quoted();
      take(':');
      if (key == "descr") {
        array.type = quoted();
        has_type = true;
      } else if (key == "fortran_order") {
        array.is_column_major = boolean();
        has_order = true;
      } else if (key == "shape") {
        array.shape = tuple();
        has_shape = true;
      } else {
        fail(name_, "a header with descr, fortran_order and shape", fmt::format("'{}'", key));
      }
      if (!accept(',')) {
        take('}');
        break;
      }
    }
    if (!has_type || !has_order || !has_shape) {
      fail(name_, "a header with descr, fortran_order and shape", "fewer keys");
    }
  }

 private:
  void skip_space() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) {
      ++at_;
    }
  }

  bool accept(char wanted) {
    skip_space();
    if (at_ == text_.size() || text_[at_] != wanted) {
      return false;
    }
    ++at_;
    return true;
  }

  void take(char wanted) {
    if (!accept(wanted)) {
      const std::string found = at_ < text_.size() ? fmt::format("'{}'", text_[at_]) : "its end";
      fail(name_, fmt::format("'{}' at byte {} of the header's dictionary", wanted, at_), found);
    }
  }

  std::string_view quoted() {
    skip_space();
    const char quote = at_ < text_.size() && text_[at_] == '"' ? '"' : '\'';
    take(quote);
    const std::size_t end = text_.find(quote, at_);
    if (end == std::string_view::npos) {
      fail(name_, "a quoted text in the header", "no closing quote");
    }
    const std::string_view inside = text_.substr(at_, end - at_);
    at_ = end + 1;
    return inside;
  }

  bool boolean() {
    skip_space();
    for (const std::string_view word : {"True", "False"}) {
      if (text_.substr(at_).starts_with(word)) {
        at_ += word.size();
        return word == "True";
      }
    }
    fail(name_, "fortran_order to be True or False", "something else");
  }

  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> numbers;
    take('(');
    while (!accept(')')) {
      numbers.push_back(number());
      if (!accept(',')) {
        take(')');
        break;
      }
    }
    return numbers;
  }

  std::size_t number() {
    skip_space();
    constexpr std::size_t kLargest = std::size_t{1} << 40;
    std::size_t value = 0;
    const std::size_t begin = at_;
    while (at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9' && value < kLargest) {
      value = value * 10 + static_cast<std::size_t>(text_[at_] - '0');
      ++at_;
    }
    if (at_ == begin || value >= kLargest) {
      fail(name_, "a count in the header's shape", "none, or one that is too large");
    }
    return value;
  }

  std::string_view text_;
  std::string_view name_;
  std::size_t at_ = 0;
};

std::size_t little_endian(std::string_view bytes) {
  std::size_t value = 0;
  for (std::size_t index = bytes.size(); index > 0; --index) {
    value = value << 8U | static_cast<unsigned char>(bytes[index - 1]);
  }
  return value;
}

Array parse(std::string_view content, std::string_view name) {
  if (!content.starts_with(kMagic) || content.size() < kMagic.size() + 2) {
    fail(name, "a .npy file", "other content");
  }
  const unsigned version = static_cast<unsigned char>(content[kMagic.size()]);
  if (version < 1 || version > 3) {
    fail(name, ".npy format 1 to 3", fmt::format("format {}", version));
  }
  const std::size_t length_at = kMagic.size() + 2;
  const std::size_t length_size = version == 1 ? 2 : 4;
  if (content.size() < length_at + length_size) {
    fail(name, "a .npy header", "a file that ends before it");
  }
  const std::size_t header_at = length_at + length_size;
  const std::size_t header_size = little_endian(content.substr(length_at, length_size));
  if (header_size > content.size() - header_at) {
    fail(name, fmt::format("a header of {} bytes", header_size), "a file that ends before it");
  }
  Array array;
  HeaderReader(content.substr(header_at, header_size), name).read_into(array);
  array.bytes = content.substr(header_at + header_size);
  return array;
}

std::string shape_text(const std::vector<std::size_t>& shape) {
  return fmt::format("({}{})", fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
}

// The rows of an array whose type and shape are as wanted and whose bytes are all there.
std::size_t checked_rows(const Array& array, std::string_view name, std::string_view type,
                         std::size_t item_size, std::size_t columns) {
  if (array.type != type) {
    fail(name, fmt::format("values of type {}", type), array.type);
  }
  const bool fits =
      columns == 1 ? array.shape.size() == 1 || (array.shape.size() == 2 && array.shape[1] == 1)
                   : array.shape.size() == 2 && array.shape[1] == columns;
  if (!fits) {
    const std::string wanted = columns == 1 ? "(n,)" : fmt::format("(n, {})", columns);
    fail(name, fmt::format("an array of the shape {}", wanted), shape_text(array.shape));
  }
  const std::size_t rows = array.shape[0];
  const std::size_t row_size = item_size * columns;
  if (array.bytes.size() % row_size != 0 || array.bytes.size() / row_size != rows) {
    fail(name, fmt::format("{} rows of {} bytes", rows, row_size),
         fmt::format("{} bytes", array.bytes.size()));
  }
  return rows;
}

template <typename Number>
std::vector<Number> numbers_of(std::string_view bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  if (!numbers.empty()) {
    std::memcpy(numbers.data(), bytes.data(), bytes.size());
  }
  return numbers;
}

std::vector<double> row_major(const std::vector<double>& columns_first, std::size_t rows,
                              std::size_t columns) {
  std::vector<double> values(columns_first.size());
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      values[row * columns + column] = columns_first[column * rows + row];
    }
  }
  return values;
}

}  // namespace

NumberTable parse_npy_numbers(std::string_view content, std::string_view name,
                              std::size_t columns) {
  const Array array = parse(content, name);
  const std::size_t rows = checked_rows(array, name, "<f8", sizeof(double), columns);
  std::vector<double> values = numbers_of<double>(array.bytes);
  if (array.is_column_major) {
    values = row_major(values, rows, columns);
  }
  return {rows, columns, std::move(values)};
}

std::vector<std::int64_t> parse_npy_integers(std::string_view content, std::string_view name) {
  const Array array = parse(content, name);
  checked_rows(array, name, "<i8", sizeof(std::int64_t), 1);
  return numbers_of<std::int64_t>(array.bytes);
}

ByteTable parse_npy_bytes(std::string_view content, std::string_view name, std::size_t width) {
  const Array array = parse(content, name);
  checked_rows(array, name, fmt::format("|S{}", width), width, 1);
  return {.width = width, .bytes = numbers_of<std::uint8_t>(array.bytes)};
}

NumberTable read_npy_numbers(const std::filesystem::path& file, std::size_t columns) {
  return parse_npy_numbers(read_file(file), file.string(), columns);
}

std::vector<std::int64_t> read_npy_integers(const std::filesystem::path& file) {
  return parse_npy_integers(read_file(file), file.string());
}

ByteTable read_npy_bytes(const std::filesystem::path& file, std::size_t width) {
  return parse_npy_bytes(read_file(file), file.string(), width);
}

}  // namespace ads
