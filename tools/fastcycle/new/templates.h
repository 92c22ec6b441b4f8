#pragma once

#include <span>

namespace fastcycle::tool {

/// One file of templates/: what `fastcycle new <kind>` writes, with %placeholders% in name and
/// text.
struct Template {
  const char* kind;  ///< "app", "component" or "messages".
  const char* path;  ///< In the project.
  const char* text;
};

[[nodiscard]] std::span<const Template> templates();

}  // namespace fastcycle::tool
