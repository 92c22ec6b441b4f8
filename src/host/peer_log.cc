#include "host/peer_log.h"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/own_names.h"
#include "component/time_driver.h"

namespace fastcycle::host {

using detail::LogQueue;
using detail::LogSource;
using nlohmann::json;

namespace {

constexpr std::int64_t kWindowNs = 100'000'000;

std::string to_text(const LogSource::Kept& line) {
  return json{base::to_ns(line.time), static_cast<int>(line.level), line.component, line.text}.dump(
      -1, ' ', false, json::error_handler_t::replace);
}

/// None if it is no line: the sending process may be broken.
std::optional<LogSource::Kept> line_from(const std::string& text) {
  try {
    const json said = json::parse(text);
    const int level = said.at(1);
    if (level < static_cast<int>(LogLevel::kDebug) || level > static_cast<int>(LogLevel::kError)) {
      return std::nullopt;
    }
    return LogSource::Kept{.time = base::from_ns(said.at(0)),
                           .level = static_cast<LogLevel>(level),
                           .component = said.at(2),
                           .text = said.at(3).get<std::string>().substr(0, LogQueue::kTextBytes)};
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

void PeerLog::begin() {
  if (application_.peers()->is_main()) {
    return;
  }
  is_sending_ = true;
  if (!application_.time().is_simulated()) {
    application_.log_queue().set_listener(this,
                                          [this](const detail::LogLine& line) { send_live(line); });
    return;
  }
  is_sending_ = application_.peers()->is_wanted(kLogTopic);
  if (is_sending_) {
    application_.own_log().keep();
    for (const auto& component : application_.components()) {
      component->log_source.keep();
    }
  }
}

void PeerLog::end() {
  application_.log_queue().set_listener(this, {});
}

void PeerLog::send_live(const detail::LogLine& line) {
  const std::int64_t now_ns = base::monotonic_ns();
  if (now_ns >= window_end_ns_) {
    window_end_ns_ = now_ns + kWindowNs;
    count_ = 0;
  }
  if (count_ == kMostLines) {
    ++lost_;
    return;
  }
  ++count_;
  LogSource::AllKept kept;
  kept.lines.push_back({.time = line.time,
                        .level = line.level,
                        .component = std::string(line.component),
                        .text = std::string(line.text)});
  kept.lost = std::exchange(lost_, 0);
  const auto& all = application_.components();
  const auto found = std::ranges::find(
      all, line.component, [](const auto& core) { return std::string_view(core->name); });
  send(static_cast<std::uint32_t>(found - all.begin()), kept);
}

void PeerLog::send_round() {
  if (!is_sending_) {
    return;
  }
  const auto& all = application_.components();
  // Lines of no component have the last number; the publisher of lines has an order of its own.
  send(static_cast<std::uint32_t>(all.size()), application_.own_log().take_kept());
  for (const auto& component : all) {
    send(component->index, component->log_source.take_kept());
  }
}

void PeerLog::send(std::uint32_t component, const LogSource::AllKept& kept) {
  if (kept.lost > 0) {
    const LogSource::Kept line{
        .time = application_.clock().now(),
        .level = LogLevel::kWarning,
        .component = std::string(LogQueue::kOwnName),
        .text = fmt::format("{} lines of a process are left out: it writes too many", kept.lost)};
    application_.peers()->send_notice(Notice::Kind::kLine, component, to_text(line));
  }
  for (const LogSource::Kept& line : kept.lines) {
    application_.peers()->send_notice(Notice::Kind::kLine, component, to_text(line));
  }
}

void PeerLog::take(const Notice& notice) {
  if (notice.kind != Notice::Kind::kLine || !application_.peers()->is_main() ||
      application_.peers()->is_here(notice.process)) {
    return;
  }
  auto line = line_from(notice.text);
  if (!line) {
    return;
  }
  application_.log_queue().notify(
      {.time = line->time, .level = line->level, .component = line->component, .text = line->text});
  if (application_.time().is_simulated()) {
    const auto& all = application_.components();
    auto& source =
        notice.component < all.size() ? all[notice.component]->log_source : application_.own_log();
    source.keep_line(std::move(*line));
  }
}

}  // namespace fastcycle::host
