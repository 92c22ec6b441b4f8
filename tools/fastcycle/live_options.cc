#include "live_options.h"

#include <charconv>
#include <cstdint>
#include <string_view>

namespace fastcycle::tool {
namespace {

/// An address and a port, each of which may be missing: "127.0.0.1:8765", "[::1]:0", ":9000",
/// "9000", "127.0.0.1".
struct Place {
  std::string address;
  std::optional<std::uint16_t> port;
};

std::optional<Place> read_place(std::string_view text) {
  Place place;
  std::string_view port;
  if (text.starts_with('[')) {
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos || (end + 1 < text.size() && text[end + 1] != ':')) {
      return std::nullopt;
    }
    place.address = text.substr(1, end - 1);
    port = end + 1 < text.size() ? text.substr(end + 2) : std::string_view();
  } else if (const std::size_t colon = text.find(':'); colon != std::string_view::npos) {
    place.address = text.substr(0, colon);
    port = text.substr(colon + 1);
  } else if (text.find('.') == std::string_view::npos) {
    port = text;
  } else {
    place.address = text;
  }
  if (!port.empty()) {
    std::uint16_t number = 0;
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
    if (error != std::errc() || end != port.data() + port.size()) {
      return std::nullopt;
    }
    place.port = number;
  }
  return place;
}

}  // namespace

void LiveOptions::add_to(CLI::App& line) {
  line.add_option_function<std::vector<std::string>>(
          "--live",
          [this](const std::vector<std::string>& values) {
            is_asked = true;
            at = values.empty() ? std::string() : values.front();
          },
          "Serve live data to browsers and Foxglove (127.0.0.1:8765)")
      ->type_name("[ADDRESS:PORT]")
      ->expected(0, 1)
      ->default_str("");
}

std::string LiveOptions::find_wrong() const {
  if (!read_place(at)) {
    return "--live expects an address and a port of this machine, as 127.0.0.1:8765, and not \"" +
           at + "\"";
  }
  return {};
}

std::optional<config::LiveDescription> LiveOptions::describe(
    const config::ApplicationDescription& application) const {
  if (!is_asked && !application.live) {
    return std::nullopt;
  }
  config::LiveDescription description = application.live.value_or(config::LiveDescription{});
  if (!application.live) {
    description.place.file = at.empty() ? "--live" : "--live " + at;
  }
  if (const auto place = read_place(at)) {
    if (!place->address.empty()) {
      description.address = place->address;
    }
    description.port = place->port.value_or(description.port);
  }
  return description;
}

}  // namespace fastcycle::tool
