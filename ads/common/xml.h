#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

#include <fmt/format.h>
#include <pugixml.hpp>

namespace ads {

/// `text` without leading and trailing white space.
std::string_view trimmed(std::string_view text);

/// An element of an XML file, which can report its line. Valid as long as its `XmlFile`.
///
/// @errors  On unexpected content throws `std::runtime_error` with file, line, expected and found.
/// @threads Compatible.
class XmlElement {
 public:
  /// Larger than any distance on Earth; sums and squares of such numbers stay exact enough.
  static constexpr double kLargestNumber = 1e8;

  /// Shared by all elements of a file.
  struct File {
    std::string_view text;
    std::string_view name;
  };

  XmlElement(const File& file, pugi::xml_node node) : file_(&file), node_(node) {}

  [[nodiscard]] std::string_view name() const { return node_.name(); }
  [[nodiscard]] bool has(const char* child) const { return !node_.child(child).empty(); }
  [[nodiscard]] std::optional<XmlElement> find(const char* child) const;
  [[nodiscard]] XmlElement get(const char* child) const;
  [[nodiscard]] std::vector<XmlElement> all(const char* child) const;
  /// All elements in it.
  [[nodiscard]] std::vector<XmlElement> children() const;

  [[nodiscard]] std::string_view text() const { return trimmed(node_.text().get()); }
  [[nodiscard]] std::optional<std::string_view> find_attribute(const char* attribute) const;
  [[nodiscard]] std::string_view attribute(const char* wanted) const;

  /// Floating-point numbers are limited to `kLargestNumber`.
  template <typename Number>
  [[nodiscard]] Number number() const {
    return number_of<Number>(text(), fmt::format("in <{}>", name()));
  }
  template <typename Number>
  [[nodiscard]] Number number_attribute(const char* wanted) const {
    return number_of<Number>(trimmed(attribute(wanted)),
                             fmt::format("as {} of <{}>", wanted, name()));
  }
  template <typename Number>
  [[nodiscard]] Number number_attribute(const char* wanted, Number fallback) const {
    return find_attribute(wanted) ? number_attribute<Number>(wanted) : fallback;
  }

  [[noreturn]] void fail(std::string_view expected, std::string_view found) const;

  /// `text` as quoted in messages: at most 40 characters of it.
  static std::string quoted(std::string_view text);

 private:
  template <typename Number>
  [[nodiscard]] Number number_of(std::string_view text, std::string_view where) const {
    Number value{};
    const std::string_view digits = text.substr(text.starts_with('+') ? 1 : 0);
    const auto [after, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const bool is_number = error == std::errc() && after == digits.data() + digits.size();
    if constexpr (std::is_floating_point_v<Number>) {
      if (!is_number || !(std::abs(value) <= kLargestNumber)) {
        fail(fmt::format("a number of at most {:g} {}", kLargestNumber, where), quoted(text));
      }
    } else if (!is_number) {
      fail(fmt::format("an integer {}", where), quoted(text));
    }
    return value;
  }

  const File* file_;
  pugi::xml_node node_;
};

/// A parsed XML file. `text` and `name` must outlive it.
class XmlFile {
 public:
  /// @errors  Throws `std::runtime_error` with the line if it is not XML.
  XmlFile(std::string_view text, std::string_view name);
  XmlFile(const XmlFile&) = delete;
  XmlFile& operator=(const XmlFile&) = delete;

  [[nodiscard]] XmlElement root() const { return {file_, document_.document_element()}; }

 private:
  XmlElement::File file_;
  pugi::xml_document document_;
};

}  // namespace ads
