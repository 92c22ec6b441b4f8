#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::config {

/// How many letters must be put in, left out, replaced or swapped with their neighbour to turn one
/// name into the other. Above `limit` the result is only some number above it, sooner found.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b,
                                        std::size_t limit = std::string_view::npos);

/// The name among `known` that `name` was probably meant to be: at most a third of its letters
/// differ. Empty if there is none; the first one if several are as near.
[[nodiscard]] std::string nearest(std::string_view name, const std::vector<std::string>& known);

/// `did you mean "name"?`, or all that is known where no name is near.
[[nodiscard]] std::string name_hint(std::string_view name, const std::vector<std::string>& known);

}  // namespace fastcycle::config
