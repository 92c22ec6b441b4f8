#include <cstddef>
#include <cstdio>
#include <memory>

#include "command.h"
#include "config/print.h"
#include "configuration.h"
#include "host/library_imports.h"

namespace fastcycle::tool {
namespace {

struct CheckOptions {
  Configuration configuration;
  bool print = false;
};

int check(const CheckOptions& options) {
  config::Problems problems;
  const config::ApplicationDescription description =
      options.configuration.read(host::ConstructorFault::kMistake, problems);
  host::warn_of_imports(
      description,
      host::LibraryLoader(host::library_folders(description, options.configuration.library_path)),
      problems);
  if (options.print && !description.effective.is_null()) {
    std::printf("%s\n", config::print(description.effective).c_str());
  }
  const std::string file = options.configuration.load.file.string();
  if (!may_start(problems, file)) {
    return kWrong;
  }
  const std::size_t count = description.components.size();
  std::fprintf(options.print ? stderr : stdout, "%s; %zu %s\n", summary(problems, file).c_str(),
               count, count == 1 ? "component is right" : "components fit together");
  return flush_output();
}

}  // namespace

Command add_check(CLI::App& program) {
  CLI::App* line = program.add_subcommand("check",
                                          "Find every mistake of an application, in its files and "
                                          "in its components, and start nothing");
  line->footer(
      examples("  fastcycle check app.json\n"
               "  fastcycle check app.json --overlay vehicle_17.json --print\n"));
  const auto options = std::make_shared<CheckOptions>();
  options->configuration.add_to(*line);
  line->add_flag("--print", options->print,
                 "Print the effective configuration, and where each value comes from");
  return {line, [options] { return check(*options); }};
}

}  // namespace fastcycle::tool
