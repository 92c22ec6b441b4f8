#include "live/record.h"

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "command.h"
#include "run.h"

namespace fastcycle::tool {

Command add_record(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("record", "Run an application and record it to an MCAP file");
  line->footer(examples(
      std::string(
          "  fastcycle record app.json\n"
          "  fastcycle record app.json -o drive.mcap --for 10min\n"
          "  fastcycle record app.json --except 'camera/**' --compression zstd\n"
          "  fastcycle record app.json -o drive.mcap --split-mb 1000 --split-s 60\n"
          "  fastcycle record --live -o now.mcap --topics 'control/**' --for 10s\n"
          "\n"
          "An existing file is not overwritten; the next free number is used. --live records\n"
          "a running application that was started with --inspect.\n") +
      kEnds));
  const auto options = std::make_shared<RunOptions>();
  options->command = "record";
  options->record.is_asked = true;
  add_options(*line, *options);
  add_clock_options(*line, *options);
  RecordingOptions& record = options->record;
  line->add_option("-o,--output", record.file,
                   "The output file (that of the application, else NAME_DATE_TIME.mcap)")
      ->type_name("FILE.mcap");
  line->add_option("--topics", record.topics,
                   "Only topics that match: control/*, camera/** (repeatable)")
      ->type_name("PATTERN");
  line->add_option("--except", record.except, "Omit topics that match (repeatable)")
      ->type_name("PATTERN");
  line->add_option("--compression", record.compression,
                   "Compression of the file (that of the application, else lz4)")
      ->type_name("none|lz4|zstd");
  line->add_option("--split-mb", record.split_mb, "Begin a new file before this size is exceeded")
      ->type_name("MB");
  line->add_option("--split-s", record.split_s, "Begin a new file after this time, in seconds")
      ->type_name("S");
  line->get_option("application")->required(false);  // Not with --live: see below.
  const auto is_live = std::make_shared<bool>(false);
  const auto target = std::make_shared<live::Target>();
  line->add_flag("--live", *is_live, "Record a running application");
  target->add_application_to(*line);
  return {line, [line, options, is_live, target] {
            return live::guarded("record", [&] {
              if (!*is_live) {
                live::require_file(*line);
                return run(*options);
              }
              live::require_live_only(
                  *line, {"app", "output", "topics", "except", "compression", "for", "quiet"});
              return live::record({.target = *target,
                                   .record = options->record,
                                   .duration = options->limit,
                                   .is_quiet = options->is_quiet});
            });
          }};
}

}  // namespace fastcycle::tool
