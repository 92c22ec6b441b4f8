#include "report/changes.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace fastcycle::host {

using nlohmann::ordered_json;

namespace {

constexpr std::size_t kMostFields = 8;  // Of a topic, in a table; the JSON has all.

double seconds_since(std::int64_t time_ns, std::int64_t begin_ns) {
  return static_cast<double>(time_ns - begin_ns) / 1e9;
}

ordered_json place_json(const ChangePlace& place, std::int64_t begin_ns) {
  return {{"activation", place.activation}, {"time_s", seconds_since(place.time_ns, begin_ns)},
          {"sequence", place.sequence},     {"field", place.path},
          {"recorded", place.recorded},     {"now", place.now}};
}

ordered_json field_json(const FieldChange& field, std::int64_t begin_ns) {
  ordered_json json = {{"field", field.field},
                       {"messages", field.messages},
                       {"values", field.values},
                       {"mean", nullptr},
                       {"max", nullptr},
                       {"max_at", nullptr},
                       {"first", place_json(field.first, begin_ns)}};
  if (field.numbers > 0) {
    json["mean"] = field.mean();
    json["max"] = field.most;
    json["max_at"] = place_json(field.largest, begin_ns);
  }
  return json;
}

std::string field_line(const FieldChange& field, std::int64_t begin_ns) {
  const auto place_in_words = [&](const ChangePlace& place) {
    return fmt::format("{:.3f} s, {}: {} -> {}", seconds_since(place.time_ns, begin_ns), place.path,
                       place.recorded, place.now);
  };
  if (field.numbers == 0) {
    return fmt::format("  {:<38} {:>9} {:>11} {:>11}  first at {}\n", field.field, field.messages,
                       "", "", place_in_words(field.first));
  }
  return fmt::format("  {:<38} {:>9} {:>11.4g} {:>11.4g}  max at {}\n", field.field, field.messages,
                     field.mean(), field.most, place_in_words(field.largest));
}

}  // namespace

ordered_json json_of(const std::vector<TopicChange>& topics, std::int64_t begin_ns) {
  ordered_json json = ordered_json::array();
  for (const TopicChange& topic : topics) {
    ordered_json fields = ordered_json::array();
    for (const FieldChange& field : topic.fields) {
      fields.push_back(field_json(field, begin_ns));
    }
    json.push_back({{"topic", topic.topic},
                    {"component", topic.publisher},
                    {"compared", topic.compared},
                    {"different", topic.different},
                    {"missing", topic.missing},
                    {"new", topic.added},
                    {"fields", std::move(fields)}});
    if (topic.not_compared > 0) {
      json.back()["not_compared"] = topic.not_compared;
    }
  }
  return json;
}

std::string table_of(const std::vector<TopicChange>& topics, std::int64_t begin_ns) {
  std::string text = fmt::format("{:<40} {:>9} {:>9} {:>9} {:>9}\n", "TOPIC", "compared",
                                 "different", "missing", "new");
  for (const TopicChange& topic : topics) {
    text += fmt::format("{:<40} {:>9} {:>9} {:>9} {:>9}\n", topic.topic, topic.compared,
                        topic.different, topic.missing, topic.added);
    if (topic.not_compared > 0) {
      text += fmt::format("  {} not compared: nothing near them was published by the other side\n",
                          topic.not_compared);
    }
    if (topic.fields.empty()) {
      continue;
    }
    text += fmt::format("  {:<38} {:>9} {:>11} {:>11}\n", "FIELD", "messages", "mean", "max");
    for (std::size_t i = 0; i < std::min(kMostFields, topic.fields.size()); ++i) {
      text += field_line(topic.fields[i], begin_ns);
    }
    if (topic.fields.size() > kMostFields) {
      text +=
          fmt::format("  and {} more fields (see --report)\n", topic.fields.size() - kMostFields);
    }
  }
  return text;
}

}  // namespace fastcycle::host
