#include "page.h"

namespace fastcycle::tool {

std::string_view page_html() {
  return {};
}

std::string_view live_page_html() {
  return {};
}

std::string_view page_view() {
  return {};
}

}  // namespace fastcycle::tool
