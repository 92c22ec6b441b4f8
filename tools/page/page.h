#pragma once

#include <string_view>

namespace fastcycle::tool {

/// The page that shows a drive, of tools/page: HTML with `%TITLE%` and `%DATA%` where they belong.
/// Empty if it could not be made when the program was built.
[[nodiscard]] std::string_view page_html();

/// Which topics and fields it shows, if nothing else is asked for: tools/page/ads.json.
[[nodiscard]] std::string_view page_view();

}  // namespace fastcycle::tool
