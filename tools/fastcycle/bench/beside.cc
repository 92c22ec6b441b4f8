#include "bench/beside.h"

#include <map>
#include <utility>

#include <fmt/format.h>

#include "measure/statistics.h"

namespace fastcycle::tool::bench {

Json application_beside(const Options& options, std::int64_t size, const std::string& wait,
                        const std::string& folder) {
  Json its_source = source(options, size);
  Json its_sink = sink(options, "sink", size);
  its_source["params"]["stamps_publish"] = true;
  write_samples_to(its_source, folder);
  write_samples_to(its_sink, folder);
  return application({executor(options, "publisher", wait == "spin" ? "park" : wait, 1),
                      executor(options, "subscriber", wait, 0)},
                     {its_source, its_sink});
}

Finding finding_beside(const Session& session, std::string_view what, const std::string& wait,
                       std::int64_t size, const Finished& finished) {
  Finding finding{.row = session.row(fmt::format("{}-{}", what, wait), size),
                  .samples = session.samples_of("sink")};
  measure_into(finding.row, finding.samples, finished.whole("source", "sent"),
               finished.usage("source"));
  const measure::Statistics publish = measure::summarize(measure::transfer_ns(
      measure::without_warmup(session.samples_of("source"), session.options().warmup)));
  const std::int64_t damaged = finished.sum("damaged");
  finding.row.more = fmt::format("\"publish_p50_us\":{:.3f},\"publish_p99_us\":{:.3f},{}",
                                 publish.p50_us, publish.p99_us, damaged_json(damaged));
  finding.trouble = damaged_trouble(damaged);
  return finding;
}

void for_each_beside(std::vector<measure::Row>& rows, const BesideVisitor& visit) {
  const auto wait_of = [](const measure::Row& row) {
    return row.peer.substr(row.peer.rfind('-') + 1);
  };
  std::map<std::pair<std::int64_t, std::string>, nlohmann::json> without;
  for (const measure::Row& row : rows) {
    if (row.peer.starts_with(kWithout)) {
      without[{row.size, wait_of(row)}] = nlohmann::json::parse(to_json(row));
    }
  }
  for (measure::Row& row : rows) {
    const auto found = without.find({row.size, wait_of(row)});
    if (!row.peer.starts_with(kWithout) && found != without.end()) {
      visit(row, nlohmann::json::parse(to_json(row)), found->second);
    }
  }
}

void add_ratios(std::vector<measure::Row>& rows) {
  for_each_beside(
      rows, [](measure::Row& row, const nlohmann::json& with, const nlohmann::json& without) {
        for (const char* const key : {"p99_us", "publish_p99_us"}) {
          if (const auto its = without.at(key).get<double>(); its > 0) {
            row.more += fmt::format(",\"{}_ratio\":{:.3f}", key, with.at(key).get<double>() / its);
          }
        }
      });
}

}  // namespace fastcycle::tool::bench
