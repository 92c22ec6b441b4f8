#include "command_tree.h"

#include <iterator>

namespace fastcycle::tool {

std::vector<const CLI::App*> shown_commands(const CLI::App& line) {
  return line.get_subcommands(
      [](const CLI::App* command) { return !command->get_group().empty(); });
}

std::vector<CommandPath> shown_paths(const CLI::App& program) {
  std::vector<CommandPath> paths{{program.get_name(), &program}};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    std::vector<CommandPath> below;
    for (const CLI::App* command : shown_commands(*paths[i].line)) {
      below.push_back({paths[i].words + " " + command->get_name(), command});
    }
    paths.insert(paths.begin() + static_cast<std::ptrdiff_t>(i) + 1, below.begin(), below.end());
  }
  return paths;
}

}  // namespace fastcycle::tool
