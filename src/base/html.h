#pragma once

#include <string>
#include <string_view>

namespace fastcycle::base {

/// `text` escaped for HTML, between tags or in quotes.
[[nodiscard]] std::string to_html(std::string_view text);

}  // namespace fastcycle::base
