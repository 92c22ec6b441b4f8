#include "common/xml.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace ads {
namespace {

[[noreturn]] void fail_at(const XmlElement::File& file, std::ptrdiff_t offset,
                          std::string_view expected, std::string_view found) {
  const auto end = std::clamp<std::ptrdiff_t>(offset, 0, std::ssize(file.text));
  throw std::runtime_error(
      fmt::format("{}:{}: expected {}, found {}", file.name,
                  1 + std::ranges::count(file.text.substr(0, static_cast<std::size_t>(end)), '\n'),
                  expected, found));
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const std::size_t begin = std::min(text.find_first_not_of(kSpace), text.size());
  return text.substr(begin, text.find_last_not_of(kSpace) + 1 - begin);
}

std::optional<XmlElement> XmlElement::find(const char* child) const {
  const pugi::xml_node found = node_.child(child);
  return found.empty() ? std::nullopt : std::optional<XmlElement>({*file_, found});
}

XmlElement XmlElement::get(const char* child) const {
  const auto found = find(child);
  if (!found) {
    fail(fmt::format("<{}> in <{}>", child, name()), "none");
  }
  return *found;
}

std::vector<XmlElement> XmlElement::all(const char* child) const {
  std::vector<XmlElement> elements;
  for (const pugi::xml_node node : node_.children(child)) {
    elements.emplace_back(*file_, node);
  }
  return elements;
}

std::vector<XmlElement> XmlElement::children() const {
  std::vector<XmlElement> elements;
  for (const pugi::xml_node node : node_.children()) {
    if (node.type() == pugi::node_element) {
      elements.emplace_back(*file_, node);
    }
  }
  return elements;
}

std::optional<std::string_view> XmlElement::find_attribute(const char* attribute) const {
  const pugi::xml_attribute found = node_.attribute(attribute);
  return found.empty() ? std::nullopt : std::optional<std::string_view>(found.value());
}

std::string_view XmlElement::attribute(const char* wanted) const {
  const auto found = find_attribute(wanted);
  if (!found) {
    fail(fmt::format("an attribute {} of <{}>", wanted, name()), "none");
  }
  return *found;
}

void XmlElement::fail(std::string_view expected, std::string_view found) const {
  fail_at(*file_, node_.offset_debug(), expected, found);
}

std::string XmlElement::quoted(std::string_view text) {
  return fmt::format("'{}'", text.substr(0, 40));
}

XmlFile::XmlFile(std::string_view text, std::string_view name) : file_{.text = text, .name = name} {
  const pugi::xml_parse_result result =
      document_.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!result) {
    fail_at(file_, result.offset, "XML", result.description());
  }
}

}  // namespace ads
