#pragma once

#include <string_view>

namespace fastcycle::base {

/// Whether `name`, of a topic or a component, matches `pattern`: `*` stands for any characters of
/// one level and `?` for one of them; `**` as a whole level for any number of levels, none
/// included; everything else for itself.
///
///     control/speed        control/*        camera/**        **/status
///
/// Time: at most the product of both lengths.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view name);

}  // namespace fastcycle::base
