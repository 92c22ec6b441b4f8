#pragma once

#include <functional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace fastcycle::tool {

/// The exit codes, the same for every command; `--help` lists them too.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,    ///< The run failed, or a component whose policy is to stop the application.
  kWrong = 2,     ///< The configuration or the command line is wrong; nothing was started.
  kProblems = 3,  ///< Of logs: not in order, or not all could be saved, or another outcome when
                  ///< executed again. Of an estimate: a chain is not shown to hold.
  kEndedAtOnce = 130,  ///< Ctrl-C was pressed a second time.
};

/// One word of the command line: its options and the function that it runs; or a group of
/// subcommands, one of which is required.
struct Command {
  CLI::App* line = nullptr;
  std::function<int()> run = {};
  std::vector<Command> words = {};
};

// Each is in its own file.
Command add_run(CLI::App& program);
Command add_record(CLI::App& program);
Command add_play(CLI::App& program);
Command add_check(CLI::App& program);
Command add_graph(CLI::App& program);
Command add_top(CLI::App& program);
Command add_params(CLI::App& program);
Command add_bench(CLI::App& program);
Command add_info(CLI::App& program);
Command add_echo(CLI::App& program);
Command add_export(CLI::App& program);
Command add_convert(CLI::App& program);
Command add_filter(CLI::App& program);
Command add_merge(CLI::App& program);
Command add_split(CLI::App& program);
Command add_recover(CLI::App& program);
Command add_doctor(CLI::App& program);
Command add_render(CLI::App& program);
Command add_view(CLI::App& program);
Command add_verify(CLI::App& program);
Command add_compare(CLI::App& program);
Command add_debug(CLI::App& program);
Command add_campaign(CLI::App& program);
Command add_version(CLI::App& program);
Command add_manual(CLI::App& program);
Command add_new(CLI::App& program);
Command add_security(CLI::App& program);

// Commands on a running application.
Command add_list(CLI::App& program);
Command add_topic(CLI::App& program);
Command add_component(CLI::App& program);
Command add_param(CLI::App& program);
Command add_service(CLI::App& program);
Command add_mode(CLI::App& program);
Command add_log(CLI::App& program);
Command add_chain(CLI::App& program);
Command add_shadow(CLI::App& program);
Command add_standby(CLI::App& program);

/// All commands of this build.
[[nodiscard]] std::vector<Command> add_commands(CLI::App& program);

/// What to say where a command might be missing from this build; empty where it has all.
extern const char* const kAbsentCommands;

/// The examples at the end of a command's help.
[[nodiscard]] std::string examples(const std::string& lines);

/// `kDone` if all output reached standard output; else prints why not.
[[nodiscard]] int flush_output();

}  // namespace fastcycle::tool
