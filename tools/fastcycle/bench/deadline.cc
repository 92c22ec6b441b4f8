// deadline: how soon a subscriber is notified that its publisher has stalled.

#include <chrono>
#include <string>

#include <fmt/format.h>

#include "bench/modes.h"

namespace fastcycle::tool::bench {
namespace {

/// A publisher whose worker is blocked for ten deadlines after each message, and its watcher.
Json deadline_application(const Options& options, const std::string& wait,
                          const std::string& folder) {
  Json staller =
      component("staller", "benchmark_staller", "stalled", {{"interval_us", options.interval_us}});
  Json watcher = component(
      "watcher", "benchmark_watcher", "watching",
      {{"count", options.count}, {"warmup", options.warmup}, {"interval_us", options.interval_us}});
  write_samples_to(watcher, folder);
  return application(
      {executor(options, "stalled", "park", 0), executor(options, "watching", wait, 1)},
      {staller, watcher});
}

Finding measure_deadline(Session& session, const std::string& wait) {
  const Options& options = session.options();
  // Each period is an event, but for those with a message: twice the time and more is enough.
  const auto limit = std::chrono::seconds(10) + std::chrono::microseconds(options.interval_us) *
                                                    (options.count + options.warmup) * 2;
  const Finished finished = session.run_application(
      deadline_application(options, wait, session.folder()), {.limit = limit});
  Finding finding{.row = session.row("fastcycle-" + wait, 0),
                  .samples = session.samples_of("watcher")};
  for (measure::Sample& sample : finding.samples) {
    sample.made_ns -= finished.clock_offset_ns;
    sample.sent_ns -= finished.clock_offset_ns;
  }
  measure_into(finding.row, finding.samples, options.count, finished.usage("watcher"));
  finding.row.end_to_end.reset();
  return finding;
}

}  // namespace

Mode deadline_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = deadline_application(options, options.waits.front(), {});
  mode.title = fmt::format(
      "from the end of a deadline to its event, µs; {} events after {} of warm-up, deadline {} µs",
      options.count, options.warmup, options.interval_us);
  mode.columns = {{"peer", "peer"},           {"p50", "p50_us"},    {"p90", "p90_us"},
                  {"p99", "p99_us"},          {"p99.9", "p999_us"}, {"max", "max_us"},
                  {"p50/floor", kRatioKey, 2}};
  Point point;
  if (options.floors != "none") {
    point.steps.push_back(
        {.peer = "floor-timer", .measure = [session] { return measure_timer_floor(*session); }});
  }
  for (const std::string& wait : options.waits) {
    point.steps.push_back({.peer = "fastcycle-" + wait,
                           .measure = [session, wait] { return measure_deadline(*session, wait); },
                           .floor = "floor-timer"});
  }
  mode.points.push_back(std::move(point));
  return mode;
}

}  // namespace fastcycle::tool::bench
