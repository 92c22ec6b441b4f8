#include "dds_gateway/settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/util/json_util.h>

#include "ros2/definition.h"
#include "ros2/names.h"

namespace fastcycle::dds_gateway {
namespace {

using google::protobuf::Struct;
using google::protobuf::Value;

constexpr std::size_t kDepthMax = 100'000;
constexpr std::array<std::string_view, 7> kServiceKeys = {"service", "direction", "ros",  "type",
                                                          "request", "reply",     "depth"};
constexpr std::array<std::string_view, 2> kParamKeys = {"param", "access"};
constexpr std::array<std::string_view, 11> kTopicKeys = {
    "topic",      "direction", "ros",           "type",       "message", "reliability",
    "durability", "depth",     "rate_limit_hz", "age_max_ms", "on_error"};

/// Reads one entry, and collects its errors.
class Entry {
 public:
  Entry(const Value& value, std::string place, std::span<const std::string_view> keys,
        std::vector<std::string>& errors)
      : place_(std::move(place)), errors_(errors) {
    if (!value.has_struct_value()) {
      fail("", "an object", shown(&value));
      return;
    }
    entry_ = &value.struct_value();
    for (const auto& [key, unused] : entry_->fields()) {
      if (std::ranges::find(keys, key) == keys.end()) {
        errors_.push_back(fmt::format("{}/{}: there is no such key; there are {}", place_, key,
                                      fmt::join(keys, ", ")));
      }
    }
  }

  [[nodiscard]] bool has(const char* key) const { return find(key) != nullptr; }

  std::string text(const char* key, bool is_needed) {
    const Value* const value = find(key);
    if (value == nullptr ? is_needed
                         : !value->has_string_value() || value->string_value().empty()) {
      fail(key, "a text", shown(value));
      return {};
    }
    return value == nullptr ? "" : value->string_value();
  }

  /// The index of the value in `names`.
  std::size_t choice(const char* key, std::initializer_list<std::string_view> names,
                     std::optional<std::size_t> fallback) {
    const Value* const value = find(key);
    if (value == nullptr && fallback) {
      return *fallback;
    }
    const auto* const found =
        value == nullptr ? names.end() : std::ranges::find(names, value->string_value());
    if (found == names.end()) {
      fail(key, fmt::format("{}", fmt::join(names, " or ")), shown(value));
      return 0;
    }
    return static_cast<std::size_t>(found - names.begin());
  }

  double number(const char* key, double fallback, double min, double max) {
    const Value* const value = find(key);
    if (value == nullptr) {
      return fallback;
    }
    if (!value->has_number_value() ||
        !(value->number_value() >= min && value->number_value() <= max)) {
      fail(key, fmt::format("a number from {} to {}", min, max), shown(value));
      return fallback;
    }
    return value->number_value();
  }

  /// With a leading slash, which may be missing in the file.
  std::string ros_name() {
    std::string name = text("ros", true);
    if (name.empty()) {
      return name;
    }
    if (ros2::ros_name_error(name)) {
      fail("ros",
           "parts of letters, digits and _ with / between them, none of which begins with a digit",
           fmt::format("\"{}\"", name));
      return {};
    }
    return name.starts_with('/') ? name : fmt::format("/{}", name);
  }

  void fail(std::string_view key, std::string_view expected, std::string_view found) {
    errors_.push_back(fmt::format("{}{}{}: expected {}, found {}", place_, key.empty() ? "" : "/",
                                  key, expected, found));
  }

 private:
  [[nodiscard]] const Value* find(const char* key) const {
    if (entry_ == nullptr) {
      return nullptr;
    }
    const auto found = entry_->fields().find(key);
    return found == entry_->fields().end() ? nullptr : &found->second;
  }
  static std::string shown(const Value* value) {
    std::string text = "nothing";
    if (value != nullptr) {
      text.clear();
      (void)google::protobuf::util::MessageToJsonString(*value, &text);
    }
    return text;
  }

