// flood: as many messages a second as go through.

#include <algorithm>
#include <cstdint>
#include <string>

#include <fmt/format.h>

#include "bench/modes.h"
#include "measure/queue_floors.h"

namespace fastcycle::tool::bench {
namespace {

Json flood_application(const Options& options, std::int64_t size, const std::string& wait) {
  Json its_source = component("source", "benchmark_flood", "publisher",
                              {{"size_bytes", size},
                               {"count", options.count},
                               {"run_in_ms", options.has_no_credits ? 0 : measure::kRunInMs},
                               {"window", options.window},
                               {"waits_for_credits", !options.has_no_credits}});
  its_source["class"] = "FloodSource";
  Json its_sink =
      component("sink", "benchmark_flood", "subscriber",
                {{"window", options.window}, {"gives_credits", !options.has_no_credits}});
  its_sink["class"] = "FloodSink";
  its_sink["subscribers"]["payload"]["depth"] = options.window;
  return application(
      {executor(options, "publisher", wait, 1), executor(options, "subscriber", wait, 0)},
      {its_source, its_sink});
}

void set_rate(measure::Row& row, std::int64_t run_in, std::int64_t sent, std::int64_t received,
              std::int64_t begin_ns, std::int64_t end_ns, const measure::Usage& usage) {
  row.warmup = run_in;
  row.n = received;
  row.lost = sent - received;
  row.sent = sent;
  row.received = received;
  row.interval_us = 0;
  if (end_ns > begin_ns) {
    row.rate_per_s = static_cast<double>(received) * 1e9 / static_cast<double>(end_ns - begin_ns);
  }
  row.usage = usage;
  row.cpu_us_per_msg = usage.cpu_us / static_cast<double>(std::max<std::int64_t>(received, 1));
}

constexpr const char* kDeque = "floor-mutex-deque";
constexpr const char* kRing = "floor-ring";

Finding measure_queue(const Session& session, const std::string& peer, std::int64_t size) {
  const measure::Flood flood = (peer == kRing ? measure::floor_ring_flood : measure::floor_flood)(
      session.plan(size), session.options().window, measure::kRunInMs);
  Finding finding{.row = session.row(peer, size)};
  set_rate(finding.row, flood.run_in, flood.sent, flood.received, flood.first_sent_ns,
           flood.last_received_ns, flood.usage);
  finding.row.more =
      fmt::format("\"window\":{},{}", session.options().window, damaged_json(flood.damaged));
  finding.trouble = damaged_trouble(flood.damaged);
  return finding;
}

/// The run's ledger of the payloads.
const detail::Ledger& ledger_of(const host::RunReport& report) {
  const auto topic =
      std::find_if(report.topics.begin(), report.topics.end(),
                   [](const host::TopicReport& other) { return other.name == "payload"; });
  return topic->subscribers.front().ledger;
}

std::string ledger_json(const detail::Ledger& ledger) {
  std::string dropped;
  for (std::size_t i = 0; i < ledger.dropped.size(); ++i) {
    dropped += fmt::format("{}\"{}\":{}", i == 0 ? "" : ",",
                           to_word(static_cast<detail::DropReason>(i)), ledger.dropped[i]);
  }
  return fmt::format("\"dropped\":{{{}}},\"queued\":{}", dropped, ledger.queued);
}

/// Whether what the run counted is what the components counted.
std::string find_miscount(const detail::Ledger& ledger, std::int64_t sent, std::int64_t received) {
  if (ledger.adds_up() && ledger.published == static_cast<std::uint64_t>(sent) &&
      ledger.delivered == static_cast<std::uint64_t>(received)) {
    return {};
  }
  return fmt::format(
      "the ledger does not add up: sent {}, published {}, received {}, delivered {}, dropped {}, "
      "queued {}",
      sent, ledger.published, received, ledger.delivered, ledger.dropped_total(), ledger.queued);
}

Finding measure_flood(Session& session, const std::string& wait, std::int64_t size) {
  const Finished finished =
      session.run_application(flood_application(session.options(), size, wait));
  const std::int64_t run_in = finished.whole("source", "run_in");
  const std::int64_t sent = finished.whole("source", "sent");
  const std::int64_t received = finished.whole("sink", "received") - run_in;
  const std::int64_t damaged = finished.whole("sink", "damaged");
  const detail::Ledger& ledger = ledger_of(finished.report);
  Finding finding{.row = session.row("fastcycle-" + wait, size)};
  set_rate(finding.row, run_in, sent, received, finished.whole("source", "first_sent_ns"),
           finished.whole("sink", "last_received_ns"), finished.usage("source"));
  finding.row.more = fmt::format("\"window\":{},{},{}", session.options().window,
                                 damaged_json(damaged), ledger_json(ledger));
  finding.trouble = damaged_trouble(damaged);
  if (finding.trouble.empty()) {
    finding.trouble = find_miscount(ledger, run_in + sent, run_in + received);
  }
  return finding;
}

}  // namespace

Mode flood_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = flood_application(options, options.sizes.front(), options.waits.front());
  mode.title = fmt::format("{} messages as fast as possible, {}", options.count,
                           options.has_no_credits
                               ? "without regard for the receiver"
                               : fmt::format("at most {} under way, after a run-in of {} ms",
                                             options.window, measure::kRunInMs));
  mode.ratio_of = "rate_per_s";
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"messages/s", "rate_per_s", 0},
                  {"sent", "sent", 0},
                  {"received", "received", 0},
                  {"lost", "lost", 0},
                  {"damaged", "damaged", 0},
                  {"cpu µs/msg", "cpu_us_per_msg", 3},
                  {"rate/floor", kRatioKey, 2}};
  for (const std::int64_t size : options.sizes) {
    Point point;
    // A queue that grows without bound is no floor of anything.
    if (options.floors != "none" && !options.has_no_credits) {
      for (const char* peer : {kDeque, kRing}) {
        if (peer == kDeque || options.floors == "all") {
          point.steps.push_back({.peer = peer, .measure = [session, peer, size] {
                                   return measure_queue(*session, peer, size);
                                 }});
        }
      }
    }
    for (const std::string& wait : options.waits) {
      point.steps.push_back(
          {.peer = "fastcycle-" + wait,
           .measure = [session, wait, size] { return measure_flood(*session, wait, size); },
           .floor = kDeque});
    }
    mode.points.push_back(std::move(point));
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
