// latency: from publish to callback. rtt: there and back.

#include <string>
#include <utility>

#include <fmt/format.h>

#include "bench/modes.h"
#include "measure/queue_floors.h"

namespace fastcycle::tool::bench {
namespace {

/// The publisher's way of waiting: in "latency" it sleeps between its messages anyway, as the
/// floor's sender does.
std::string publisher_wait(const std::string& wait, bool is_rtt) {
  return wait == "spin" && !is_rtt ? "park" : wait;
}

Json latency_application(const Options& options, std::int64_t size, const std::string& wait,
                         const std::string& folder) {
  const bool is_rtt = options.mode == "rtt";
  Json its_source = source(options, size);
  Json its_sink = sink(options, "sink", size);
  if (is_rtt) {
    its_source["params"]["takes_echo"] = true;
    its_source["subscribers"]["echo"]["depth"] = depth_for(size);
    its_sink["params"]["echoes"] = true;
  }
  write_samples_to(is_rtt ? its_source : its_sink, folder);
  Json subscriber = executor(options, "subscriber", wait, 0);
  if (options.slice_us != 0) {
    subscriber["slice_us"] = options.slice_us;
  }
  return application(
      {executor(options, "publisher", publisher_wait(wait, is_rtt), 1), std::move(subscriber)},
      {its_source, its_sink});
}

Finding measure_floor(const Session& session, const std::string& peer,
                      const measure::Measured& measured, std::int64_t size) {
  Finding finding{.row = session.row(peer, size), .samples = measured.samples};
  measure_into(finding.row, measured.samples, session.options().count, measured.usage);
  return finding;
}

/// The subscriber in its own process, or, where the publisher is not trusted, the publisher: then
/// messages are serialized. CPU time is that of the publisher's process.
Finding measure_processes(Session& session, const std::string& peer, const std::string& wait,
                          std::int64_t size, bool is_trusted) {
  Json described = latency_application(session.options(), size, wait, session.folder());
  if (is_trusted) {
    described["components"][1]["process"] = "subscriber";
  } else {
    described["components"][0]["process"] = "publisher";
    described["processes"] = {{{"name", "publisher"}, {"trusted", false}}};
  }
  const Json report = run_program(described, session.folder());
  Finding finding{.row = session.row(peer, size), .samples = session.samples_of("sink")};
  const Json& results = report["results"];
  measure::Usage usage;
  usage.cpu_us = results["cpu_us"].get<double>();
  measure_into(finding.row, finding.samples, results["sent"].get<std::int64_t>(), usage);
  std::int64_t damaged = 0;
  for (const auto& [name, value] : results.items()) {
    damaged += name.ends_with("damaged") ? value.get<std::int64_t>() : 0;
  }
  std::int64_t copied = 0;
  for (const Json& process : report["processes"]) {
    for (const Json& link : process["links"]) {
      copied += link["copied"].get<std::int64_t>() + link["unshared"].get<std::int64_t>();
    }
  }
  finding.row.more = damaged_json(damaged) + fmt::format(",\"copied\":{}", copied);
  finding.trouble = damaged_trouble(damaged);
  return finding;
}

Finding measure_latency(Session& session, const std::string& wait, std::int64_t size) {
  const bool is_rtt = session.options().mode == "rtt";
  const Finished finished =
      session.run_application(latency_application(session.options(), size, wait, session.folder()));
  Finding finding{.row = session.row("fastcycle-" + wait, size),
                  .samples = session.samples_of(is_rtt ? "source" : "sink")};
  measure_into(finding.row, finding.samples, finished.whole("source", "sent"),
               finished.usage("source"));
  const std::int64_t damaged = finished.sum("damaged");
  finding.row.more = damaged_json(damaged);
  finding.trouble = damaged_trouble(damaged);
  return finding;
}

Point make_point(const Options& options, Session* session, std::int64_t size) {
  Point point;
  const bool is_rtt = options.mode == "rtt";
  const auto floor = is_rtt ? &measure::floor_rtt : &measure::floor_latency;
  const auto add_floor = [&](const std::string& peer, const auto& run) {
    if (options.floors != "none") {
      point.steps.push_back({.peer = peer, .measure = [session, peer, size, run] {
                               return measure_floor(*session, peer, run(session->plan(size)), size);
                             }});
    }
  };
  const auto uses = [&](bool is_spin) {
    for (const std::string& wait : options.waits) {
      if ((wait == "spin") == is_spin) {
        return true;
      }
    }
    return options.floors == "all";
  };
  if (uses(false)) {
    add_floor("floor-futex",
              [floor](const measure::Plan& plan) { return floor(plan, measure::Waiting::kFutex); });
  }
  if (uses(true)) {
    add_floor("floor-spin",
              [floor](const measure::Plan& plan) { return floor(plan, measure::Waiting::kSpin); });
  }
  if (options.floors == "all" && !is_rtt) {
    add_floor("floor-malloc", &measure::floor_malloc);
  }
  if (options.has_processes) {
    for (const std::string& wait : options.waits) {
      const bool is_spin = wait == "spin";
      const std::string name = is_spin ? "floor-processes-spin" : "floor-processes";
      if (point.steps.empty() || point.steps.back().peer != name) {
        add_floor(name, [is_spin](const measure::Plan& plan) {
          return measure::floor_processes(
              plan, is_spin ? measure::Waiting::kSpin : measure::Waiting::kFutex);
        });
      }
      for (const bool is_trusted : {true, false}) {
        const std::string peer = (is_trusted ? "processes-" : "serialized-") + wait;
        point.steps.push_back({.peer = peer,
                               .measure =
                                   [session, peer, wait, size, is_trusted] {
                                     return measure_processes(*session, peer, wait, size,
                                                              is_trusted);
                                   },
                               .floor = name});
      }
    }
  }
  for (const std::string& wait : options.waits) {
    point.steps.push_back(
        {.peer = "fastcycle-" + wait,
         .measure = [session, wait, size] { return measure_latency(*session, wait, size); },
         .floor = wait == "spin" ? "floor-spin" : "floor-futex"});
  }
  return point;
}

}  // namespace

Mode latency_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = latency_application(options, options.sizes.front(), options.waits.front(), {});
  mode.title = fmt::format("{}, µs; {} messages a point after {} of warm-up, one each {} µs",
                           options.mode == "rtt" ? "there and back" : "from publish to callback",
                           options.count, options.warmup, options.interval_us);
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"p50", "p50_us"},
                  {"p90", "p90_us"},
                  {"p99", "p99_us"},
                  {"p99.9", "p999_us"},
                  {"max", "max_us"},
                  {"mean", "mean_us"},
                  {"sd", "std_us"},
                  {"with fill", "e2e_p50_us"},
                  {"cpu/msg", "cpu_us_per_msg"},
                  {"lost", "lost", 0},
                  {"damaged", "damaged", 0},
                  {"p50/floor", kRatioKey, 2}};
  if (options.has_processes) {
    mode.columns.insert(mode.columns.end() - 1, {"copied", "copied", 0});
  }
  for (const std::int64_t size : options.sizes) {
    mode.points.push_back(make_point(options, session, size));
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
