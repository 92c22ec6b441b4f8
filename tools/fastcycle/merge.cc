#include <memory>

#include "command.h"
#include "file_work.h"
#include "rewriting.h"

namespace fastcycle::tool {

Command add_merge(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "merge", "Merge several logs into one, in the order of their log times");
  line->footer(
      examples("  fastcycle merge drive_0001.mcap drive_0002.mcap drive.mcap\n"
               "  fastcycle merge car.mcap roadside.mcap both.mcap --compression zstd\n"));
  const auto work = std::make_shared<Rewriting>();
  work->command = "merge";
  line->add_option("files", work->inputs, "The logs to merge, then the new log")
      ->required()
      ->type_name("IN… OUT");
  work->add_options(*line);
  return {line, [work] {
            if (work->inputs.size() < 2) {
              return print_error("merge",
                                 "expects the logs to merge, then the name of the new log");
            }
            work->output = work->inputs.back();
            work->inputs.pop_back();
            return work->run();
          }};
}

}  // namespace fastcycle::tool
