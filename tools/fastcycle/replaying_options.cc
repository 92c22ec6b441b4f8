#include "replaying_options.h"

#include <cmath>
#include <cstdint>
#include <string_view>

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
                  "Run this component, and nothing but those named so. Without it, all run but "
                  "those that subscribe to nothing and whose topics are in the recording. "
                  "Repeatable")
      ->allow_extra_args(false)
      ->type_name("COMPONENT");
}

void ReplayingOptions::add_selection_to(CLI::App& line) {
  line.add_option("--start", start_s, "Begin so many seconds into the recording")->type_name("S");
  line.add_option("--end", end_s, "End so many seconds into the recording")->type_name("S");
  line.add_flag("--loop", is_looped, "At the end go on from the beginning");
  line.add_option("--topics", topics,
                  "Only these topics of the recording: control/*, camera/**; also such that no "
                  "component subscribes to at the start. Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line.add_option("--except", except, "Not these. Repeatable")
      ->allow_extra_args(false)
      ->type_name("PATTERN");
  line.add_option("--remap", remap, "What the recording calls OLD is NEW here. Repeatable")
      ->allow_extra_args(false)
      ->type_name("OLD:=NEW");
}

std::string ReplayingOptions::find_wrong() const {
  if (files.empty() && !into.empty()) {
    return "--replay-into says into whom --replay FILE goes, which is missing";
  }
  if (!is_span(start_s) || !is_span(end_s)) {
    return "--start and --end want seconds from 0 on";
  }
  if (end_s && *end_s <= start_s.value_or(0)) {
    return "--end has to be behind --start";
  }
  for (const std::string& rule : remap) {
    const auto at = rule.find(kBecomes);
    if (at == std::string::npos || at == 0 || at + kBecomes.size() == rule.size()) {
      return "--remap wants OLD:=NEW, and not \"" + rule + "\"";
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
