#include "common/dbc.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "common/files.h"

namespace ads {
namespace {

constexpr std::size_t kLargestPayload = 64;  // of CAN FD, in bytes
constexpr std::uint32_t kExtendedFlag = 0x8000'0000U;

// The integer of `bit_count` bits that is closest to `value`, as bits.
std::uint64_t nearest_raw(double value, std::size_t bit_count, bool is_signed) {
  const double rounded = std::nearbyint(value);
  const std::uint64_t ones = ~std::uint64_t{0} >> (64 - bit_count);
  if (!is_signed) {
    if (rounded <= 0.0) {
      return 0;
    }
    return rounded < std::ldexp(1.0, static_cast<int>(bit_count))
               ? static_cast<std::uint64_t>(rounded)
               : ones;
  }
  const double limit = std::ldexp(1.0, static_cast<int>(bit_count) - 1);
  if (rounded >= limit) {
    return ones >> 1U;
  }
  return rounded <= -limit ? std::uint64_t{1} << (bit_count - 1)
                           : static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded)) & ones;
}

// The bit after (below) `bit` of a Motorola signal: down within a byte, then on to the next byte.
std::size_t next_lower_bit(std::size_t bit) {
  return bit % 8 == 0 ? bit + 15 : bit - 1;
}

// One line, read from left to right.
class LineReader {
 public:
  LineReader(std::string_view line, std::string place) : line_(line), place_(std::move(place)) {}

  bool accept(char wanted) {
    skip_space();
    if (at_ == line_.size() || line_[at_] != wanted) {
      return false;
    }
    ++at_;
    return true;
  }

  void take(char wanted) {
    if (!accept(wanted)) {
      fail(fmt::format("'{}'", wanted));
    }
  }

  std::string_view word() {
    skip_space();
    const std::size_t begin = at_;
    while (at_ < line_.size() && !is_space(line_[at_]) && line_[at_] != ':') {
      ++at_;
    }
    if (at_ == begin) {
      fail("a name");
    }
    return line_.substr(begin, at_ - begin);
  }

  std::string_view quoted() {
    take('"');
    const std::size_t end = line_.find('"', at_);
    if (end == std::string_view::npos) {
      fail("a closing quote");
    }
    const std::string_view inside = line_.substr(at_, end - at_);
    at_ = end + 1;
    return inside;
  }

  template <typename Number>
  Number number(std::string_view expected) {
    skip_space();
    accept('+');
    Number value{};
    const char* const end = line_.data() + line_.size();
    const auto [after, error] = std::from_chars(line_.data() + at_, end, value);
    if (error != std::errc()) {
      fail(expected);
    }
    at_ = static_cast<std::size_t>(after - line_.data());
    return value;
  }

  [[nodiscard]] const std::string& place() const { return place_; }

  [[noreturn]] void fail(std::string_view expected) const {
    const std::string_view rest = line_.substr(std::min(at_, line_.size())).substr(0, 40);
    throw std::runtime_error(fmt::format("{}: expected {}, found '{}'", place_, expected, rest));
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  void skip_space() {
    while (at_ < line_.size() && is_space(line_[at_])) {
      ++at_;
    }
  }

  std::string_view line_;
  std::string place_;
  std::size_t at_ = 0;
};

// BO_ 36 KINEMATICS: 8 XXX
DbcMessage read_message(LineReader& line) {
  DbcMessage message;
  const auto id = line.number<std::uint32_t>("a message's identifier");
  message.is_extended = (id & kExtendedFlag) != 0;
  message.address = id & ~kExtendedFlag;
  message.name = line.word();
  line.take(':');
  message.byte_count = line.number<std::size_t>("a message's length in bytes");
  if (message.byte_count > kLargestPayload) {
    line.fail(fmt::format("a length of at most {} bytes", kLargestPayload));
  }
  return message;
}

// SG_ ACCEL_Y : 33|10@0+ (0.03589,-18.375) [0|65535] "m/s^2" XXX
DbcSignal read_signal(LineReader& line) {
  DbcSignal signal;
  signal.name = line.word();
  if (!line.accept(':')) {
    line.word();  // M or m0: the signal is multiplexed
    line.take(':');
  }
  signal.start_bit = line.number<std::size_t>("a start bit");
  line.take('|');
  signal.bit_count = line.number<std::size_t>("a count of bits");
  if (signal.start_bit >= kLargestPayload * 8 || signal.bit_count < 1 || signal.bit_count > 64) {
    line.fail("a start bit below 512 and 1 to 64 bits before");
  }
  line.take('@');
  signal.is_big_endian = line.accept('0');
  if (!signal.is_big_endian) {
    line.take('1');
  }
  signal.is_signed = line.accept('-');
  if (!signal.is_signed) {
    line.take('+');
  }
  line.take('(');
  signal.factor = line.number<double>("a factor");
  line.take(',');
  signal.offset = line.number<double>("an offset");
  line.take(')');
  if (!std::isfinite(signal.factor) || !std::isfinite(signal.offset)) {
    line.fail("a finite factor and offset before");
  }
  line.take('[');
  line.number<double>("a minimum");
  line.take('|');
  line.number<double>("a maximum");
  line.take(']');
  signal.unit = line.quoted();
  return signal;
}

std::string_view first_word(std::string_view line) {
  const std::size_t begin = std::min(line.find_first_not_of(" \t"), line.size());
  return line.substr(begin, line.find_first_of(" \t\r", begin) - begin);
}

}  // namespace

