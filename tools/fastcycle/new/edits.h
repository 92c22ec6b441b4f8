#pragma once

#include <optional>
#include <string>

namespace fastcycle::tool {

/// The name in project(NAME …) of a CMakeLists.txt.
[[nodiscard]] std::optional<std::string> project_of(const std::string& cmake);

/// The first file that fastcycle_application(FILE …) names.
[[nodiscard]] std::optional<std::string> application_of(const std::string& cmake);

/// `cmake` with `call` on the lines after its last call of `function`. Without one, before its
/// first call of `otherwise_before`; without that either, at the end.
[[nodiscard]] std::string with_call(const std::string& cmake, const std::string& function,
                                    const std::string& call, const std::string& otherwise_before);

/// An application file with one more component, a JSON object, at the end of "components"; layout
/// and comments are preserved. None if it has no such list.
[[nodiscard]] std::optional<std::string> with_component(const std::string& application,
                                                        const std::string& component);

}  // namespace fastcycle::tool
