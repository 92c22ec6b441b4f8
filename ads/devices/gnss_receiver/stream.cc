#include "stream.h"

#include <charconv>
#include <utility>

#include <fmt/format.h>

namespace ads::gnss_stream {
namespace {

// NMEA 0183 allows 82 characters; receivers send longer ones with more digits.
constexpr std::size_t kSentenceMax = 128;
// The longest that is of use here has 92; some that report satellites have several hundred.
constexpr std::size_t kContentMax = 2048;
constexpr std::size_t kFrameHeader = 6;
constexpr std::size_t kFrameBytes = kFrameHeader + 2;
constexpr char kSync1 = '\xb5';
constexpr char kSync2 = '\x62';

std::uint8_t byte_at(std::string_view bytes, std::size_t index) {
  return static_cast<std::uint8_t>(bytes[index]);
}

std::uint8_t sentence_checksum(std::string_view body) {
  std::uint8_t sum = 0;
  for (const char character : body) {
    sum ^= static_cast<std::uint8_t>(character);
  }
  return sum;
}

// Fletcher's, over everything between the first two and the last two bytes.
std::pair<std::uint8_t, std::uint8_t> frame_checksum(std::string_view bytes) {
  std::uint8_t a = 0;
  std::uint8_t b = 0;
  for (const char byte : bytes) {
    a = static_cast<std::uint8_t>(a + static_cast<std::uint8_t>(byte));
    b = static_cast<std::uint8_t>(b + a);
  }
  return {a, b};
}

}  // namespace

void StreamParser::take(std::string_view bytes) {
  buffer_ += bytes;
  std::size_t at = 0;
  while (at < buffer_.size()) {
    const std::size_t done = step(std::string_view(buffer_).substr(at));
    if (done == 0) {
      break;
    }
    at += done;
  }
  buffer_.erase(0, at);
}

std::size_t StreamParser::leave_out(std::size_t bytes) {
  counts_.bytes_left_out += static_cast<std::int64_t>(bytes);
  return bytes;
}

std::size_t StreamParser::step(std::string_view rest) {
  if (rest.front() == '$') {
    return take_sentence(rest);
  }
  if (rest.front() == kSync1) {
    return take_frame(rest);
  }
  const bool is_line_end = rest.front() == '\r' || rest.front() == '\n';
  return is_line_end ? 1 : leave_out(1);
}

std::size_t StreamParser::take_sentence(std::string_view rest) {
  std::size_t end = 1;
  while (end < rest.size() && rest[end] >= ' ' && rest[end] <= '~' && rest[end] != '$') {
    ++end;
  }
  if (end > kSentenceMax) {
    return leave_out(1);
  }
  if (end == rest.size()) {
    return 0;
  }
  const std::string_view line = rest.substr(1, end - 1);
  if ((rest[end] != '\r' && rest[end] != '\n') || line.size() < 4 || line[line.size() - 3] != '*') {
    return leave_out(end);  // Another begins, or what is no text.
  }
  const std::string_view body = line.substr(0, line.size() - 3);
  unsigned expected = 0;
  const char* const last = line.data() + line.size();
  const auto read = std::from_chars(last - 2, last, expected, 16);
  if (read.ptr != last || expected != sentence_checksum(body)) {
    ++counts_.wrong_checksums;
    return leave_out(end);
  }
  ++counts_.sentences;
  on_sentence_(body);
  return end;
}

std::size_t StreamParser::take_frame(std::string_view rest) {
  if (rest.size() < 2) {
    return 0;
  }
  if (rest[1] != kSync2) {
    return leave_out(1);
  }
  if (rest.size() < kFrameHeader) {
    return 0;
  }
  const std::size_t size = byte_at(rest, 4) | std::size_t{byte_at(rest, 5)} << 8;
  if (size > kContentMax) {
    return leave_out(1);
  }
  if (rest.size() < kFrameBytes + size) {
    return 0;
  }
  const auto [a, b] = frame_checksum(rest.substr(2, kFrameHeader - 2 + size));
  if (a != byte_at(rest, kFrameHeader + size) || b != byte_at(rest, kFrameHeader + size + 1)) {
    // Its length may be the damaged part: parsing continues within it.
    ++counts_.wrong_checksums;
    return leave_out(1);
  }
  ++counts_.frames;
  const auto* const content = reinterpret_cast<const std::uint8_t*>(rest.data() + kFrameHeader);
  on_frame_(byte_at(rest, 2), byte_at(rest, 3), {content, size});
  return kFrameBytes + size;
}

std::string encode_sentence(std::string_view body) {
  return fmt::format("${}*{:02X}\r\n", body, sentence_checksum(body));
}

std::string encode_frame(std::uint8_t message_class, std::uint8_t message,
                         std::string_view content) {
  std::string checked{static_cast<char>(message_class), static_cast<char>(message),
                      static_cast<char>(content.size()), static_cast<char>(content.size() >> 8)};
  checked += content;
  const auto [a, b] = frame_checksum(checked);
  std::string frame{kSync1, kSync2};
  frame += checked;
  frame.push_back(static_cast<char>(a));
  frame.push_back(static_cast<char>(b));
  return frame;
}

}  // namespace ads::gnss_stream
