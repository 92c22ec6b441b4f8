#include "replaying_options.h"

#include <cmath>
#include <cstdint>
#include <string_view>

#include "record/recorded_schedule.h"

namespace fastcycle::tool {
namespace {

constexpr std::string_view kBecomes = ":=";
/// About a century: far from where nanoseconds overflow.
constexpr double kMaxSeconds = 3e9;

bool is_span(const std::optional<double>& seconds) {
  return !seconds || (*seconds >= 0 && *seconds <= kMaxSeconds);
}

std::optional<Duration> to_duration(const std::optional<double>& seconds) {
  return seconds ? std::optional(Duration(std::llround(*seconds * 1e9))) : std::nullopt;
}

}  // namespace

void ReplayingOptions::add_target_to(CLI::App& line) {
  line.add_option("--replay-into", into,
                  "Run only this component. Repeatable. Default: all except those that subscribe "
                  "to nothing and whose topics are in the recording")
      ->allow_extra_args(false)
      ->type_name("COMPONENT");
}

void ReplayingOptions::add_selection_to(CLI::App& line) {
  line.add_option("--start", start_s, "Start time in the recording, in seconds")->type_name("S");
  line.add_option("--end", end_s, "End time in the recording, in seconds")->type_name("S");
  line.add_flag("--loop", is_looped, "Repeat from the start at the end");
  line.add_option("--topics", topics,
                  "Only these topics of the recording: control/*, camera/**, including topics "
                  "without a subscriber at the start. Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line.add_option("--except", except, "Omit topics that match. Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line.add_option("--remap", remap, "Rename topic OLD of the recording to NEW. Repeatable")
      ->allow_extra_args(false)
      ->type_name("OLD:=NEW");
}

std::string ReplayingOptions::find_wrong() const {
  if (files.empty() && !into.empty()) {
    return "--replay-into requires --replay FILE";
  }
  if (const std::string twice = record::find_named_twice(files); !twice.empty()) {
    return twice + ": each of its messages would be published twice";
  }
  if (!is_span(start_s) || !is_span(end_s)) {
    return "--start and --end expect seconds from 0 on";
  }
  if (end_s && *end_s <= start_s.value_or(0)) {
    return "--end must be after --start";
  }
  for (const std::string& rule : remap) {
    const auto at = rule.find(kBecomes);
    if (at == std::string::npos || at == 0 || at + kBecomes.size() == rule.size()) {
      return "--remap expects OLD:=NEW, and not \"" + rule + "\"";
    }
  }
  return {};
}

host::ReplayOptions ReplayingOptions::describe() const {
  host::ReplayOptions options;
  options.files = files;
  options.into = into;
  options.filter = {.topics = topics, .except = except};
  for (const std::string& rule : remap) {
    const auto at = rule.find(kBecomes);
    options.remap[rule.substr(0, at)] = rule.substr(at + kBecomes.size());
  }
  options.start = to_duration(start_s);
  options.end = to_duration(end_s);
  options.is_looped = is_looped;
  return options;
}

}  // namespace fastcycle::tool
