// trace: what a trace costs, a message.

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "bench/beside.h"
#include "bench/modes.h"

namespace fastcycle::tool::bench {
namespace {

constexpr const char* kTraced = "traced";

void trace_into(Json& application, const std::string& file) {
  application["trace"] = {{"file", file}};
}

/// Adds the trace's results. It must contain all of the messages' activations, or report them as
/// lost.
void add_trace(Finding& finding, const trace::TraceReport& trace) {
  finding.row.more += fmt::format(",\"slices\":{},\"trace_lost\":{},\"trace_bytes\":{}",
                                  trace.slices, trace.lost(), trace.bytes);
  const std::int64_t callbacks = finding.row.n + finding.row.warmup;
  if (!trace.problem.empty()) {
    finding.trouble = trace.problem;
  } else if (trace.lost() == 0 && static_cast<std::int64_t>(trace.slices) < callbacks) {
    finding.trouble =
        fmt::format("{} callbacks, but only {} slices in the trace, and no losses reported",
                    callbacks, trace.slices);
  }
}

Finding measure_trace(Session& session, const std::string& what, const std::string& wait,
                      std::int64_t size) {
  Json json = application_beside(session.options(), size, wait, session.folder());
  if (what == kTraced) {
    trace_into(json, session.folder() + "/bench.pftrace");
  }
  const Finished finished = session.run_application(json);
  Finding finding = finding_beside(session, what, wait, size, finished);
  if (finished.trace) {
    add_trace(finding, *finished.trace);
  }
  return finding;
}

/// Adds to the traced rows of a round how many ns more a message took at the median.
void add_costs(std::vector<measure::Row>& rows) {
  for_each_beside(
      rows, [](measure::Row& row, const nlohmann::json& with, const nlohmann::json& without) {
        for (const auto& [key, name] :
             {std::pair("p50_us", "cost_ns"), std::pair("publish_p50_us", "publish_cost_ns")}) {
          const double more_us = with.at(key).get<double>() - without.at(key).get<double>();
          row.more += fmt::format(",\"{}\":{:.0f}", name, 1000 * more_us);
        }
      });
}

}  // namespace

Mode trace_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = application_beside(options, options.sizes.front(), options.waits.front(), {});
  trace_into(mode.application, "bench.pftrace");
  mode.title = fmt::format(
      "with a trace and without, µs; cost in ns at the median; {} messages after {} of warm-up, "
      "one each {} µs",
      options.count, options.warmup, options.interval_us);
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"publish p50", "publish_p50_us", 2},
                  {"transfer p50", "p50_us", 2},
                  {"transfer p99", "p99_us"},
                  {"cpu/msg", "cpu_us_per_msg"},
                  {"lost", "lost", 0},
                  {"slices", "slices", 0},
                  {"trace lost", "trace_lost", 0},
                  {"publish cost, ns", "publish_cost_ns", 0, true},
                  {"transfer cost, ns", "cost_ns", 0, true}};
  mode.after_round = add_costs;
  for (const std::int64_t size : options.sizes) {
    for (const std::string& wait : options.waits) {
      Point point;
      for (const char* const what : {kWithout, kTraced}) {
        point.steps.push_back({.peer = fmt::format("{}-{}", what, wait),
                               .measure = [session, what = std::string(what), wait, size] {
                                 return measure_trace(*session, what, wait, size);
                               }});
      }
      mode.points.push_back(std::move(point));
    }
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
