#include "drive_page.h"

#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/html.h"
#include "config/parse.h"
#include "config/problem.h"
#include "page.h"
#include "print.h"

namespace fastcycle::tool {

DriveView DriveView::read(const std::filesystem::path& path) {
  if (path.empty()) {
    return {.text = std::string(page_view()), .name = "its own view"};
  }
  config::Problems problems;
  std::optional<std::string> text = config::read_file(path, {}, problems);
  if (!text) {
    throw std::runtime_error(problems.all().front().message);
  }
  return {.text = *std::move(text), .name = path.string()};
}

bool has_drive_page(const std::string& command) {
  if (page_html().empty()) {
    print_to(stderr,
             "fastcycle {}: this program was built without its page, because node or the packages\n"
             "of tools/page/package.json were missing (./dev setup, then ./dev build)\n",
             command);
    return false;
  }
  return true;
}

void write_drive_page(const std::string& title, std::string_view data, mcap::Sink& sink) {
  constexpr std::string_view kTitle = "%TITLE%";
  constexpr std::string_view kData = "%DATA%";
  const std::string_view page = page_html();
  const std::size_t title_at = page.find(kTitle);
  const std::size_t data_at = page.find(kData);
  const std::string html_title = base::to_html(title);
  for (const std::string_view part :
       {page.substr(0, title_at), std::string_view(html_title),
        page.substr(title_at + kTitle.size(), data_at - title_at - kTitle.size()), data,
        page.substr(data_at + kData.size())}) {
    const mcap::Bytes bytes = mcap::bytes_of(part);
    sink.append({&bytes, 1});
  }
}

}  // namespace fastcycle::tool
