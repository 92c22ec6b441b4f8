#pragma once

#include <span>

namespace fastcycle::tool {

/// One file of templates/, which `fastcycle new <kind>` writes, with %placeholders% in path and
/// text.
struct Template {
  const char* kind;  ///< "app", "component" or "messages".
  const char* path;  ///< In the project.
  const char* text;
};

[[nodiscard]] std::span<const Template> templates();

}  // namespace fastcycle::tool
