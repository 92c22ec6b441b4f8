#include <CLI/CLI.hpp>

#include "command.h"

namespace fastcycle::tool {

const char* const kAbsentCommands = "";

std::vector<Command> add_commands(CLI::App& program) {
  return {
      add_new(program),       add_run(program),      add_record(program),   add_play(program),
      add_check(program),     add_graph(program),    add_params(program),   add_bench(program),
      add_info(program),      add_echo(program),     add_export(program),   add_view(program),
      add_render(program),    add_verify(program),   add_compare(program),  add_debug(program),
      add_convert(program),   add_filter(program),   add_merge(program),    add_split(program),
      add_recover(program),   add_doctor(program),   add_list(program),     add_topic(program),
      add_component(program), add_param(program),    add_service(program),  add_mode(program),
      add_log(program),       add_chain(program),    add_shadow(program),   add_standby(program),
      add_top(program),       add_security(program), add_campaign(program), add_version(program),
      add_manual(program)};
}

}  // namespace fastcycle::tool
