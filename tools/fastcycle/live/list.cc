#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command.h"
#include "live/session.h"
#include "live/text.h"
#include "quantity.h"

namespace fastcycle::tool {
namespace live {
namespace {

/// The overview of a running application; none if it does not answer, or has ended in the meantime.
std::optional<protocol::Overview> overview_of(const inspect::RunningApplication& running) {
  try {
    inspect::Client client(running.socket, "fastcycle list");
    protocol::Request request;
    request.mutable_overview()->set_without_topics(true);
    request.mutable_overview()->set_without_components(true);
    return client.ask(std::move(request)).overview();
  } catch (const inspect::ClientError&) {
    return std::nullopt;
  }
}

std::string since_text(const protocol::Overview& overview) {
  if (overview.start_ns() == 0 || overview.clock() != "live") {
    return "-";
  }
  const std::string time = utc_text(static_cast<std::uint64_t>(overview.start_ns()));
  return time.substr(0, time.find('.')) + "Z";
}

std::vector<std::string> row_of(const inspect::RunningApplication& running,
                                const std::optional<protocol::Overview>& overview) {
  const std::string pid = fmt::format("{}", running.pid);
  if (!overview) {
    return {running.name, pid, "-", "does not answer"};
  }
  return {running.name,
          pid,
          overview->mode().empty() ? "-" : overview->mode(),
          uptime_text(uptime_ns(*overview)),
          since_text(*overview),
          overview->file()};
}

Json json_of_running(const inspect::RunningApplication& running,
                     const std::optional<protocol::Overview>& overview) {
  Json json{{"name", running.name},
            {"pid", running.pid},
            {"socket", running.socket.string()},
            {"answers", overview.has_value()}};
  if (overview) {
    json["file"] = overview->file();
    json["clock"] = overview->clock();
    json["mode"] = overview->mode().empty() ? Json() : Json(overview->mode());
    json["uptime_s"] = static_cast<double>(uptime_ns(*overview)) / 1e9;
    json["start_ns"] = overview->start_ns();
  }
  return json;
}

int list_running(const Target& target) {
  std::vector<std::vector<std::string>> rows{{"name", "pid", "mode", "uptime", "since", "file"}};
  Json json = Json::array();
  for (const inspect::RunningApplication& running : inspect::list_applications()) {
    const auto overview = overview_of(running);
    rows.push_back(row_of(running, overview));
    json.push_back(json_of_running(running, overview));
  }
  if (target.is_json) {
    return print_json(json);
  }
  return print_text(rows.size() > 1 ? table_text(rows)
                                    : "No running application can be inspected; start one with: "
                                      "fastcycle run app.json --inspect\n");
}

}  // namespace
}  // namespace live

Command add_list(CLI::App& program) {
  CLI::App* line = program.add_subcommand("list", "List the applications that run with --inspect");
  line->footer(
      examples("  fastcycle list\n"
               "  fastcycle list --json | jq -r '.[].name'\n"));
  const auto target = std::make_shared<live::Target>();
  line->add_flag("--json", target->is_json, "Print one JSON document");
  return {line,
          [target] { return live::guarded("list", [&] { return live::list_running(*target); }); }};
}

}  // namespace fastcycle::tool
