#pragma once

#include <string_view>

namespace fastcycle::base {

/// Whether `name`, of a topic or a component, is one that `pattern` means: `*` stands for any
/// characters of one level and `?` for one of them; `**` as a whole level for any number of levels,
/// none included; everything else for itself.
///
///     control/speed        control/*        camera/**        **/status
///
/// Takes time as the product of both lengths at most.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view name);

}  // namespace fastcycle::base
