// timer: how late timers are called, and that they do not drift.

#include <cstdint>
#include <string>

#include <fmt/format.h>

#include "bench/modes.h"

namespace fastcycle::tool::bench {
namespace {

Json timer_application(const Options& options, const std::string& wait, const std::string& folder) {
  Json its_timer = component(
      "timer", "benchmark_timer", "timers",
      {{"count", options.count}, {"warmup", options.warmup}, {"interval_us", options.interval_us}});
  write_samples_to(its_timer, folder);
  return application({executor(options, "timers", wait, 0)}, {its_timer});
}

/// How far the last due time is from where whole periods lead: 0, to the nanosecond.
std::int64_t drift_ns(const Finished& finished, std::int64_t interval_us) {
  const std::int64_t skipped =
      finished.whole("timer", "skipped") - finished.whole("timer", "skipped_at_first");
  const std::int64_t periods = finished.whole("timer", "ticks") - 1 + skipped;
  return finished.whole("timer", "last_due_ns") - finished.whole("timer", "first_due_ns") -
         periods * interval_us * 1000;
}

void add_drift(Finding& finding, const Finished& finished, std::int64_t interval_us) {
  const std::int64_t drift = drift_ns(finished, interval_us);
  finding.row.more =
      fmt::format("\"drift_us\":{},\"overruns\":{}", static_cast<double>(drift) / 1000,
                  finished.whole("timer", "skipped"));
  if (drift != 0) {
    finding.trouble = fmt::format("the timer drifted by {} ns", drift);
  }
}

Finding measure_live(Session& session, const std::string& wait) {
  const Finished finished =
      session.run_application(timer_application(session.options(), wait, session.folder()));
  Finding finding{.row = session.row("fastcycle-" + wait, 0),
                  .samples = session.samples_of("timer")};
  // Due times are the application's; its clock is CLOCK_MONOTONIC plus an offset that is fixed.
  for (measure::Sample& sample : finding.samples) {
    sample.made_ns -= finished.clock_offset_ns;
    sample.sent_ns -= finished.clock_offset_ns;
  }
  measure_into(finding.row, finding.samples, session.options().count, finished.usage("timer"));
  finding.row.end_to_end.reset();
  add_drift(finding, finished, session.options().interval_us);
  return finding;
}

Finding measure_simulated(Session& session) {
  const Finished finished =
      session.run_application(timer_application(session.options(), "park", {}),
                              {.clock = {.is_simulated = true, .rate = 1.0, .workers = 1}});
  const std::int64_t periods = finished.whole("timer", "ticks");
  const std::int64_t end_ns = finished.whole("timer", "last_due_ns");
  Finding finding{.row = session.row("fastcycle-simulated", 0)};
  finding.row.n = periods - session.options().warmup;
  finding.row.lost = session.options().count - finding.row.n;
  add_drift(finding, finished, session.options().interval_us);
  finding.row.more += fmt::format(",\"periods\":{},\"end_us\":{},\"wall_s\":{:.3f}", periods,
                                  static_cast<double>(end_ns) / 1000, finished.report.wall_s);
  if (finding.trouble.empty() && end_ns != periods * session.options().interval_us * 1000) {
    finding.trouble = fmt::format("{} periods ended at {} ns", periods, end_ns);
  }
  return finding;
}

}  // namespace

Finding measure_timer_floor(const Session& session) {
  const measure::Measured measured = floor_timer(session.plan(0));
  Finding finding{.row = session.row("floor-timer", 0), .samples = measured.samples};
  measure_into(finding.row, measured.samples, session.options().count, measured.usage);
  finding.row.end_to_end.reset();
  return finding;
}

Mode timer_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = timer_application(options, options.waits.front(), {});
  if (options.is_simulated()) {
    mode.title =
        fmt::format("{} periods of {} µs in simulated time", options.count, options.interval_us);
    mode.columns = {{"peer", "peer"},
                    {"periods", "periods", 0},
                    {"end µs", "end_us", 3},
                    {"drift µs", "drift_us", 3},
                    {"overruns", "overruns", 0},
                    {"wall s", "wall_s", 3}};
    mode.points = {{.steps = {{.peer = "fastcycle-simulated",
                               .measure = [session] { return measure_simulated(*session); }}}}};
    return mode;
  }
  mode.title =
      fmt::format("from due time to callback, µs; {} ticks after {} of warm-up, period {} µs",
                  options.count, options.warmup, options.interval_us);
  mode.columns = {{"peer", "peer"},
                  {"p50", "p50_us"},
                  {"p90", "p90_us"},
                  {"p99", "p99_us"},
                  {"p99.9", "p999_us"},
                  {"max", "max_us"},
                  {"cpu/tick", "cpu_us_per_msg"},
                  {"drift", "drift_us", 3},
                  {"overruns", "overruns", 0},
                  {"p50/floor", kRatioKey, 2}};
  Point point;
  if (options.floors != "none") {
    point.steps.push_back(
        {.peer = "floor-timer", .measure = [session] { return measure_timer_floor(*session); }});
  }
  for (const std::string& wait : options.waits) {
    point.steps.push_back({.peer = "fastcycle-" + wait,
                           .measure = [session, wait] { return measure_live(*session, wait); },
                           .floor = "floor-timer"});
  }
  mode.points.push_back(std::move(point));
  return mode;
}

}  // namespace fastcycle::tool::bench
