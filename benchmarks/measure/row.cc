#include "measure/row.h"

#include <fmt/format.h>

namespace fastcycle::measure {

std::string to_json(const Row& row) {
  std::string text = fmt::format(
      R"({{"peer":"{}","mode":"{}","size":{},"round":{},"n":{},"lost":{},"warmup":{},"interval_us":{})",
      row.peer, row.mode, row.size, row.round, row.n, row.lost, row.warmup, row.interval_us);
  if (const auto& time = row.time) {
    text += fmt::format(
        R"(,"mean_us":{:.3f},"std_us":{:.3f},"min_us":{:.3f},"p50_us":{:.3f},"p90_us":{:.3f})"
        R"(,"p99_us":{:.3f},"p999_us":{:.3f},"max_us":{:.3f})",
        time->mean_us, time->std_us, time->min_us, time->p50_us, time->p90_us, time->p99_us,
        time->p999_us, time->max_us);
  }
  if (const auto& whole = row.end_to_end) {
    text += fmt::format(R"(,"e2e_p50_us":{:.3f},"e2e_p99_us":{:.3f},"e2e_mean_us":{:.3f})",
                        whole->p50_us, whole->p99_us, whole->mean_us);
  }
  if (row.interval_std_us) {
    text += fmt::format(R"(,"interval_std_us":{:.3f})", *row.interval_std_us);
  }
  if (row.sent) {
    text += fmt::format(R"(,"sent":{})", *row.sent);
  }
  if (row.received) {
    text += fmt::format(R"(,"received":{})", *row.received);
  }
  if (row.rate_per_s) {
    text += fmt::format(R"(,"rate_per_s":{:.0f})", *row.rate_per_s);
  }
  if (row.cpu_us_per_msg) {
    text += fmt::format(R"(,"cpu_us_per_msg":{:.3f})", *row.cpu_us_per_msg);
  }
  if (const auto& usage = row.usage) {
    text += fmt::format(
        R"(,"minor_faults":{},"major_faults":{},"voluntary_switches":{},"involuntary_switches":{})",
        usage->minor_faults, usage->major_faults, usage->voluntary_switches,
        usage->involuntary_switches);
  }
  if (!row.histogram.empty()) {
    text += ",\"histogram_us\":" + row.histogram;
  }
  if (!row.more.empty()) {
    text += "," + row.more;
  }
  return text + "}";
}

void measure_into(Row& row, const Samples& samples, std::int64_t sent, const Usage& usage) {
  const Samples measured = without_warmup(samples, row.warmup);
  const auto transfer = transfer_ns(measured);
  row.n = static_cast<std::int64_t>(measured.size());
  row.lost = sent - row.n;
  row.time = summarize(transfer);
  row.end_to_end = summarize(end_to_end_ns(measured));
  row.interval_std_us = summarize(interval_error_ns(measured)).std_us;
  row.histogram = histogram_json(transfer);
  row.usage = usage;
  row.cpu_us_per_msg = sent > 0 ? usage.cpu_us / static_cast<double>(sent) : 0.0;
}

}  // namespace fastcycle::measure
