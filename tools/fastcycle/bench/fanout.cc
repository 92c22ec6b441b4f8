// fanout: what publishing costs for each further subscriber, and when the last one has it.

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "bench/modes.h"
#include "measure/statistics.h"

namespace fastcycle::tool::bench {
namespace {

std::string sink_name(std::int64_t number) {
  return fmt::format("sink_{}", number);
}

Json fanout_application(const Options& options, std::int64_t size, std::int64_t subs,
                        const std::string& wait, const std::string& folder) {
  Json its_source = source(options, size);
  its_source["params"]["stamps_publish"] = true;
  write_samples_to(its_source, folder);
  Json components = {std::move(its_source)};
  for (std::int64_t i = 0; i < subs; ++i) {
    Json its_sink = sink(options, sink_name(i), size);
    write_samples_to(its_sink, folder);
    components.push_back(std::move(its_sink));
  }
  return application({executor(options, "publisher", wait == "spin" ? "park" : wait, 1),
                      executor(options, "subscriber", wait, 0)},
                     std::move(components));
}

/// When the last of all subscribers had each message: the publisher's samples, arrived later.
class LastArrivals {
 public:
  void add(const measure::Samples& samples) {
    for (const measure::Sample& sample : samples) {
      measure::Sample& last = last_[sample.number];
      if (sample.arrived_ns > last.arrived_ns) {
        last = sample;
      }
    }
  }
  [[nodiscard]] measure::Samples samples() const {
    measure::Samples result;
    for (const auto& [number, sample] : last_) {
      result.push_back(sample);
    }
    return result;
  }

 private:
  std::map<std::int64_t, measure::Sample> last_;
};

Finding measure_fastcycle(Session& session, const std::string& wait, std::int64_t size,
                          std::int64_t subs) {
  const Finished finished = session.run_application(
      fanout_application(session.options(), size, subs, wait, session.folder()));
  const std::int64_t warmup = session.options().warmup;
  const std::int64_t sent = finished.whole("source", "sent");
  Finding finding{.row = session.row("fastcycle-" + wait, size)};
  measure_into(finding.row, session.samples_of("source"), sent, finished.usage("source"));
  LastArrivals arrivals;
  for (std::int64_t i = 0; i < subs; ++i) {
    const measure::Samples samples = session.samples_of(sink_name(i));
    finding.row.lost +=
        sent - static_cast<std::int64_t>(measure::without_warmup(samples, warmup).size());
    arrivals.add(samples);
  }
  finding.samples = arrivals.samples();
  const measure::Statistics last =
      measure::summarize(measure::transfer_ns(measure::without_warmup(finding.samples, warmup)));
  const std::int64_t damaged = finished.sum("damaged");
  finding.row.more =
      fmt::format("\"subscribers\":{},\"last_p50_us\":{:.3f},\"last_p99_us\":{:.3f},{}", subs,
                  last.p50_us, last.p99_us, damaged_json(damaged));
  finding.trouble = damaged_trouble(damaged);
  return finding;
}

/// One more subscriber costs a publish that many nanoseconds: the slope of the straight line with
/// the least squared distance to the points (subscribers, median time of publish).
double slope_ns(const std::vector<std::pair<double, double>>& points) {
  double mean_x = 0;
  double mean_y = 0;
  for (const auto& [x, y] : points) {
    mean_x += x / static_cast<double>(points.size());
    mean_y += y / static_cast<double>(points.size());
  }
  double products = 0;
  double squares = 0;
  for (const auto& [x, y] : points) {
    products += (x - mean_x) * (y - mean_y);
    squares += (x - mean_x) * (x - mean_x);
  }
  return products / squares;
}

/// Says in each row what the slope over the round's rows of the same peer and size is.
void add_slopes(std::vector<measure::Row>& rows) {
  std::map<std::pair<std::string, std::int64_t>, std::vector<std::pair<double, double>>> lines;
  for (const measure::Row& row : rows) {
    const auto json = nlohmann::json::parse(to_json(row));
    lines[{row.peer, row.size}].emplace_back(json.at("subscribers").get<double>(),
                                             json.at("p50_us").get<double>() * 1000);
  }
  for (measure::Row& row : rows) {
    const auto& points = lines[{row.peer, row.size}];
    if (std::any_of(points.begin(), points.end(),
                    [&](const auto& point) { return point.first != points.front().first; })) {
      row.more += fmt::format(",\"publish_ns_per_subscriber\":{:.1f}", slope_ns(points));
    }
  }
}

}  // namespace

Mode fanout_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = fanout_application(options, options.sizes.front(), options.subs.front(),
                                        options.waits.front(), {});
  mode.title = fmt::format(
      "the call of publish(), and from there until the last subscriber has it, µs; {} messages a "
      "point,\none each {} µs, all subscribers on one thread",
      options.count, options.interval_us);
  mode.columns = {{"size", "size"},
                  {"subscribers", "subscribers", 0},
                  {"peer", "peer"},
                  {"publish p50", "p50_us", 2},
                  {"publish p99", "p99_us", 2},
                  {"ns/subscriber", "publish_ns_per_subscriber", 1},
                  {"last p50", "last_p50_us"},
                  {"last p99", "last_p99_us"},
                  {"cpu/msg", "cpu_us_per_msg"},
                  {"lost", "lost", 0},
                  {"damaged", "damaged", 0}};
  mode.after_round = add_slopes;
  for (const std::int64_t size : options.sizes) {
    for (const std::int64_t subs : options.subs) {
      Point point;
      for (const std::string& wait : options.waits) {
        point.steps.push_back({.peer = "fastcycle-" + wait, .measure = [session, wait, size, subs] {
                                 return measure_fastcycle(*session, wait, size, subs);
                               }});
      }
      mode.points.push_back(std::move(point));
    }
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
