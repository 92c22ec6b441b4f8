#include "option_values.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <CLI/TypeTools.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duration.h"

namespace fastcycle::tool {
namespace {

std::string unless(bool is_right, const std::string& wanted, const std::string& text) {
  return is_right ? std::string() : fmt::format("expects {}, found \"{}\"", wanted, text);
}

}  // namespace

std::optional<double> parse_number(const std::string& text) {
  double number = 0.0;
  return CLI::detail::lexical_cast(text, number) && std::isfinite(number) ? std::optional(number)
                                                                          : std::nullopt;
}

ValueCheck is_time() {
  return [](const std::string& text) {
    return unless(parse_duration(text).has_value(),
                  "a time above zero with its unit, as 500ms or 10s", text);
  };
}

ValueCheck is_above_zero() {
  return [](const std::string& text) {
    return unless(parse_number(text).value_or(0.0) > 0.0, "a number above zero", text);
  };
}

ValueCheck is_number_from(double min, double max) {
  return [=](const std::string& text) {
    const auto number = parse_number(text);
    return unless(number && *number >= min && *number <= max,
                  fmt::format("a number from {} to {}", min, max), text);
  };
}

ValueCheck is_one_of(std::vector<std::string> words) {
  return [words = std::move(words)](const std::string& text) {
    return unless(std::ranges::find(words, text) != words.end(),
                  fmt::format("one of {}", fmt::join(words, ", ")), text);
  };
}

}  // namespace fastcycle::tool
