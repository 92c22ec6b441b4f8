#include <memory>
#include <optional>
#include <string>

#include "command.h"
#include "file_work.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

struct FilterOptions {
  Rewriting work;
  std::string start;
  std::string end;
};

int filter(FilterOptions& options) {
  archive::Selection& selection = options.work.selection;
  std::optional<std::uint64_t> begin_ns;
  std::string wrong = read_offset("--start", options.start, begin_ns);
  wrong = wrong.empty() ? read_offset("--end", options.end, selection.end_ns) : wrong;
  if (wrong.empty() && selection.end_ns && *selection.end_ns <= begin_ns.value_or(0)) {
    wrong = "--end must be after --start";
  }
  if (!wrong.empty()) {
    return print_error("filter", wrong);
  }
  selection.begin_ns = begin_ns.value_or(0);
  return options.work.run();
}

}  // namespace

Command add_filter(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("filter", "Keep selected topics or a time range of a log");
  line->footer(
      examples("  fastcycle filter drive.mcap control.mcap --topics 'control/*'\n"
               "  fastcycle filter drive.mcap scene.mcap --start 10s --end 15s\n"
               "  fastcycle filter drive.mcap small.mcap --except 'camera/**'\n"));
  const auto options = std::make_shared<FilterOptions>();
  Rewriting& work = options->work;
  work.command = "filter";
  work.inputs.resize(1);
  line->add_option("in", work.inputs[0], "The log")->required()->type_name("IN");
  line->add_option("out", work.output, "The new log")->required()->type_name("OUT");
  line->add_option("--topics", work.selection.topics.topics,
                   "Only topics that match: control/* (one level), camera/** (any). Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line->add_option("--except", work.selection.topics.except, "Omit topics that match. Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line->add_option("--start", options->start, "Start time, from the beginning of the log: 10s")
      ->type_name("TIME");
  line->add_option("--end", options->end, "End time, from the beginning of the log: 15s")
      ->type_name("TIME");
  work.add_options(*line);
  return {line, [options] { return filter(*options); }};
}

}  // namespace fastcycle::tool
