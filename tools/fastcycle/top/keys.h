#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::tool::top {

/// One key as it was pressed.
struct Key {
  enum class Kind : std::uint8_t {
    kText,  ///< `text` is the character.
    kEnter,
    kEscape,
    kTab,
    kBackTab,
    kBackspace,
    kUp,
    kDown,
    kLeft,
    kRight,
    kPageUp,
    kPageDown,
    kHome,
    kEnd,
    kOther,  ///< An unknown key.
  };

  Kind kind = Kind::kOther;
  std::string text = {};  ///< One character, UTF-8.

  bool operator==(const Key&) const = default;
};

/// Decodes keys from the bytes that a terminal sends.
///
/// @threads  Confined.
class KeyReader {
 public:
  void add(std::string_view bytes) { bytes_ += bytes; }

  /// The next complete key.
  [[nodiscard]] std::optional<Key> next();

  /// Whether there is an incomplete key. The Escape key sends the byte that begins other sequences:
  /// if nothing follows for some time, `finish` decodes it as a key.
  [[nodiscard]] bool is_within_key() const { return !bytes_.empty(); }
  [[nodiscard]] Key finish();

 private:
  std::string bytes_;
};

}  // namespace fastcycle::tool::top
