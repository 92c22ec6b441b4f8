#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::tool {

/// Says what a value of an option should have been, `wants …, found "…"`; empty if it is right.
/// For `CLI::Option::check`; the program puts the name of the option before it.
using ValueCheck = std::function<std::string(const std::string&)>;

/// What `parse_duration` takes.
[[nodiscard]] ValueCheck is_time();
[[nodiscard]] ValueCheck is_above_zero();
[[nodiscard]] ValueCheck is_number_from(double min, double max);
[[nodiscard]] ValueCheck is_one_of(std::vector<std::string> words);

/// A number as options take it, whole or not; none if it is nothing of the kind.
[[nodiscard]] std::optional<double> parse_number(const std::string& text);

}  // namespace fastcycle::tool
