#include <memory>
#include <string>

#include "command.h"
#include "duration.h"
#include "file_work.h"
#include "quantity.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

struct SplitOptions {
  Rewriting work;
  std::string size;
  std::string time;
};

int split(SplitOptions& options) {
  const std::optional<std::uint64_t> bytes = parse_bytes(options.size);
  const std::optional<Duration> time = parse_duration(options.time);
  if (options.size.empty() && options.time.empty()) {
    return print_error("split", "expects --size or --time, or both");
  }
  if (!options.size.empty() && !bytes) {
    return print_error(
        "split", "--size expects a size with its unit, as 100MB, and not \"" + options.size + "\"");
  }
  if (!options.time.empty() && !time) {
    return print_error(
        "split", "--time expects a time with its unit, as 60s, and not \"" + options.time + "\"");
  }
  options.work.layout.piece = {.bytes = bytes.value_or(0),
                               .time_ns = time ? static_cast<std::uint64_t>(time->count()) : 0};
  return options.work.run();
}

}  // namespace

Command add_split(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("split", "Split a log by size or time into self-contained logs");
  line->footer(examples(
      "  fastcycle split drive.mcap parts/drive --time 60s\n"
      "  fastcycle split drive.mcap parts/drive --size 100MB\n"
      "\n"
      "The files are parts/drive_0001.mcap and so on; merge restores the original log.\n"));
  const auto options = std::make_shared<SplitOptions>();
  Rewriting& work = options->work;
  work.command = "split";
  work.inputs.resize(1);
  line->add_option("in", work.inputs[0], "The log")->required()->type_name("IN");
  line->add_option("prefix", work.output, "Prefix of the file names")
      ->required()
      ->type_name("OUT_PREFIX");
  line->add_option("--size", options->size, "Maximum size of a file: 100MB")->type_name("SIZE");
  line->add_option("--time", options->time, "Maximum duration of a file, by log time: 60s")
      ->type_name("TIME");
  work.add_options(*line);
  return {line, [options] { return split(*options); }};
}

}  // namespace fastcycle::tool
