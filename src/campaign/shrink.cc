#include "campaign/shrink.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;
using Messages = std::vector<std::uint64_t>;

/// One search.
class Shrinker {
 public:
  Shrinker(Faults faults, Verdict verdict, const TryAll& try_all, std::size_t most_runs)
      : try_all_(try_all), most_runs_(most_runs) {
    best_.faults = std::move(faults);
    best_.verdict = std::move(verdict);
  }

  Shrunk run() {
    take_first({Faults()});  // Else the last one left would be blamed for what it has no part in.
    leave_out_faults();
    for (std::size_t i = 0; i < best_.faults.size(); ++i) {
      if (!name_messages(i)) {
        shorten_time(i);
        if (name_messages(i)) {
          leave_out_messages(i);
        }
      } else {
        leave_out_messages(i);
      }
      lessen(i);
    }
    if (best_.faults.size() > 1) {
      leave_out_faults();
    }
    best_.is_smallest = !is_ended_;
    return std::move(best_);
  }

 private:
  /// Tries all of `lists`; the first that fails as the whole did is the best from then on.
  bool take_first(const std::vector<Faults>& lists) {
    if (lists.empty() || is_ended_) {
      return false;
    }
    if (best_.runs + lists.size() > most_runs_) {
      is_ended_ = true;
      return false;
    }
    std::vector<Verdict> verdicts = try_all_(lists);
    best_.runs += verdicts.size();
    is_ended_ = verdicts.size() < lists.size();
    for (std::size_t i = 0; i < verdicts.size(); ++i) {
      if (verdicts[i].way == best_.verdict.way) {
        best_.faults = lists[i];
        best_.verdict = std::move(verdicts[i]);
        taken_ = i;
        return true;
      }
    }
    return false;
  }

  void leave_out_faults() {
    for (bool is_smaller = true; is_smaller && best_.faults.size() > 1;) {
      std::vector<Faults> lists;
      for (std::size_t i = 0; i < best_.faults.size(); ++i) {
        lists.push_back(best_.faults);
        lists.back().erase(lists.back().begin() + static_cast<std::ptrdiff_t>(i));
      }
      is_smaller = take_first(lists);
    }
  }

  [[nodiscard]] Faults with(std::size_t place, ordered_json fault) const {
    Faults faults = best_.faults;
    faults[place].json = std::move(fault);
    return faults;
  }

  /// Puts the messages that the fault affected in the place of times and chance.
  bool name_messages(std::size_t place) {
    const ordered_json& fault = best_.faults[place].json;
    const ordered_json& report = best_.verdict.report;
    if (!report.is_object() || !report.contains("faults") || !fault.contains("topic")) {
      return false;  // As after a crash.
    }
    for (const ordered_json& one : report["faults"]) {
      if (one.value("name", "") != fault.value("name", "")) {
        continue;
      }
      const Messages messages = one.value("messages", Messages());
      if (messages.empty() || messages.size() != one.value("count", std::size_t{0})) {
        return false;
      }
      return take_first({with(place, naming(fault, messages))});
    }
    return false;
  }

  static ordered_json naming(ordered_json fault, const Messages& messages) {
    for (const char* key : {"from_s", "to_s", "probability"}) {
      fault.erase(key);
    }
    fault["messages"] = messages;
    return fault;
  }

  /// Delta debugging (Zeller and Hildebrandt 2002): halves, quarters, and so on, and what is left
  /// without them.
  void leave_out_messages(std::size_t place) {
    auto messages = best_.faults[place].json["messages"].get<Messages>();
    std::size_t parts = 2;
    while (messages.size() > 1 && !is_ended_) {
      parts = std::min(parts, messages.size());
      std::vector<Messages> tried;
      for (const bool is_complement : {false, true}) {
        for (std::size_t i = 0; i < parts && (parts > 2 || !is_complement); ++i) {
          const auto begin = static_cast<std::ptrdiff_t>(i * messages.size() / parts);
          const auto end = static_cast<std::ptrdiff_t>((i + 1) * messages.size() / parts);
          Messages part(messages.begin() + begin, messages.begin() + end);
          if (is_complement) {
            part = messages;
            part.erase(part.begin() + begin, part.begin() + end);
          }
          tried.push_back(std::move(part));
        }
      }
      std::vector<Faults> lists;
      for (const Messages& part : tried) {
        lists.push_back(with(place, naming(best_.faults[place].json, part)));
      }
      if (take_first(lists)) {
        const bool was_complement = taken_ >= parts;
        messages = tried[taken_];
        parts = was_complement ? std::max<std::size_t>(parts - 1, 2) : 2;
      } else if (parts >= messages.size()) {
        return;
      } else {
        parts *= 2;
      }
    }
  }

  void shorten_time(std::size_t place) {
    if (!has_duration(best_.faults[place].json)) {
      return;
    }
    for (int i = 0; i < 12; ++i) {
      const ordered_json& fault = best_.faults[place].json;
      const double from = fault.value("from_s", 0.0);
      const ordered_json& report = best_.verdict.report;
      const double end = report.is_object() ? report.value("time_s", from) : from;
      const double to = fault.value("to_s", end);
      const double middle = std::round((from + to) * 500.0) / 1000.0;
      if (middle <= from || middle >= to) {
        return;
      }
      ordered_json early = fault;
      early["to_s"] = middle;
      ordered_json late = fault;
      late["from_s"] = middle;
      if (!take_first({with(place, std::move(early)), with(place, std::move(late))})) {
        return;
      }
    }
  }

  /// Halves a delay, or the time of a slow turn or a hang.
  void lessen(std::size_t place) {
    for (int i = 0; i < 6; ++i) {
      ordered_json fault = best_.faults[place].json;
      if (!fault.contains("by_ms")) {
        return;
      }
      const double half = std::round(fault["by_ms"].get<double>() * 500.0) / 1000.0;
      if (half < 0.001) {
        return;
      }
      fault["by_ms"] = half;
      if (!take_first({with(place, std::move(fault))})) {
        return;
      }
    }
  }

  static bool has_duration(const ordered_json& fault) {
    return fault.contains("topic") || fault.value("kind", "") == "slow";
  }

  const TryAll& try_all_;
  const std::size_t most_runs_;
  Shrunk best_;
  std::size_t taken_ = 0;
  bool is_ended_ = false;
};

}  // namespace

Shrunk shrink(Faults faults, Verdict verdict, const TryAll& try_all, std::size_t most_runs) {
  return Shrinker(std::move(faults), std::move(verdict), try_all, most_runs).run();
}

}  // namespace fastcycle::campaign
