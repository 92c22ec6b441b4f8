#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::config {

/// Edit distance with insertions, deletions, replacements and swaps of neighbours. Above `limit`
/// the result is some number above it, computed faster.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b,
                                        std::size_t limit = std::string_view::npos);

/// The name among `known` that was probably meant by `name`: at most a third of its letters differ.
/// Empty if there is none; the first one if several are as near.
[[nodiscard]] std::string nearest(std::string_view name, const std::vector<std::string>& known);

/// `did you mean "name"?`, or all known names if none is near.
[[nodiscard]] std::string name_hint(std::string_view name, const std::vector<std::string>& known);

}  // namespace fastcycle::config
