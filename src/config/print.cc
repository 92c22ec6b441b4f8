#include "config/print.h"

#include <algorithm>

#include "base/printable.h"
#include "config/variables.h"

namespace fastcycle::config {

namespace {

/// Writes the tree line by line, each with the place of its value behind it.
class Printer {
 public:
  std::string print(const Value& value) {
    write("", value, "");
    return std::move(text_);
  }

 private:
  void write(const std::string& key, const Value& value, const std::string& comma) {
    if (is_one_line(value)) {
      line(key + compact(value) + comma, value);
      return;
    }
    line(key + (value.is_array() ? "[" : "{"), value);
    ++depth_;
    if (value.is_array()) {
      for (const Value& item : value.items()) {
        write("", item, &item == &value.items().back() ? "" : ",");
      }
    } else {
      for (const auto& member : value.members()) {
        write(compact_text(member.key) + ": ", member.value,
              &member == &value.members().back() ? "" : ",");
      }
    }
    --depth_;
    text_ += indent() + (value.is_array() ? "]" : "}") + comma + '\n';
  }

  // A list of numbers or words from one line of a file stays on one line.
  static bool is_one_line(const Value& value) {
    if (value.is_object() || !value.is_array()) {
      return value.size() == 0;
    }
    return std::ranges::all_of(value.items(), [&](const Value& item) {
      return !item.is_array() && !item.is_object() && item.source() == value.source() &&
             item.origin().line == value.origin().line;
    });
  }

  static std::string compact(const Value& value) {
    if (value.is_string()) {
      return compact_text(escape_variables(value.as_string()));
    }
    if (!value.is_array()) {
      return value.to_text();
    }
    std::string result = "[";
    for (const Value& item : value.items()) {
      result += (&item == &value.items().front() ? "" : ", ") + compact(item);
    }
    return result + "]";
  }

  static std::string compact_text(const std::string& text) { return Value(text, {}).to_text(); }

  void line(const std::string& content, const Value& value) {
    Place place = value.place();
    place.pointer.clear();
    // A file may have any name, but a comment may not have any bytes.
    const std::string where = base::printable(to_string(place));
    text_ += indent() + content + (where.empty() ? "" : "  // " + where) + '\n';
  }

  [[nodiscard]] std::string indent() const { return std::string(2 * depth_, ' '); }

  std::string text_;
  std::size_t depth_ = 0;
};

}  // namespace

std::string print(const Value& value) {
  return Printer().print(value);
}

}  // namespace fastcycle::config
