#pragma once

#include <string_view>

namespace fastcycle::tool {

/// The page that shows a drive, from tools/page: HTML with the placeholders `%TITLE%` and `%DATA%`.
/// Empty if it could not be built with the program.
[[nodiscard]] std::string_view page_html();

/// The page that shows a run, from tools/page/live: HTML that needs only the server that delivers
/// it (docs/reference/live_page.md). Empty if it could not be built with the program.
[[nodiscard]] std::string_view live_page_html();

/// The topics and fields that they show by default: tools/page/ads.json.
[[nodiscard]] std::string_view page_view();

}  // namespace fastcycle::tool
