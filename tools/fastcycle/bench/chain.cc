// chain: a message that leads to a message, several times; from the first publish to the last
// callback.

#include <cstdint>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "bench/modes.h"

namespace fastcycle::tool::bench {
namespace {

/// Components in a row: a source, relays, a sink, on one executor of one thread, or in turn on two.
Json chain_application(const Options& options, std::int64_t size, std::int64_t hops,
                       std::int64_t executors, const std::string& wait, const std::string& folder) {
  const auto topic = [](std::int64_t hop) { return fmt::format("hop_{}", hop); };
  const auto place = [&](std::int64_t component) {
    return component % executors == 0 ? "publisher" : "subscriber";
  };
  Json its_source = source(options, size);
  its_source["remap"] = {{"payload", topic(1)}};
  Json components = {std::move(its_source)};
  for (std::int64_t hop = 1; hop < hops; ++hop) {
    Json relay = component(fmt::format("relay_{}", hop), "benchmark_relay", place(hop),
                           {{"size_bytes", size}});
    relay["remap"] = {{"in", topic(hop)}, {"out", topic(hop + 1)}};
    relay["subscribers"]["in"]["depth"] = depth_for(size);
    components.push_back(std::move(relay));
  }
  Json its_sink = sink(options, "sink", size);
  its_sink["executor"] = place(hops);
  its_sink["remap"] = {{"payload", topic(hops)}};
  write_samples_to(its_sink, folder);
  components.push_back(std::move(its_sink));

  Json first = executor(options, "publisher", wait, 1);
  first["hand_over"] = true;
  if (executors == 1) {
    return application({first}, std::move(components));
  }
  return application({first, executor(options, "subscriber", wait, 0)}, std::move(components));
}

Finding measure_fastcycle(Session& session, const std::string& wait, std::int64_t size,
                          std::int64_t hops, std::int64_t executors) {
  const Finished finished = session.run_application(
      chain_application(session.options(), size, hops, executors, wait, session.folder()));
  Finding finding{.row = session.row("fastcycle-" + wait, size),
                  .samples = session.samples_of("sink")};
  measure_into(finding.row, finding.samples, finished.whole("source", "sent"),
               finished.usage("source"));
  const std::int64_t damaged = finished.sum("damaged");
  finding.row.more =
      fmt::format("\"hops\":{},\"executors\":{},{}", hops, executors, damaged_json(damaged));
  finding.trouble = damaged_trouble(damaged);
  return finding;
}

/// One hand-over between two threads; the ratio takes it as many times as there are hops.
Finding measure_floor(const Session& session, const std::string& peer, std::int64_t size) {
  const measure::Measured measured =
      floor_latency(session.plan(size),
                    peer == "floor-spin" ? measure::Waiting::kSpin : measure::Waiting::kFutex);
  Finding finding{.row = session.row(peer, size), .samples = measured.samples};
  measure_into(finding.row, measured.samples, session.options().count, measured.usage);
  finding.row.more = "\"hops\":1";
  return finding;
}

std::string floor_of(const std::string& wait) {
  return wait == "spin" ? "floor-spin" : "floor-futex";
}

Point make_point(const Options& options, Session* session, std::int64_t size, std::int64_t hops) {
  Point point{.steps = {}, .floor_times = static_cast<double>(hops)};
  for (const std::string floor : {"floor-futex", "floor-spin"}) {
    for (const std::string& wait : options.waits) {
      if (options.floors != "none" && floor == floor_of(wait)) {
        point.steps.push_back({.peer = floor, .measure = [session, floor, size] {
                                 return measure_floor(*session, floor, size);
                               }});
        break;
      }
    }
  }
  for (const std::string& wait : options.waits) {
    for (const std::int64_t executors : {1, 2}) {
      point.steps.push_back({.peer = "fastcycle-" + wait,
                             .measure =
                                 [session, wait, size, hops, executors] {
                                   return measure_fastcycle(*session, wait, size, hops, executors);
                                 },
                             .floor = floor_of(wait)});
    }
  }
  return point;
}

}  // namespace

Mode chain_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = chain_application(options, options.sizes.front(), options.hops.front(), 2,
                                       options.waits.front(), {});
  mode.title = fmt::format(
      "from the first publish to the last callback, µs; {} messages a point after {} of warm-up,\n"
      "one each {} µs; the floor is one hand-over, the ratio is to as many as there are hops",
      options.count, options.warmup, options.interval_us);
  mode.columns = {{"size", "size"},    {"hops", "hops", 0},       {"executors", "executors", 0},
                  {"peer", "peer"},    {"p50", "p50_us"},         {"p90", "p90_us"},
                  {"p99", "p99_us"},   {"max", "max_us"},         {"cpu/msg", "cpu_us_per_msg"},
                  {"lost", "lost", 0}, {"damaged", "damaged", 0}, {"p50/floors", kRatioKey, 2}};
  for (const std::int64_t size : options.sizes) {
    for (const std::int64_t hops : options.hops) {
      mode.points.push_back(make_point(options, session, size, hops));
    }
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
