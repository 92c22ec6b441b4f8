// fastcycle manual: what belongs beside the program where it is installed, made of what it accepts.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>

#include "command.h"
#include "command_tree.h"
#include "completion.h"
#include "man_page.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) {
    throw std::runtime_error("cannot write " + path.string());
  }
}

}  // namespace

Command add_manual(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("manual", "Write the manual pages and the bash completion");
  line->group("");  // For the build of this program; not shown.
  const auto folder = std::make_shared<fs::path>();
  line->add_option("folder", *folder, "The folder for man and bash-completion")
      ->required()
      ->type_name("DIR");
  return {line, [&program, folder] {
            for (const CommandPath& path : shown_paths(program)) {
              write(*folder / "man/man1" / (man_page_name(path) + ".1"), man_page(path));
            }
            write(*folder / "bash-completion/completions/fastcycle", bash_completion(program));
            return static_cast<int>(kDone);
          }};
}

}  // namespace fastcycle::tool
