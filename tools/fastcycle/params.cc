#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <fnmatch.h>

#include "base/printable.h"
#include "command.h"
#include "config/nearest.h"
#include "configuration.h"
#include "print.h"
#include "report/param_list.h"

namespace fastcycle::tool {
namespace {

struct ParamsOptions {
  Configuration configuration;
  std::vector<std::string> patterns;
  bool json = false;
  bool markdown = false;
};

/// "limiter" and "limiter.*" mean all of that component, "*.limit_mps" one of each.
bool is_meant(const std::string& pattern, const host::ListedParam& param) {
  return fnmatch(pattern.c_str(), param.component.c_str(), 0) == 0 ||
         fnmatch(pattern.c_str(), param.full_name().c_str(), 0) == 0;
}

/// Keeps those that match a pattern, and reports patterns without a match.
bool choose(const std::vector<std::string>& patterns, std::vector<host::ListedParam>& params) {
  std::vector<std::string> known;
  for (const host::ListedParam& param : params) {
    known.push_back(param.component);
    known.push_back(param.full_name());
  }
  bool is_right = true;
  for (const std::string& pattern : patterns) {
    if (std::ranges::none_of(params, [&](const auto& param) { return is_meant(pattern, param); })) {
      const std::string hint = config::did_you_mean(config::nearest(pattern, known));
      print_to(stderr, "fastcycle params: unknown component or param \"{}\"{}\n", pattern,
               (hint.empty() ? hint : "; " + hint));
      is_right = false;
    }
  }
  std::erase_if(params, [&](const host::ListedParam& param) {
    return !patterns.empty() && std::ranges::none_of(patterns, [&](const std::string& pattern) {
      return is_meant(pattern, param);
    });
  });
  return is_right;
}

int params(const ParamsOptions& options) {
  const std::unique_ptr<host::Application> application = options.configuration.make_unstarted();
  if (!application) {
    return kWrong;
  }
  std::vector<host::ListedParam> listed = host::list_params(*application);
  if (!choose(options.patterns, listed)) {
    return kWrong;
  }
  const std::string text = options.json       ? base::printable_json(host::to_json(listed))
                           : options.markdown ? host::to_markdown(listed)
                                              : host::to_table(listed);
  print_text(stdout, text);
  return flush_output();
}

}  // namespace

Command add_params(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "params", "List the params of an application's components, with their values");
  line->footer(
      examples("  fastcycle params app.json\n"
               "  fastcycle params app.json limiter '*.limit_mps'\n"
               "  fastcycle params app.json --markdown > params.md\n"));
  const auto options = std::make_shared<ParamsOptions>();
  options->configuration.add_to(*line);
  line->add_option("patterns", options->patterns,
                   "Only these components, or params as limiter.limit_mps; * matches any text")
      ->type_name("PATTERN");
  CLI::Option* json = line->add_flag("--json", options->json, "Print JSON");
  line->add_flag("--markdown", options->markdown, "Print a Markdown table")->excludes(json);
  return {line, [options] { return params(*options); }};
}

}  // namespace fastcycle::tool
