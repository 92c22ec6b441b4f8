#include "completion.h"

#include <algorithm>
#include <vector>

#include "command_tree.h"

namespace fastcycle::tool {
namespace {

/// "live simulated" of "live|simulated"; empty if the type is no list of words.
std::string words_of_type(std::string type) {
  const bool is_list =
      type.find('|') != std::string::npos && std::ranges::all_of(type, [](char c) {
        return c == '|' || c == '-' || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
      });
  std::ranges::replace(type, '|', ' ');
  return is_list ? type : "";
}

/// The completions of a command: one branch of the script's `case`.
std::string branch(const CommandPath& path) {
  std::string commands;
  for (const CLI::App* command : shown_commands(*path.line)) {
    commands += (commands.empty() ? "" : " ") + command->get_name();
  }
  std::string options;
  std::string values;   // The options that take one.
  std::string choices;  // Those whose values are known.
  for (const CLI::Option* option : path.line->get_options()) {
    for (const std::string& name : option->get_lnames()) {
      options += (options.empty() ? "--" : " --") + name;
      if (option->get_items_expected_max() == 0) {
        continue;
      }
      values += (values.empty() ? "--" : "|--") + name;
      if (const std::string words = words_of_type(option->get_type_name()); !words.empty()) {
        choices += "        --" + name + ") choices=\"" + words + "\" ;;\n";
      }
    }
  }
  std::string text = "    \"" + path.words + "\")\n";
  text += "      commands=\"" + commands + "\"\n      options=\"" + options + "\"\n";
  if (!values.empty()) {
    text += "      case $before in " + values + ") takes_value=1 ;; esac\n";
  }
  if (!choices.empty()) {
    text += "      case $before in\n" + choices + "      esac\n";
  }
  return text + "      ;;\n";
}

}  // namespace

std::string bash_completion(const CLI::App& program) {
  std::string known;
  std::string branches;
  for (const CommandPath& path : shown_paths(program)) {
    known += (known.empty() ? "\"" : "|\"") + path.words + "\"";
    branches += branch(path);
  }
  return "# bash completion of fastcycle\n"
         "_fastcycle() {\n"
         "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}\n"
         "  local path=fastcycle commands='' options='' choices='' takes_value=0 i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do  # The words that are commands, from the first "
         "on.\n"
         "    case \"$path ${COMP_WORDS[i]}\" in\n"
         "      " +
         known +
         ") path+=\" ${COMP_WORDS[i]}\" ;;\n"
         "      *) break ;;\n"
         "    esac\n"
         "  done\n"
         "  case $path in\n" +
         branches +
         "  esac\n"
         "  COMPREPLY=()\n"
         "  if [[ -n $choices ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$choices\" -- \"$word\")\n"
         "  elif ((takes_value)); then\n"
         "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
         "  elif [[ $word == -* ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$options\" -- \"$word\")\n"
         "  elif [[ -n $commands ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$commands\" -- \"$word\")\n"
         "  else\n"
         "    compopt -o filenames 2>/dev/null\n"
         "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
         "  fi\n"
         "}\n"
         "complete -F _fastcycle fastcycle\n";
}

}  // namespace fastcycle::tool
