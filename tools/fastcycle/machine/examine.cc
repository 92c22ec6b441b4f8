#include "machine/examine.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "command.h"
#include "machine/machine.h"
#include "measure/floors.h"

namespace fastcycle::tool::machine {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kInterval_us = 1000;

/// How late threads ran in one way of waking them.
struct WakeUps {
  std::string way;
  std::vector<std::int64_t> late_ns;  ///< Sorted.

  [[nodiscard]] double us(double share) const {
    const auto last = static_cast<double>(late_ns.size() - 1);
    return static_cast<double>(late_ns[static_cast<std::size_t>(share * last)]) / 1e3;
  }
};

WakeUps sorted(std::string way, const measure::Measured& measured, std::int64_t warmup) {
  WakeUps result{std::move(way),
                 measure::transfer_ns(measure::without_warmup(measured.samples, warmup))};
  std::sort(result.late_ns.begin(), result.late_ns.end());
  return result;
}

std::vector<WakeUps> measure_wake_ups(std::chrono::nanoseconds time) {
  measure::Plan plan;
  plan.size = 64;
  plan.interval_us = kInterval_us;
  plan.warmup = 20;
  plan.count = std::max<std::int64_t>(
      10, std::chrono::duration_cast<std::chrono::microseconds>(time).count() / kInterval_us);
  std::vector<WakeUps> result;
  result.push_back(sorted("by a timer", measure::floor_timer(plan), plan.warmup));
  result.push_back(
      sorted("by a thread", measure::floor_latency(plan, measure::Waiting::kFutex), plan.warmup));
  if (measure::may_use_fifo()) {
    plan.is_fifo = true;
    result.push_back(sorted("by a timer, FIFO", measure::floor_timer(plan), plan.warmup));
    result.push_back(sorted("by a thread, FIFO",
                            measure::floor_latency(plan, measure::Waiting::kFutex), plan.warmup));
  }
  return result;
}

std::vector<Finding> worst_first() {
  const std::vector<Finding> rights = look_at_rights();
  const std::vector<Finding> kernel = look_at_kernel("/");
  std::vector<Finding> findings;
  for (const Level level : {Level::kProblem, Level::kAdvice, Level::kFine}) {
    for (const std::vector<Finding>* const some : {&rights, &kernel}) {
      std::ranges::copy_if(*some, std::back_inserter(findings),
                           [&](const Finding& finding) { return finding.level == level; });
    }
  }
  return findings;
}

std::string_view word_of(Level level) {
  switch (level) {
    case Level::kFine:
      return "ok";
    case Level::kAdvice:
      return "better";
    case Level::kProblem:
      break;
  }
  return "problem";
}

std::string text_of(const Finding& finding) {
  std::string text =
      fmt::format("  {:<8} {:<16} {}\n", word_of(finding.level), finding.name, finding.found);
  if (finding.level != Level::kFine) {
    text += fmt::format("  {:<8} {:<16}   {}\n", "", "", finding.why);
    text += fmt::format("  {:<8} {:<16}   $ {}\n", "", "", finding.remedy);
  }
  return text;
}

Json json_of(const Finding& finding) {
  Json json{{"name", finding.name}, {"level", word_of(finding.level)}, {"found", finding.found}};
  if (finding.level != Level::kFine) {
    json["why"] = finding.why;
    json["remedy"] = finding.remedy;
  }
  return json;
}

}  // namespace

int examine(std::chrono::nanoseconds time, bool is_json, Output& output) {
  const std::vector<Finding> findings = worst_first();
  Json json{{"machine", name_of_machine("/")}};
  if (!is_json) {
    output.write(name_of_machine("/") + "\n\n");
    for (const Finding& finding : findings) {
      output.write(text_of(finding));
    }
    output.write(
        fmt::format("\nHow late a thread wakes up now, one wake-up each {} ms:\n\n  {:<20} "
                    "{:>9} {:>9} {:>9}\n",
                    kInterval_us / 1000, "", "p50", "p99", "max"));
    output.flush();
  }
  for (const Finding& finding : findings) {
    json["findings"].push_back(json_of(finding));
  }
  for (const WakeUps& wake_ups : measure_wake_ups(time)) {
    json["wake_up_us"][wake_ups.way] = {{"p50", wake_ups.us(0.5)},
                                        {"p99", wake_ups.us(0.99)},
                                        {"max", wake_ups.us(1.0)},
                                        {"count", wake_ups.late_ns.size()}};
    if (!is_json) {
      output.write(fmt::format("  {:<20} {:>6.0f} µs {:>6.0f} µs {:>6.0f} µs\n", wake_ups.way,
                               wake_ups.us(0.5), wake_ups.us(0.99), wake_ups.us(1.0)));
    }
  }
  const auto problems = std::ranges::count(findings, Level::kProblem, &Finding::level);
  const auto advice = std::ranges::count(findings, Level::kAdvice, &Finding::level);
  if (is_json) {
    output.write(base::printable_json(json.dump(2, ' ', false, Json::error_handler_t::replace)) +
                 "\n");
  } else {
    output.write(fmt::format("\n{} problem{}, {} possible improvement{}\n", problems,
                             problems == 1 ? "" : "s", advice, advice == 1 ? "" : "s"));
  }
  output.flush();
  return problems > 0 ? kProblems : kDone;
}

}  // namespace fastcycle::tool::machine
