#include <memory>

#include "command.h"
#include "rewriting.h"

namespace fastcycle::tool {

Command add_convert(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "convert", "Write a log anew: with another compression, other chunks, an index");
  line->footer(
      examples("  fastcycle convert drive.mcap small.mcap --compression zstd\n"
               "  fastcycle convert drive.mcap plain.mcap --compression none --no-index\n"));
  const auto work = std::make_shared<Rewriting>();
  const auto has_no_index = std::make_shared<bool>(false);
  work->command = "convert";
  work->inputs.resize(1);
  line->add_option("in", work->inputs[0], "The log")->required()->type_name("IN");
  line->add_option("out", work->output, "The new one")->required()->type_name("OUT");
  line->add_flag("--no-index", *has_no_index,
                 "Without indexes of chunks and messages: readers have to go through all of it");
  work->add_options(*line);
  return {line, [work, has_no_index] {
            work->layout.has_index = !*has_no_index;
            return work->run();
          }};
}

}  // namespace fastcycle::tool
