#include "host/graph.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "command.h"
#include "configuration.h"
#include "duration.h"
#include "live/graph.h"
#include "live/session.h"
#include "option_values.h"
#include "report_file.h"

namespace fastcycle::tool {
namespace {

struct GraphOptions {
  Configuration configuration;
  std::filesystem::path output;
  bool is_live = false;
  live::Target target;
  std::string span = "1s";
};

/// `dot -Tsvg -o output input`. Returns why that failed, or nothing.
std::string draw(const std::filesystem::path& input, const std::filesystem::path& output) {
  std::string words[] = {"dot", "-Tsvg", "-o", output.string(), input.string()};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(),
                       words[3].data(), words[4].data(), nullptr};
  pid_t child = 0;
  if (const int error = posix_spawnp(&child, "dot", nullptr, nullptr, arguments, environ)) {
    return error == ENOENT
               ? "Graphviz is not installed (its program dot draws it); -o FILE.dot needs none"
               : std::string("dot cannot be started: ") + std::strerror(error);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status == 0 ? std::string() : "dot failed";
}

/// Draws by way of a file that is gone afterwards. Returns why that failed, or nothing.
std::string write_svg(const std::string& dot, const std::filesystem::path& output) {
  std::string input = (std::filesystem::temp_directory_path() / "fastcycle.dot.XXXXXX").string();
  const int file = mkstemp(input.data());
  if (file < 0) {
    return std::strerror(errno);
  }
  close(file);
  std::string obstacle = ReportFile(input).write(dot);
  if (obstacle.empty()) {
    obstacle = draw(input, output);
  }
  unlink(input.c_str());
  return obstacle;
}

int write_graph(const std::string& dot, const std::filesystem::path& output) {
  if (output.empty()) {
    std::fputs(dot.c_str(), stdout);
    std::fputs("fastcycle graph: -o FILE.svg makes a picture of it\n", stderr);
    return flush_output();
  }
  const std::string obstacle =
      output.extension() == ".svg" ? write_svg(dot, output) : ReportFile(output).write(dot);
  if (!obstacle.empty()) {
    std::fprintf(stderr, "fastcycle graph: %s was not written: %s\n", output.c_str(),
                 obstacle.c_str());
    return kFailed;
  }
  return kDone;
}

int graph(const GraphOptions& options, const CLI::App& line) {
  const std::filesystem::path extension = options.output.extension();
  if (!options.output.empty() && extension != ".svg" && extension != ".dot") {
    std::fprintf(stderr, "fastcycle graph: -o wants a name that ends in .svg or .dot, not %s\n",
                 options.output.c_str());
    return kWrong;
  }
  if (options.is_live) {
    live::require_live_only(line, {"app", "output", "over"});
    return write_graph(live::graph_of(options.target, *parse_duration(options.span)),
                       options.output);
  }
  live::require_file(line);
  const std::unique_ptr<host::Application> application = options.configuration.make_unstarted();
  if (!application) {
    return kWrong;
  }
  return write_graph(host::to_dot(*application), options.output);
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
               "--live draws an application that runs with --inspect, with its rates, latencies\n"
               "and losses.\n"));
  const auto options = std::make_shared<GraphOptions>();
  options->configuration.add_to(*line);
  line->add_option("-o,--output", options->output,
                   "Where to: FILE.svg (needs Graphviz) or FILE.dot; else DOT to standard output")
      ->type_name("FILE");
  line->get_option("application")->required(false);  // Not with --live.
  line->add_flag("--live", options->is_live, "Draw an application that runs, with numbers");
  options->target.add_application_to(*line);
  line->add_option("--over", options->span, "With --live: rates are those of so long (1s)")
      ->check(is_time())
      ->type_name("TIME");
  return {line, [line, options] {
            return live::guarded("graph", [&] { return graph(*options, *line); });
          }};
}

}  // namespace fastcycle::tool
