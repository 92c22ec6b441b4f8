#include "report/graph.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/output_file.h"
#include "command.h"
#include "configuration.h"
#include "live/graph.h"
#include "print.h"
#include "report_file.h"

namespace fastcycle::tool {
namespace {

using Inputs = std::vector<std::filesystem::path>;

struct GraphOptions {
  Configuration configuration;
  std::filesystem::path output;
  live::GraphOptions live;
};

/// `dot -Tsvg input > output`. Returns why that failed, or nothing.
std::string draw(const std::filesystem::path& input, int output) {
  std::string words[] = {"dot", "-Tsvg", input.string()};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  pid_t child = 0;
  const int error = posix_spawnp(&child, "dot", &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    return error == ENOENT
               ? "the program dot of Graphviz is not installed; -o FILE.dot does not need it"
               : std::string("dot cannot be started: ") + std::strerror(error);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status == 0 ? std::string() : "dot failed";
}

/// Draws by a temporary file. Returns an error message; empty on success.
std::string write_svg(const std::string& dot, const std::filesystem::path& output,
                      const Inputs& inputs) {
  std::string input = (std::filesystem::temp_directory_path() / "fastcycle.dot.XXXXXX").string();
  const int file = mkstemp(input.data());
  if (file < 0) {
    return std::strerror(errno);
  }
  close(file);
  std::string obstacle = ReportFile(input).write(dot);
  if (obstacle.empty()) {
    try {
      base::OutputFile picture(output, inputs);
      obstacle = draw(input, picture.descriptor());
      if (obstacle.empty()) {
        picture.commit();
      }
    } catch (const std::runtime_error& error) {
      obstacle = error.what();
    }
  }
  unlink(input.c_str());
  return obstacle;
}

int write_graph(const std::string& dot, const std::filesystem::path& output,
                const Inputs& inputs = {}) {
  if (output.empty()) {
    print_text(stdout, dot);
    print_text(stderr, "fastcycle graph: -o FILE.svg writes a picture\n");
    return flush_output();
  }
  const std::string obstacle = output.extension() == ".svg" ? write_svg(dot, output, inputs)
                                                            : ReportFile(output, inputs).write(dot);
  if (!obstacle.empty()) {
    print_to(stderr, "fastcycle graph: {} was not written: {}\n", output.string(), obstacle);
    return kFailed;
  }
  return kDone;
}

int graph_of_file(const GraphOptions& options) {
  const std::unique_ptr<host::Application> application = options.configuration.make_unstarted();
  if (!application) {
    return kWrong;
  }
  Inputs inputs = options.configuration.load.overlays;
  inputs.push_back(options.configuration.load.file);
  return write_graph(host::to_dot(*application), options.output, inputs);
}

int graph(const GraphOptions& options, const CLI::App& line) {
  const std::filesystem::path extension = options.output.extension();
  if (!options.output.empty() && extension != ".svg" && extension != ".dot") {
    print_to(stderr, "fastcycle graph: -o expects a name that ends in .svg or .dot, not {}\n",
             options.output.string());
    return kWrong;
  }
  return options.live.run(
      line, [&] { return graph_of_file(options); },
      [&](const std::string& dot) { return write_graph(dot, options.output); });
}

}  // namespace

Command add_graph(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("graph", "Draw the components and topics of an application");
  line->footer(
      examples("  fastcycle graph app.json -o app.svg\n"
               "  fastcycle graph app.json | dot -Tpng -o app.png\n"
               "  fastcycle graph --live -o now.svg\n"
               "\n"
               "--live draws an application that runs with --inspect, with rates, latencies and\n"
               "losses.\n"));
  const auto options = std::make_shared<GraphOptions>();
  options->configuration.add_to(*line);
  line->add_option("-o,--output", options->output,
                   "Output: FILE.svg (requires Graphviz) or FILE.dot (DOT to standard output)")
      ->type_name("FILE");
  options->live.add_to(*line);
  return {line, [line, options] { return graph(*options, *line); }};
}

}  // namespace fastcycle::tool
