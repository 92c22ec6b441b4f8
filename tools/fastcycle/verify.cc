#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "before_activation.h"
#include "command.h"
#include "exact_replaying.h"
#include "file_work.h"
#include "mcap/error.h"
#include "print.h"
#include "report_file.h"

namespace fastcycle::tool {
namespace {

struct VerifyOptions {
  ExactReplaying replaying;
  std::filesystem::path report;
  std::uint64_t stop_before = 0;  ///< Of `fastcycle debug`.
};

nlohmann::ordered_json to_json(const host::ExactReplayResult& result) {
  nlohmann::ordered_json json = {{"executed", result.is_executed},
                                 {"executed_for_others", result.is_source},
                                 {"recorded_activations", result.recorded},
                                 {"activations", result.activations},
                                 {"began_after_activation", result.began_after},
                                 {"began_s", static_cast<double>(result.began_ns) / 1e9},
                                 {"outputs", result.outputs},
                                 {"equal", result.equal},
                                 {"not_recorded", result.not_recorded},
                                 {"differences", result.differences},
                                 {"why", result.why},
                                 {"first_difference", nlohmann::ordered_json()}};
  if (const auto& first = result.first_difference) {
    json["first_difference"] = {{"activation", first->activation},
                                {"cause", first->cause},
                                {"time_s", static_cast<double>(first->time_ns) / 1e9},
                                {"topic", first->topic},
                                {"sequence", first->sequence},
                                {"field", first->field},
                                {"recorded", first->recorded},
                                {"now", first->now}};
  }
  return json;
}

std::string to_text(const host::OutputDifference& first) {
  std::string text =
      fmt::format("  first difference: activation {} at {:.6f} s, by {}\n", first.activation,
                  static_cast<double>(first.time_ns) / 1e9, first.cause);
  if (!first.topic.empty()) {
    text += fmt::format("    \"{}\", message {}\n", first.topic, first.sequence);
  }
  text += fmt::format("    {}: recorded {}, now {}\n", first.field, first.recorded, first.now);
  return text;
}

std::string to_table(const std::vector<host::ExactReplayResult>& results) {
  std::size_t width = 9;
  for (const host::ExactReplayResult& result : results) {
    width = std::max(width, result.component.size());
  }
  std::string text =
      fmt::format("{:<{}}  activations     outputs       equal\n", "COMPONENT", width);
  for (const host::ExactReplayResult& result : results) {
    if (!result.is_executed) {
      text += fmt::format("{:<{}}  not executed: {}\n", result.component, width, result.why);
      continue;
    }
    text +=
        fmt::format("{:<{}}  {:>11} {:>11} {:>11}{}\n", result.component, width, result.activations,
                    result.outputs, result.equal, result.is_equal() ? "" : "  DIFFERENT");
    if (result.is_source) {
      text += "  also executed: its messages are needed and were not recorded\n";
    }
    if (result.began_after > 0) {
      text += fmt::format("  from its state after activation {} on, at {:.3f} s\n",
                          result.began_after, static_cast<double>(result.began_ns) / 1e9);
    }
    if (result.first_difference) {
      text += to_text(*result.first_difference);
    }
    if (!result.why.empty()) {
      text += fmt::format("  {} activations of {}: {}\n", result.activations, result.recorded,
                          result.why);
    }
    if (result.not_recorded > 0) {
      text += fmt::format("  {} published messages are not in the log\n", result.not_recorded);
    }
  }
  return text;
}

int verify(VerifyOptions& options) {
  if (const std::string wrong = options.replaying.find_wrong(); !wrong.empty()) {
    return print_error("verify", wrong);
  }
  const ReportFile report_file(options.report, options.replaying.files);
  if (const std::string obstacle = report_file.find_obstacle(); !obstacle.empty()) {
    return print_error("verify",
                       "the report " + options.report.string() + " cannot be written: " + obstacle);
  }
  std::vector<host::ExactReplayResult> results;
  bool is_stopped = false;
  try {
    FileWork work(true);  // Before any other thread, none of which may take its signals.
    const auto replayed = ReplayedApplication::make("verify", options.replaying);
    if (replayed == nullptr) {
      return kWrong;
    }
    if (options.stop_before > 0) {
      replayed->replay().before_activation = [&options](const detail::ComponentCore& core,
                                                        std::uint64_t activation) {
        const auto& names = options.replaying.options.components;
        if (activation == options.stop_before && (names.empty() || names.front() == core.name)) {
          fastcycle_before_activation(core.name.c_str(), activation, core.component);
        }
      };
    }
    const auto show = work.steps("executing", "activations");
    replayed->replay().run([&](const host::ExactReplay::Progress& progress) {
      is_stopped = !show(progress);
      return !is_stopped;
    });
    results = replayed->replay().results();
  } catch (const mcap::Error& error) {
    return print_error("verify", error.what());
  }
  nlohmann::ordered_json components = nlohmann::ordered_json::object();
  for (const host::ExactReplayResult& result : results) {
    components[result.component] = to_json(result);
  }
  const nlohmann::ordered_json report = {{"components", std::move(components)}};
  print_text(stdout, to_table(results));
  const std::string obstacle =
      report_file.write(base::printable_json(report.dump(
                            2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
                        "\n");
  if (!obstacle.empty()) {
    print_to(stderr, "fastcycle verify: the report {} was not written: {}\n",
             options.report.string(), obstacle);
    static_cast<void>(flush_output());
    return kFailed;
  }
  if (is_stopped) {
    print_text(stderr, "fastcycle verify: stopped on request; not all activations were executed\n");
    static_cast<void>(flush_output());
    return kFailed;
  }
  const auto is_different = [](const auto& result) { return !result.is_equal(); };
  if (std::ranges::any_of(results, is_different)) {
    static_cast<void>(flush_output());
    return kProblems;
  }
  return flush_output();
}

}  // namespace

Command add_verify(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "verify", "Execute a log again and compare the published messages byte by byte");
  line->footer(examples(
      "  fastcycle verify drive.mcap\n"
      "  fastcycle verify drive.mcap app.json --component motion_planning\n"
      "  fastcycle verify drive.mcap app.json --library-path build/new/lib --report out.json\n"
      "\n"
      "The recorded activations of each component are executed in their order, with their\n"
      "recorded inputs. A live run is reproduced bit by bit if its components use only the time,\n"
      "random numbers and observations of FastCycle: now(), random(), observe().\n"
      "\n"
      "Exit codes: 0 all equal, 1 stopped or no report, 2 wrong input, 3 a difference.\n"));
  const auto options = std::make_shared<VerifyOptions>();
  options->replaying.add_to(*line);
  options->replaying.add_input_to(*line);
  line->add_option("--stop-before", options->stop_before,
                   "For debuggers: call fastcycle_before_activation() before this activation")
      ->type_name("N");
  line->add_option("--report", options->report, "Write the results as JSON")->type_name("FILE");
  return {line, [options] { return verify(*options); }};
}

}  // namespace fastcycle::tool
