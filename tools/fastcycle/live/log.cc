#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "archive/message_text.h"
#include "base/log_level.h"
#include "command.h"
#include "live/session.h"
#include "live/text.h"
#include "option_values.h"
#include "print.h"
#include "quantity.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct LogOptions {
  Target target;
  std::string level;
  std::string component;
  std::optional<std::uint64_t> count;
};

std::string text_of(const protocol::LogLine& line) {
  const std::string time = utc_text(static_cast<std::uint64_t>(line.time_ns()));
  const std::string who = line.component().empty() ? "fastcycle" : line.component();
  return fmt::format("{}  {:<7}  {}: {}\n", time.substr(0, time.find('.') + 7), line.level(),
                     archive::printable(who), archive::printable(line.text()));
}

Json json_of_line(const protocol::LogLine& line) {
  return {{"time_ns", line.time_ns()},
          {"level", line.level()},
          {"component", line.component()},
          {"text", line.text()}};
}

int log(const LogOptions& options) {
  Session session(options.target, "log");
  if (!options.component.empty()) {
    require_known(options.component, names_of_components(session.overview()), "component");
  }
  protocol::Request request;
  request.mutable_stream_log()->set_level(options.level);
  request.mutable_stream_log()->set_component(options.component);
  Output output;
  Streams streams(session);
  streams.begin(std::move(request));
  std::uint64_t left = options.count.value_or(UINT64_MAX);
  streams.follow(output, [&](const protocol::Answer* answer) {
    if (answer == nullptr || !answer->has_log()) {
      return true;
    }
    if (answer->log().lost() > 0) {
      print_to(stderr, "fastcycle log: {} exceeded the rate at which they can be sent\n",
               count_text(answer->log().lost(), "line"));
    }
    for (const protocol::LogLine& line : answer->log().lines()) {
      const std::string text =
          options.target.is_json ? json_line(json_of_line(line)) : text_of(line);
      if (!output.write(text) || --left == 0) {
        return false;
      }
    }
    return true;
  });
  output.flush();
  return kDone;
}

}  // namespace
}  // namespace live

Command add_log(CLI::App& program) {
  CLI::App* line = program.add_subcommand("log", "Print the log of a running application");
  line->footer(
      examples("  fastcycle log\n"
               "  fastcycle log --level warning\n"
               "  fastcycle log --component planner --json | jq -r .text\n"
               "\n"
               "Ctrl-C ends it.\n"));
  const auto options = std::make_shared<live::LogOptions>();
  line->add_option("--level", options->level, "Minimum level")
      ->check(is_one_of({detail::kLogLevelWords.begin(), detail::kLogLevelWords.end()}))
      ->type_name("debug|info|warning|error");
  line->add_option("--component", options->component, "Only lines of this component")
      ->type_name("COMPONENT");
  line->add_option("--count", options->count, "End after this number of lines")
      ->check(is_above_zero())
      ->type_name("N");
  options->target.add_to(*line, "Print one JSON object per line");
  return {line, [options] { return live::guarded("log", [&] { return live::log(*options); }); }};
}

}  // namespace fastcycle::tool
