#pragma once

#include <string_view>

namespace fastcycle::tool {

/// The page that shows a drive, of tools/page: HTML with `%TITLE%` and `%DATA%` where they belong.
/// Empty if it could not be made when the program was built.
[[nodiscard]] std::string_view page_html();

/// The page that shows a run, of tools/page/live: HTML that needs nothing but the server that gives
/// it (docs/reference/live_page.md). Empty if it could not be made when the program was built.
[[nodiscard]] std::string_view live_page_html();

/// Which topics and fields they show, if nothing else is asked for: tools/page/ads.json.
[[nodiscard]] std::string_view page_view();

}  // namespace fastcycle::tool
