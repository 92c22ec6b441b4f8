#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace fastcycle::tool::top {

/// One key as it was pressed.
struct Key {
  enum class Kind : std::uint8_t {
    kText,  ///< `text` is what it writes.
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
    kOther,  ///< One that nobody here knows.
  };

  Kind kind = Kind::kOther;
  std::string text = {};  ///< One character, UTF-8.

  bool operator==(const Key&) const = default;
};

/// Keys out of the bytes that a terminal sends for them.
///
/// @threads  Confined.
class KeyReader {
 public:
  void add(std::string_view bytes) { bytes_ += bytes; }

  /// The next key that is there as a whole.
  [[nodiscard]] std::optional<Key> next();

  /// Whether there is the beginning of a key. The Escape key sends what others begin with: if
  /// nothing follows for some time, `finish` makes a key of it.
  [[nodiscard]] bool is_within_key() const { return !bytes_.empty(); }
  [[nodiscard]] Key finish();

 private:
  std::string bytes_;
};

}  // namespace fastcycle::tool::top
