#include "host/peer_dumps.h"

#include <algorithm>
#include <exception>
#include <string>

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"

namespace fastcycle::host {

using nlohmann::json;

namespace {

constexpr std::int64_t kTenthNs = 100'000'000;

}  // namespace

bool PeerDumps::ask(std::string_view reason, std::string_view component,
                    std::string_view detail) noexcept {
  const std::int64_t window = base::to_ns(application_.clock().now()) / kTenthNs;
  if (window_.exchange(window, std::memory_order_relaxed) != window) {
    count_.store(0, std::memory_order_relaxed);
  }
  if (count_.fetch_add(1, std::memory_order_relaxed) >= kMost) {
    return false;
  }
  try {
    const auto& all = application_.components();
    const auto found = std::ranges::find(
        all, component, [](const auto& core) { return std::string_view(core->name); });
    if (found == all.end()) {
      return false;
    }
    application_.peers()->send_notice(
        Notice::Kind::kDumpAsked, static_cast<std::uint32_t>(found - all.begin()),
        json{reason, detail}.dump(-1, ' ', false, json::error_handler_t::replace));
    return true;
  } catch (const std::exception&) {  // No memory, or a text that is too long.
    return false;
  }
}

void PeerDumps::take(const Notice& notice) {
  if (notice.kind != Notice::Kind::kDumpAsked || !application_.peers()->is_main() ||
      application_.peers()->is_here(notice.process) ||
      notice.component >= application_.components().size()) {
    return;
  }
  const std::string& name = application_.components()[notice.component]->name;
  if (application_.peers()->process_of(name) != notice.process) {
    return;  // The sending process may be broken.
  }
  try {
    const json asked = json::parse(notice.text);
    application_.dump(asked.at(0).get<std::string>(), name, asked.at(1).get<std::string>());
  } catch (const json::exception&) {
    return;
  }
}

}  // namespace fastcycle::host
