#include "host/unmatched.h"

#include <limits>
#include <utility>

#include <fmt/format.h>

#include "broker/topics.h"
#include "executor/synchronizer.h"

namespace fastcycle::host {
namespace {

using detail::SynchronizerInput;
using detail::Unmatched;

double ms(std::int64_t ns) {
  return static_cast<double>(ns) / 1e6;
}

class Reasons {
 public:
  explicit Reasons(const SynchronizerInput& input)
      : input_(input),
        options_(input.synchronizer.options()),
        times_(options_.time == SyncTime::kTaken ? "taken times" : "publish times") {}

  std::vector<UnmatchedReport> find() {
    for (std::size_t other = 0; other < input_.synchronizer.input_count(); ++other) {
      add_too_far(input_.synchronizer.input(other), input_.too_far[other]);
    }
    for (std::size_t other = 0; other < input_.synchronizer.input_count(); ++other) {
      add_depth(input_.synchronizer.input(other), input_.waited[other]);
    }
    add("overtaken", count_of(Unmatched::kOvertaken),
        options_.policy == SyncPolicy::kLatest
            ? "unmatched: a newer one came before they were used"
            : "unmatched: a younger one was in a set before they were");
    add("late", count_of(Unmatched::kLate),
        fmt::format("unmatched: they came too late, with {} before that of an earlier message",
                    times_));
    add("no_message", count_of(Unmatched::kNoMessage),
        "unmatched: they came before there was a message of each other topic");
    add_waiting();
    return std::move(reasons_);
  }

 private:
  [[nodiscard]] std::uint64_t count_of(Unmatched why) const {
    return input_.unmatched[static_cast<std::size_t>(why)].get();
  }

  [[nodiscard]] static bool is_silent(const SynchronizerInput& other) {
    return other.ledger().published == 0;
  }

  void add(const char* reason, std::uint64_t count, const std::string& what) {
    if (count > 0) {
      reasons_.push_back(
          {.reason = reason, .count = count, .text = fmt::format("{} {}", count, what)});
    }
  }

  [[nodiscard]] UnmatchedReport about(const char* reason, const SynchronizerInput& other,
                                      const SynchronizerInput::Lack& lack) const {
    UnmatchedReport report{.reason = reason, .count = lack.count.get(), .topic = other.topic.name};
    const std::int64_t smallest_ns = lack.smallest_ns.load(std::memory_order_relaxed);
    if (smallest_ns != std::numeric_limits<std::int64_t>::max()) {
      report.difference_ms = ms(smallest_ns);
    }
    return report;
  }

  void add_too_far(const SynchronizerInput& other, const SynchronizerInput::Lack& lack) {
    UnmatchedReport report = about("too_far", other, lack);
    if (report.count == 0) {
      return;
    }
    if (options_.policy != SyncPolicy::kExact && report.difference_ms &&
        *report.difference_ms <= ms(options_.max_difference.count())) {
      // Some were near enough, but not free.
      report.text = fmt::format(
          "{} unmatched: each message of \"{}\" was in another set, or more than max_difference "
          "({} ms) away",
          report.count, other.topic.name, ms(options_.max_difference.count()));
      reasons_.push_back(std::move(report));
      return;
    }
    report.text = fmt::format(
        "{} unmatched: {} of \"{}\" and \"{}\" differ by at least {} ms, {}", report.count, times_,
        input_.topic.name, other.topic.name, report.difference_ms.value_or(0),
        options_.policy == SyncPolicy::kExact
            ? "the policy kExact requires equal stamps"
            : fmt::format("max_difference is {} ms", ms(options_.max_difference.count())));
    reasons_.push_back(std::move(report));
  }

  void add_depth(const SynchronizerInput& other, const SynchronizerInput::Lack& lack) {
    UnmatchedReport report = about("depth", other, lack);
    if (report.count == 0) {
      return;
    }
    const std::string head = fmt::format("{} unmatched: they waited, while {} younger ones came, ",
                                         report.count, options_.depth);
    if (is_silent(other)) {
      report.text = head + fmt::format("for \"{}\", which has had no message", other.topic.name);
    } else if (!report.difference_ms) {
      report.text = head + fmt::format("for \"{}\", which had no message yet", other.topic.name);
    } else {
      report.text = head + fmt::format("for \"{}\", whose {} are at least {} ms away",
                                       other.topic.name, times_, *report.difference_ms);
    }
    reasons_.push_back(std::move(report));
  }

  /// Messages held for a silent topic, perhaps to the end, were never unmatched.
  void add_waiting() {
    const detail::Ledger ledger = input_.ledger();
    const std::uint64_t held =
        ledger.queued + ledger.dropped[static_cast<std::size_t>(detail::DropReason::kShutdown)];
    for (std::size_t other = 0; held > 0 && other < input_.synchronizer.input_count(); ++other) {
      const SynchronizerInput& partner = input_.synchronizer.input(other);
      if (&partner != &input_ && is_silent(partner)) {
        reasons_.push_back({.reason = "waits",
                            .count = held,
                            .topic = partner.topic.name,
                            .text = fmt::format("{} waited for \"{}\", which has had no message",
                                                held, partner.topic.name)});
      }
    }
  }

  const SynchronizerInput& input_;
  const SynchronizerOptions& options_;
  const char* const times_;
  std::vector<UnmatchedReport> reasons_;
};

}  // namespace

std::vector<UnmatchedReport> find_unmatched(const detail::Subscription& subscription) {
  const auto* input = dynamic_cast<const SynchronizerInput*>(&subscription);
  return input == nullptr ? std::vector<UnmatchedReport>() : Reasons(*input).find();
}

}  // namespace fastcycle::host
