#include <CLI/CLI.hpp>

#include "command.h"

namespace fastcycle::tool {

const char* const kAbsentCommands =
    "\n"
    "This build contains only the commands for a first drive. ./dev build release builds all "
    "commands.\n";

std::vector<Command> add_commands(CLI::App& program) {
  return {add_run(program),    add_play(program),   add_graph(program),
          add_render(program), add_verify(program), add_version(program)};
}

}  // namespace fastcycle::tool
