// fastcycle: the command line. Each command has a file of its own; this one reads the words.

#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <unistd.h>

#include "command.h"
#include "config/nearest.h"
#include "config/problem.h"
#include "fastcycle/version.h"

namespace fastcycle::tool {

std::string examples(const std::string& lines) {
  return "Examples:\n" + lines;
}

int flush_output() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) {
    return kDone;
  }
  std::perror("fastcycle: standard output");
  return kFailed;
}

namespace {

constexpr const char* kExitCodes =
    "Exit codes:\n"
    "  0    done\n"
    "  1    the run failed, or a component did whose \"on_fault\" is \"stop\"; a file failed\n"
    "  2    the configuration or the command line is wrong; nothing was started\n"
    "  3    a log is not in order, or not all of it could be saved\n"
    "  130  ended at once by a second Ctrl-C\n";

int print_wrong(const std::string& sentence, const CLI::App& line) {
  const std::string command = line.get_parent() == nullptr ? "" : " " + line.get_name();
  std::fprintf(stderr, "fastcycle%s: %s\n  fastcycle%s --help says more\n", command.c_str(),
               sentence.c_str(), command.c_str());
  return kWrong;
}

std::vector<std::string> known_options(const CLI::App& line) {
  std::vector<std::string> names;
  for (const CLI::Option* option : line.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      names.push_back("--" + name);
    }
  }
  return names;
}

/// What was said that nobody understands, with what was probably meant.
std::string unknown_words(const CLI::App& line) {
  const std::string word = line.remaining().front();
  if (!word.starts_with('-')) {
    return "does not know what to do with \"" + word + "\"";
  }
  const std::string option = word.substr(0, word.find('='));
  const std::string hint = config::did_you_mean(config::nearest(option, known_options(line)));
  return "there is no option " + option + (hint.empty() ? "" : "; " + hint);
}

/// What is missing, and what it is.
std::string missing_word(const CLI::App& line, const CLI::RequiredError& error) {
  const std::string sentence = error.what();
  const CLI::Option* option = line.get_option_no_throw(sentence.substr(0, sentence.find(' ')));
  return sentence + (option == nullptr ? "" : ": " + option->get_description());
}

/// A first word that is no command; empty if it is one, or an option.
std::string unknown_command(const std::vector<Command>& commands, const std::string& word) {
  std::vector<std::string> names;
  for (const Command& command : commands) {
    names.push_back(command.line->get_name());
  }
  if (word.starts_with('-') || std::find(names.begin(), names.end(), word) != names.end()) {
    return {};
  }
  const std::string hint = config::did_you_mean(config::nearest(word, names));
  return "there is no command \"" + word + "\"" + (hint.empty() ? "" : "; " + hint);
}

int run_program(int argument_count, char** arguments) {
  CLI::App program("FastCycle: components of automated driving in one process.", "fastcycle");
  program.set_version_flag("--version", "fastcycle " FASTCYCLE_VERSION);
  program.set_help_flag("-h,--help", "Show this and exit");
  program.footer(kExitCodes);
  program.get_formatter()->column_width(28);
  const std::vector<Command> commands = {
      add_run(program),    add_record(program), add_play(program),   add_check(program),
      add_graph(program),  add_top(program),    add_params(program), add_bench(program),
      add_info(program),   add_echo(program),   add_export(program), add_convert(program),
      add_filter(program), add_merge(program),  add_split(program),  add_recover(program),
      add_doctor(program), add_version(program)};
  if (argument_count < 2) {
    std::fputs(program.help().c_str(), stderr);
    return kWrong;
  }
  if (argument_count == 2 && std::string_view(arguments[1]) == "help") {
    std::fputs(program.help().c_str(), stdout);
    return kDone;
  }
  if (const std::string wrong = unknown_command(commands, arguments[1]); !wrong.empty()) {
    return print_wrong(wrong, program);
  }
  const CLI::App* line = &program;
  for (const Command& command : commands) {
    if (command.line->get_name() == arguments[1]) {
      line = command.line;
      command.line->allow_extras();
    }
  }
  try {
    program.parse(argument_count, arguments);
  } catch (const CLI::Success& success) {
    return program.exit(success);  // Help and version, to standard output.
  } catch (const CLI::RequiredError& error) {
    return print_wrong(missing_word(*line, error), *line);
  } catch (const CLI::ParseError& error) {
    return print_wrong(error.what(), *line);
  }
  if (line->remaining_size() > 0) {
    return print_wrong(unknown_words(*line), *line);
  }
  for (const Command& command : commands) {
    if (command.line->parsed()) {
      return command.run();
    }
  }
  return print_wrong("a command is missing", program);
}

/// Gives the numbers of standard streams that the caller has closed to something harmless: a file
/// that is opened later would get them, and with them what is printed.
void occupy_standard_streams() {
  int descriptor = 0;
  while (descriptor >= 0 && descriptor <= STDERR_FILENO) {
    descriptor = open("/dev/null", O_RDONLY | O_CLOEXEC);  // Not to be written: that still fails.
  }
  if (descriptor >= 0) {
    close(descriptor);
  }
}

}  // namespace
}  // namespace fastcycle::tool

int main(int argument_count, char** arguments) {
  fastcycle::tool::occupy_standard_streams();
  try {
    return fastcycle::tool::run_program(argument_count, arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fastcycle: %s\n", error.what());
    return fastcycle::tool::kFailed;
  }
}
