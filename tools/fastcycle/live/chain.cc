#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "archive/message_text.h"
#include "command.h"
#include "live/session.h"
#include "live/text.h"

namespace fastcycle::tool {
namespace live {
namespace {

constexpr const char* kChains = "chains";

struct ChainOptions {
  Target target;
  std::string chain;
};

/// The application's chains, as in its report.
Json chains_of(Session& session) {
  const auto& documents = session.client().welcome().documents();
  if (std::ranges::find(documents, kChains) == documents.end()) {
    return Json::array();
  }
  protocol::Request request;
  request.mutable_document()->set_name(kChains);
  const std::string text = session.client().ask(std::move(request)).document().json();
  Json json = Json::parse(text, nullptr, false);
  if (json.is_object() && json.contains(kChains)) {
    json = Json(json[kChains]);
  }
  if (!json.is_array()) {
    throw Failure(kFailed, "the application sent an unreadable reply about its chains");
  }
  return json;
}

std::string text_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string()
             ? archive::printable(found->get_ref<const std::string&>())
             : std::string();
}

std::uint64_t number_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<std::uint64_t>() : 0;
}

/// `p50`, `p99` or `max` of microseconds; `-` where there are none.
std::string span_in(const Json& json, const char* what, const char* key) {
  const auto summary = json.find(what);
  if (summary == json.end() || !summary->is_object() || !summary->contains(key)) {
    return "-";
  }
  const Json& value = (*summary)[key];
  return value.is_number() ? span_text(value.get<double>() * 1e3) : "-";
}

/// The component that was late, and in which part.
std::string contributor_text(const Json& chain) {
  const auto largest = chain.find("largest_contributor");
  if (largest == chain.end() || !largest->is_object()) {
    return {};
  }
  const std::string part = text_in(*largest, "part");
  return fmt::format("largest contributor: {} of {} are due to {} {}",
                     number_in(*largest, "breaches"), number_in(chain, "breaches"),
                     text_in(*largest, "component"),
                     part == "waiting" ? "waiting for its turn" : "running too long");
}

std::string hops_text(const Json& chain) {
  std::vector<std::vector<std::string>> rows{{"hop", "publishes", "messages", "waiting p50", "p99",
                                              "max", "running p50", "p99", "max", "breaches"}};
  for (const Json& hop : chain.value("hops", Json::array())) {
    const bool has_messages = number_in(hop, "count") > 0;
    const auto span = [&](const char* what, const char* key) {
      return has_messages ? span_in(hop, what, key) : "-";
    };
    const std::string topic = text_in(hop, "topic");
    rows.push_back({text_in(hop, "component"), topic.empty() ? "(the end)" : topic,
                    fmt::format("{}", number_in(hop, "count")), span("waiting_us", "p50"),
                    span("waiting_us", "p99"), span("waiting_us", "max"), span("running_us", "p50"),
                    span("running_us", "p99"), span("running_us", "max"),
                    fmt::format("{}", number_in(hop, "breaches"))});
  }
  return rows.size() > 1 ? table_text(rows, "  ") : "";
}

std::string text_of(const Json& chain) {
  const std::uint64_t count = number_in(chain, "count");
  std::string text = fmt::format("{}: {} to {} within {:g} ms, else {}\n", text_in(chain, "name"),
                                 text_in(chain, "from"), text_in(chain, "to"),
                                 chain.value("deadline_ms", 0.0), text_in(chain, "on_breach"));
  if (count == 0) {
    return text + "  no message has reached its end yet\n";
  }
  text += fmt::format("  age p50 {}, p99 {}, max {} of {}\n", span_in(chain, "age_us", "p50"),
                      span_in(chain, "age_us", "p99"), span_in(chain, "age_us", "max"),
                      count_text(count, "message"));
  const std::uint64_t breaches = number_in(chain, "breaches");
  const std::uint64_t dropped = number_in(chain, "dropped");
  text += breaches == 0
              ? "  no breach\n"
              : fmt::format("  {} too late ({:.3g} %){}\n", breaches,
                            100.0 * static_cast<double>(breaches) / static_cast<double>(count),
                            dropped > 0 ? fmt::format(", {} dropped", dropped) : "");
  if (const std::string contributor = contributor_text(chain); !contributor.empty()) {
    text += "  " + contributor + "\n";
  }
  return text + hops_text(chain);
}

int show(const ChainOptions& options) {
  Session session(options.target, "chain");
  const Json all = chains_of(session);
  std::vector<std::string> names;
  for (const Json& chain : all) {
    names.push_back(text_in(chain, "name"));
  }
  if (!options.chain.empty()) {
    require_known(options.chain, names, "chain");
  }
  Json chosen = Json::array();
  std::string text;
  for (const Json& chain : all) {
    if (options.chain.empty() || text_in(chain, "name") == options.chain) {
      chosen.push_back(chain);
      text += (text.empty() ? "" : "\n") + text_of(chain);
    }
  }
  if (options.target.is_json) {
    return print_json(chosen);
  }
  return print_text(text.empty()
                        ? "The application has no chains; \"chains\" in its file declares them.\n"
                        : text);
}

}  // namespace
}  // namespace live

Command add_chain(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "chain", "Show the latency of chains, hop by hop, and the largest contributor to breaches");
  line->footer(examples(
      "  fastcycle chain\n"
      "  fastcycle chain lidar_to_brake\n"
      "  fastcycle chain --json | jq '.[] | select(.breaches > 0) | .largest_contributor'\n"
      "\n"
      "The wait of a hop lasts from the preceding publish to its callback, its run from there\n"
      "to its own publish.\n"));
  const auto options = std::make_shared<live::ChainOptions>();
  line->add_option("chain", options->chain, "Only this chain")->type_name("CHAIN");
  options->target.add_to(*line);
  return {line, [options] { return live::guarded("chain", [&] { return live::show(*options); }); }};
}

}  // namespace fastcycle::tool
