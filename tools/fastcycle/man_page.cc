#include "man_page.h"

#include <algorithm>
#include <cctype>
#include <sstream>
#include <string_view>
#include <vector>

#include "fastcycle/version.h"

namespace fastcycle::tool {
namespace {

/// As troff takes it: nothing of the text is a request or an escape.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\') {
      result += "\\e";
    } else if (c == '-') {
      result += "\\-";
    } else if (c == '\'') {
      result += "\\(aq";
    } else if (c == '.' && (result.empty() || result.back() == '\n')) {
      result += "\\&.";
    } else {
      result += c;
    }
  }
  return result;
}

std::string bold(std::string_view text) {
  return "\\fB" + escaped(text) + "\\fR";
}

std::string italic(std::string_view text) {
  return "\\fI" + escaped(text) + "\\fR";
}

/// The lines between empty ones.
std::vector<std::string> paragraphs_of(const std::string& text) {
  std::vector<std::string> paragraphs(1);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) {
      paragraphs.emplace_back();
    } else {
      paragraphs.back() += line + "\n";
    }
  }
  std::erase(paragraphs, "");
  return paragraphs;
}

std::string verbatim(const std::string& lines) {
  return ".nf\n" + escaped(lines) + ".fi\n";
}

/// The end of a command's help: examples and exit codes under headings of their own, the rest as it
/// is.
std::string footer(const std::string& help) {
  std::string examples;
  std::string exit_codes;
  std::string notes;
  for (const std::string& paragraph : paragraphs_of(help)) {
    const std::size_t end = paragraph.find('\n') + 1;
    if (paragraph.starts_with("Examples:")) {
      examples = ".SH EXAMPLES\n" + verbatim(paragraph.substr(end));
    } else if (paragraph.starts_with("Exit codes:")) {
      exit_codes = ".SH EXIT STATUS\n" + verbatim(paragraph);
    } else {
      notes += (notes.empty() ? ".SH NOTES\n" : ".PP\n") + verbatim(paragraph);
    }
  }
  return examples + notes + exit_codes;
}

std::string names_of(const CLI::Option& option) {
  std::string names;
  for (const std::string& name : option.get_snames()) {
    names += (names.empty() ? "" : ", ") + bold("-" + name);
  }
  for (const std::string& name : option.get_lnames()) {
    names += (names.empty() ? "" : ", ") + bold("--" + name);
  }
  return names;
}

std::string synopsis(const CommandPath& path, const std::vector<const CLI::Option*>& positionals,
                     bool has_commands) {
  std::string text = bold(path.words) + " [" + italic("OPTIONS") + "]";
  if (has_commands) {
    text += " " + italic("COMMAND");
  }
  for (const CLI::Option* positional : positionals) {
    const std::string name = italic(positional->get_name(true));
    text += positional->get_required() ? " " + name : " [" + name + "]";
  }
  return text + "\n";
}

}  // namespace

std::string man_page_name(const CommandPath& path) {
  std::string name = path.words;
  std::ranges::replace(name, ' ', '-');
  return name;
}

std::string man_page(const CommandPath& path) {
  const CLI::App& line = *path.line;
  std::vector<const CLI::Option*> positionals;
  std::vector<const CLI::Option*> options;
  for (const CLI::Option* option : line.get_options()) {
    (option->get_positional() ? positionals : options).push_back(option);
  }
  const std::vector<const CLI::App*> commands = shown_commands(line);

  std::string name = man_page_name(path);
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return std::toupper(c); });
  std::string text = ".TH " + title + " 1 \"\" \"FastCycle " FASTCYCLE_VERSION "\" FastCycle\n";
  text += ".SH NAME\n" + name + " \\- " + escaped(line.get_description()) + "\n";
  text += ".SH SYNOPSIS\n" + synopsis(path, positionals, !commands.empty());
  if (!positionals.empty()) {
    text += ".SH ARGUMENTS\n";
    for (const CLI::Option* positional : positionals) {
      text += ".TP\n" + italic(positional->get_name(true)) + "\n" +
              escaped(positional->get_description()) + "\n";
    }
  }
  if (!commands.empty()) {
    text += ".SH COMMANDS\n";
    for (const CLI::App* command : commands) {
      text +=
          ".TP\n" + bold(command->get_name()) + "\n" + escaped(command->get_description()) + "\n";
    }
    text += ".PP\nEach has its own page, such as " +
            bold(name + "-" + commands.front()->get_name()) + "(1).\n";
  }
  text += ".SH OPTIONS\n";
  for (const CLI::Option* option : options) {
    const bool takes_value = option->get_items_expected_max() > 0;
    text += ".TP\n" + names_of(*option) +
            (takes_value ? " " + italic(option->get_type_name()) : "") + "\n" +
            escaped(option->get_description()) + "\n";
  }
  text += footer(line.get_footer());
  if (line.get_parent() != nullptr) {
    text += ".SH SEE ALSO\n" +
            bold(man_page_name({path.words.substr(0, path.words.rfind(' ')), nullptr})) + "(1)\n";
  }
  return text;
}

}  // namespace fastcycle::tool
