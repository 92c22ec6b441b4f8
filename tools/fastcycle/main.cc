// fastcycle: the command line. Each command is in its own file; this one parses the arguments.

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <unistd.h>

#include "command.h"
#include "config/nearest.h"
#include "config/problem.h"
#include "fastcycle/version.h"
#include "option_values.h"
#include "print.h"

namespace fastcycle::tool {

std::string examples(const std::string& lines) {
  return "Examples:\n" + lines;
}

int flush_output() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) {
    return kDone;
  }
  print_to(stderr, "fastcycle: standard output: {}\n", std::strerror(errno));
  return kFailed;
}

namespace {

constexpr const char* kExitCodes =
    "Exit codes:\n"
    "  0    done\n"
    "  1    the run failed: a component with \"on_fault\" \"stop\" faulted, or any component with\n"
    "       --fail-on-fault; a component hung or ended the process; or file access failed\n"
    "  2    the configuration or the command line is wrong; nothing was started\n"
    "  3    a log has problems, or could not be recovered completely; a latency chain is not\n"
    "       shown to hold\n"
    "  130  ended at once by a second Ctrl-C\n";

/// " topic echo": the words that lead to `line`.
std::string words_of(const CLI::App& line) {
  return line.get_parent() == nullptr ? "" : words_of(*line.get_parent()) + " " + line.get_name();
}

int print_wrong(const std::string& sentence, const CLI::App& line) {
  const std::string command = words_of(line);
  print_to(stderr, "fastcycle{}: {}\n  fastcycle{} --help shows the usage\n", command, sentence,
           command);
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

/// The error message for an unknown argument, with the likely intended one.
std::string unknown_words(const CLI::App& line) {
  const std::string word = line.remaining().front();
  if (!word.starts_with('-')) {
    return "unexpected argument \"" + word + "\"";
  }
  const std::string option = word.substr(0, word.find('='));
  const std::string hint = config::did_you_mean(config::nearest(option, known_options(line)));
  return "unknown option " + option + (hint.empty() ? "" : "; " + hint);
}

/// The error message for a missing argument, with its description.
std::string missing_word(const CLI::App& line, const CLI::RequiredError& error) {
  const std::string sentence = error.what();
  const CLI::Option* option = line.get_option_no_throw(sentence.substr(0, sentence.find(' ')));
  return sentence + (option == nullptr ? "" : ": " + option->get_description());
}

/// The error message for an invalid value. Those of our own checks (option_values.h) are complete
/// except for a superfluous colon.
std::string wrong_value(const CLI::App& line, const CLI::ParseError& error) {
  std::string sentence = error.what();
  if (const auto colon = sentence.find(": expects "); colon != std::string::npos) {
    return sentence.erase(colon, 1);
  }
  // Of two options that exclude each other, or an option and an argument.
  constexpr std::string_view kExcludes = " excludes ";
  if (const auto place = sentence.find(kExcludes); place != std::string::npos) {
    return sentence.substr(0, place) + " and " + sentence.substr(place + kExcludes.size()) +
           " cannot be used together";
  }
  for (const CLI::Option* option : line.get_options()) {
    const std::string before = "Could not convert: " + option->get_name() + " = ";
    if (sentence.starts_with(before)) {
      const std::string found = sentence.substr(before.size());
      const char* const wanted = option->get_items_expected_max() == 0 ? "no value"
                                 : parse_number(found) ? "a whole number, not below 0"
                                                       : "a number";
      return option->get_name() + " expects " + wanted + ", found \"" + found + "\"";
    }
  }
  return sentence;
}

/// An option that lacks its value, or was given twice.
std::string wrong_count(const CLI::App& line, const CLI::ArgumentMismatch& error) {
  const std::string sentence = error.what();
  for (const CLI::Option* option : line.get_options()) {
    if (sentence.starts_with(option->get_name() + ": ") && option->get_items_expected_max() == 1) {
      return option->get_name() + (sentence.ends_with(" missing")
                                       ? " expects a value: " + option->get_type_name()
                                       : " may be given only once");
    }
  }
  return sentence;
}

/// A word that is none of `commands`; empty if it is one, or an option.
std::string unknown_command(const std::vector<Command>& commands, const std::string& word) {
  std::vector<std::string> names;
  for (const Command& command : commands) {
    names.push_back(command.line->get_name());
  }
  if (word.starts_with('-') || std::find(names.begin(), names.end(), word) != names.end()) {
    return {};
  }
  const std::string hint = config::did_you_mean(config::nearest(word, names));
  return "unknown command \"" + word + "\"" + (hint.empty() ? "" : "; " + hint) + kAbsentCommands;
}

const Command* find(const std::vector<Command>& commands, const std::string& word) {
  const auto found = std::ranges::find_if(
      commands, [&](const Command& command) { return command.line->get_name() == word; });
  return found == commands.end() ? nullptr : &*found;
}

/// Prints the available choices if none was given.
int print_choice(const CLI::App& line) {
  print_text(stderr, line.help());
  return kWrong;
}

/// Follows the words that are commands, from `position` on. Null if they lead to none, with the
/// exit code; of a group that is asked for help, the group itself.
const Command* follow(const std::vector<Command>& commands, const CLI::App& line,
                      const std::vector<std::string>& words, std::size_t position, int& exit_code) {
  if (position >= words.size()) {
    exit_code = print_choice(line);
    return nullptr;
  }
  const std::string& word = words[position];
  if (const std::string wrong = unknown_command(commands, word); !wrong.empty()) {
    exit_code = print_wrong(wrong, line);
    return nullptr;
  }
  const Command* const command = find(commands, word);
  if (command == nullptr || command->words.empty()) {
    return command;
  }
  if (position + 1 < words.size() && words[position + 1].starts_with('-')) {
    return command;  // A help option, or an option in the wrong place.
  }
  return follow(command->words, *command->line, words, position + 1, exit_code);
}

int run_program(int argument_count, char** arguments) {
  CLI::App program("FastCycle: a framework for automated driving.", "fastcycle");
  program.set_version_flag("--version", "fastcycle " FASTCYCLE_VERSION);
  program.set_help_flag("-h,--help", "Show this and exit");
  program.footer(std::string(kExitCodes) + kAbsentCommands);
  program.get_formatter()->column_width(28);
  program.require_subcommand(0, 1);  // Arguments of a command are not commands.
  const std::vector<Command> commands = add_commands(program);
  const std::vector<std::string> words(arguments + 1, arguments + argument_count);
  if (words == std::vector<std::string>{"help"}) {
    print_text(stdout, program.help());
    return kDone;
  }
  int exit_code = kDone;
  const Command* const command = follow(commands, program, words, 0, exit_code);
  if (exit_code != kDone) {
    return exit_code;
  }
  CLI::App* const line = command == nullptr ? &program : command->line;
  if (command != nullptr) {
    line->allow_extras();
  }
  try {
    program.parse(argument_count, arguments);
  } catch (const CLI::Success& success) {
    return program.exit(success);  // Help and version, to standard output.
  } catch (const CLI::RequiredError& error) {
    return print_wrong(missing_word(*line, error), *line);
  } catch (const CLI::ArgumentMismatch& error) {
    return print_wrong(wrong_count(*line, error), *line);
  } catch (const CLI::ParseError& error) {
    return print_wrong(wrong_value(*line, error), *line);
  }
  if (line->remaining_size() > 0) {
    return print_wrong(unknown_words(*line), *line);
  }
  if (command == nullptr || !command->run) {
    return print_wrong("a command is missing", *line);
  }
  return command->run();
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
  // A file that is larger than `ulimit -f` allows is an error of that file, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return fastcycle::tool::run_program(argument_count, arguments);
  } catch (const std::system_error& error) {
    // The system's error if no further thread can be created.
    const bool is_thread = error.code() == std::errc::resource_unavailable_try_again;
    fastcycle::tool::print_to(stderr, "fastcycle: {}{}\n", error.what(),
                              is_thread ? ": a thread could not be created; raise the limits of "
                                          "threads and of memory (ulimit -u, ulimit -v)"
                                        : "");
    return fastcycle::tool::kFailed;
  } catch (const std::exception& error) {
    fastcycle::tool::print_to(stderr, "fastcycle: {}\n", error.what());
    return fastcycle::tool::kFailed;
  }
}