std::size_t DbcSignal::byte_count() const {
  if (!is_big_endian) {
    return (start_bit + bit_count - 1) / 8 + 1;
  }
  const std::size_t bits_after_first_byte = bit_count - std::min(bit_count, start_bit % 8 + 1);
  return start_bit / 8 + 1 + (bits_after_first_byte + 7) / 8;
}

double DbcSignal::decode(std::span<const std::uint8_t> payload) const {
  std::uint64_t raw = 0;
  std::size_t bit = is_big_endian ? start_bit : start_bit + bit_count - 1;
  for (std::size_t count = 0; count < bit_count; ++count) {
    raw = raw << 1U | ((static_cast<unsigned>(payload[bit / 8]) >> (bit % 8)) & 1U);
    bit = is_big_endian ? next_lower_bit(bit) : bit - 1;
  }
  if (!is_signed) {
    return static_cast<double>(raw) * factor + offset;
  }
  const std::size_t unused = 64 - bit_count;
  const auto value = static_cast<std::int64_t>(raw << unused) >> unused;
  return static_cast<double>(value) * factor + offset;
}

void DbcSignal::encode(double value, std::span<std::uint8_t> payload) const {
  const std::uint64_t raw = nearest_raw((value - offset) / factor, bit_count, is_signed);
  std::size_t bit = is_big_endian ? start_bit : start_bit + bit_count - 1;
  for (std::size_t left = bit_count; left > 0; --left) {
    const auto mask = static_cast<std::uint8_t>(1U << (bit % 8));
    if (((raw >> (left - 1)) & 1U) != 0) {
      payload[bit / 8] |= mask;
    } else {
      payload[bit / 8] &= static_cast<std::uint8_t>(~mask);
    }
    bit = is_big_endian ? next_lower_bit(bit) : bit - 1;
  }
}

const DbcSignal& DbcMessage::signal(std::string_view wanted) const {
  const auto found = std::ranges::find(signals, wanted, &DbcSignal::name);
  if (found == signals.end()) {
    throw std::runtime_error(
        fmt::format("{}: expected a signal {} in the message {}, found none of that name", place,
                    wanted, name));
  }
  if (found->byte_count() > byte_count) {
    throw std::runtime_error(fmt::format(
        "{}: expected {} to fit into the {} bytes of the message {}, found that it needs {}", place,
        wanted, byte_count, name, found->byte_count()));
  }
  return *found;
}

Dbc Dbc::parse(std::string_view text, std::string_view name) {
  Dbc dbc(name);
  std::set<std::string, std::less<>> names;
  bool is_inside_quotes = false;
  std::size_t number = 0;
  while (!text.empty()) {
    const std::string_view raw_line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(raw_line.size() + 1, text.size()));
    ++number;
    const std::string_view keyword = is_inside_quotes ? std::string_view() : first_word(raw_line);
    if (keyword != "BO_" && keyword != "SG_") {
      // A comment may have several lines, and any of them may look like a message.
      is_inside_quotes ^= std::ranges::count(raw_line, '"') % 2 != 0;
      continue;
    }
    LineReader line(raw_line.substr(raw_line.find(keyword) + keyword.size()),
                    fmt::format("{}:{}", name, number));
    if (keyword == "BO_") {
      dbc.messages_.push_back(read_message(line));
      dbc.messages_.back().place = line.place();
      if (!names.insert(dbc.messages_.back().name).second) {
        line.fail(fmt::format("no second message {}", dbc.messages_.back().name));
      }
    } else if (dbc.messages_.empty()) {
      line.fail("a message (BO_) before its signals");
    } else {
      dbc.messages_.back().signals.push_back(read_signal(line));
    }
  }
  return dbc;
}

Dbc Dbc::read(const std::filesystem::path& file) {
  return parse(read_file(file), file.string());
}

const DbcMessage& Dbc::message(std::string_view wanted) const {
  const auto found = std::ranges::find(messages_, wanted, &DbcMessage::name);
  if (found == messages_.end()) {
    throw std::runtime_error(
        fmt::format("{}: expected a message {}, found none of that name", name_, wanted));
  }
  return *found;
}

double si_per_unit(std::string_view unit) {
  if (unit == "km/h" || unit == "kph") {
    return 1.0 / 3.6;
  }
  if (unit == "mph") {
    return 0.44704;
  }
  if (unit == "m" || unit == "m/s" || unit == "rad" || unit == "rad/s") {
    return 1.0;
  }
  if (unit == "deg" || unit == "deg/s") {
    return std::numbers::pi / 180.0;
  }
  throw std::runtime_error(
      fmt::format("expected a unit of length, speed or angle, found '{}'", unit));
}

}  // namespace ads