  std::string place_;
  std::vector<std::string>& errors_;
  const Struct* entry_ = nullptr;
};

TopicSettings read(Entry& entry) {
  TopicSettings topic;
  topic.topic = entry.text("topic", true);
  topic.is_in = entry.choice("direction", {"in", "out"}, {}) == 0;
  topic.is_as_it_is = !entry.has("ros") && !entry.has("type");
  if (topic.is_as_it_is) {
    topic.ros = "fastcycle/" + topic.topic;
    topic.message = entry.text("message", true);
  } else {
    topic.ros = entry.ros_name();
    topic.type = ros2::full_type_name(entry.text("type", true));
    topic.message = entry.text("message", false);
  }
  topic.qos.is_reliable = entry.choice("reliability", {"reliable", "best_effort"}, 0) == 0;
  topic.qos.is_transient_local =
      entry.choice("durability", {"volatile", "transient_local"}, 0) == 1;
  topic.qos.depth = static_cast<std::size_t>(entry.number("depth", 10, 1, kDepthMax));
  topic.rate_limit_hz = entry.number("rate_limit_hz", 0.0, 0.0, 1e6);
  const double age_max_ms = entry.number("age_max_ms", 0.0, 0.0, 1e9);
  if (age_max_ms > 0.0) {
    topic.age_max = std::chrono::nanoseconds(std::llround(age_max_ms * 1e6));
  }
  topic.on_error = static_cast<OnError>(entry.choice("on_error", {"count", "degrade", "stop"}, 0));
  return topic;
}

}  // namespace

std::vector<ServiceSettings> services_of(const google::protobuf::ListValue& services) {
  std::vector<ServiceSettings> all;
  std::vector<std::string> errors;
  std::set<std::string> seen;
  for (int i = 0; i < services.values_size(); ++i) {
    Entry entry(services.values(i), fmt::format("/params/services/{}", i), kServiceKeys, errors);
    ServiceSettings service;
    service.service = entry.text("service", true);
    service.is_in = entry.choice("direction", {"in", "out"}, {}) == 0;
    service.ros = entry.ros_name();
    service.type = entry.text("type", true);
    service.request = entry.text("request", false);
    service.reply = entry.text("reply", false);
    service.depth = static_cast<std::size_t>(entry.number("depth", 10, 1, kDepthMax));
    if (!service.ros.empty() && !seen.insert(service.ros).second) {
      entry.fail("ros", "a service that no other entry has", fmt::format("\"{}\"", service.ros));
    }
    all.push_back(std::move(service));
  }
  if (!errors.empty()) {
    throw std::invalid_argument(fmt::format("{}", fmt::join(errors, "\n")));
  }
  return all;
}

std::vector<ParamSettings> parameters_of(const google::protobuf::ListValue& parameters) {
  std::vector<ParamSettings> all;
  std::vector<std::string> errors;
  std::set<std::string> seen;
  for (int i = 0; i < parameters.values_size(); ++i) {
    Entry entry(parameters.values(i), fmt::format("/params/parameters/{}", i), kParamKeys, errors);
    ParamSettings settings;
    settings.param = entry.text("param", true);
    settings.may_change = entry.choice("access", {"read", "change"}, 0) == 1;
    const std::size_t dot = settings.param.find('.');
    if (!settings.param.empty() && (dot == 0 || dot >= settings.param.size() - 1)) {
      entry.fail("param", "a component and its param, as limiter.limit_mps or limiter.*",
                 fmt::format("\"{}\"", settings.param));
    } else if (!settings.param.empty() && !seen.insert(settings.param).second) {
      entry.fail("param", "a param that no other entry has", fmt::format("\"{}\"", settings.param));
    }
    all.push_back(std::move(settings));
  }
  if (!errors.empty()) {
    throw std::invalid_argument(fmt::format("{}", fmt::join(errors, "\n")));
  }
  return all;
}

std::vector<TopicSettings> topics_of(const google::protobuf::ListValue& topics) {
  std::vector<TopicSettings> all;
  std::vector<std::string> errors;
  std::set<std::pair<std::string, bool>> seen;
  for (int i = 0; i < topics.values_size(); ++i) {
    Entry entry(topics.values(i), fmt::format("/params/topics/{}", i), kTopicKeys, errors);
    TopicSettings topic = read(entry);
    if (!topic.ros.empty() && !seen.emplace(topic.ros, topic.is_in).second) {
      entry.fail("ros", "a topic that no other entry has in this direction",
                 fmt::format("\"{}\"", topic.ros));
    }
    all.push_back(std::move(topic));
  }
  if (!errors.empty()) {
    throw std::invalid_argument(fmt::format("{}", fmt::join(errors, "\n")));
  }
  return all;
}

}  // namespace fastcycle::dds_gateway
