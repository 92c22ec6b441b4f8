#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::tool {

/// Of `--workers`.
inline constexpr unsigned kMaxWorkers = 64;

/// Returns `expects …, found "…"` for an invalid value of an option; empty if it is valid.
/// For `CLI::Option::check`; the program puts the name of the option before it.
using ValueCheck = std::function<std::string(const std::string&)>;

/// Accepts what `parse_duration` accepts.
[[nodiscard]] ValueCheck is_time();
[[nodiscard]] ValueCheck is_above_zero();
[[nodiscard]] ValueCheck is_number_from(double min, double max);
[[nodiscard]] ValueCheck is_one_of(std::vector<std::string> words);

/// A number as options accept it, integer or not; none if it is not a number.
[[nodiscard]] std::optional<double> parse_number(const std::string& text);

}  // namespace fastcycle::tool
