#include "top/keys.h"

#include <cstddef>
#include <utility>

namespace fastcycle::tool::top {
namespace {

using Kind = Key::Kind;

/// Of `ESC [ … final` and `ESC O final`: what xterm, the Linux console, screen and tmux send.
Kind kind_of(std::string_view numbers, char final) {
  switch (final) {
    case 'A':
      return Kind::kUp;
    case 'B':
      return Kind::kDown;
    case 'C':
      return Kind::kRight;
    case 'D':
      return Kind::kLeft;
    case 'H':
      return Kind::kHome;
    case 'F':
      return Kind::kEnd;
    case 'Z':
      return Kind::kBackTab;
    case 'M':
      return Kind::kEnter;
    default:
      break;
  }
  if (final != '~') {
    return Kind::kOther;
  }
  return numbers == "1" || numbers == "7"   ? Kind::kHome
         : numbers == "4" || numbers == "8" ? Kind::kEnd
         : numbers == "5"                   ? Kind::kPageUp
         : numbers == "6"                   ? Kind::kPageDown
                                            : Kind::kOther;
}

Kind kind_of(char byte) {
  switch (byte) {
    case '\r':
    case '\n':
      return Kind::kEnter;
    case '\t':
      return Kind::kTab;
    case '\b':
    case '\x7f':
      return Kind::kBackspace;
    default:
      return static_cast<unsigned char>(byte) < 0x20 ? Kind::kOther : Kind::kText;
  }
}

std::size_t utf8_size(char first) {
  const auto byte = static_cast<unsigned char>(first);
  return byte < 0xc0 ? 1 : byte < 0xe0 ? 2 : byte < 0xf0 ? 3 : 4;
}

}  // namespace

std::optional<Key> KeyReader::next() {
  if (bytes_.empty()) {
    return std::nullopt;
  }
  if (bytes_[0] != '\x1b') {
    const std::size_t size = utf8_size(bytes_[0]);
    if (bytes_.size() < size) {
      return std::nullopt;
    }
    Key key{kind_of(bytes_[0]), {}};
    if (key.kind == Kind::kText) {
      key.text = bytes_.substr(0, size);
    }
    bytes_.erase(0, size);
    return key;
  }
  if (bytes_.size() < 2) {
    return std::nullopt;
  }
  if (bytes_[1] != '[' && bytes_[1] != 'O') {
    bytes_.erase(0, 1);
    return Key{Kind::kEscape, {}};
  }
  const std::size_t final = bytes_.find_first_not_of("0123456789;?<", 2);
  if (final == std::string::npos) {
    return std::nullopt;
  }
  // Parameters after a semicolon encode Shift or Control.
  const std::string_view numbers(bytes_.data() + 2, final - 2);
  const Key key{kind_of(numbers.substr(0, numbers.find(';')), bytes_[final]), {}};
  bytes_.erase(0, final + 1);
  return key;
}

Key KeyReader::finish() {
  const bool is_escape = bytes_ == "\x1b";
  bytes_.clear();
  return {is_escape ? Kind::kEscape : Kind::kOther, {}};
}

}  // namespace fastcycle::tool::top
