#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace fastcycle::tool {

/// A command and its full name: "fastcycle topic echo".
struct CommandPath {
  std::string words;
  const CLI::App* line = nullptr;
};

/// The commands below `line` that its help shows, in its order.
[[nodiscard]] std::vector<const CLI::App*> shown_commands(const CLI::App& line);

/// The program and all commands that it shows, each before those below it.
[[nodiscard]] std::vector<CommandPath> shown_paths(const CLI::App& program);

}  // namespace fastcycle::tool
