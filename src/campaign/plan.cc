#include "campaign/plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "config/fault_keys.h"
#include "config/nearest.h"
#include "config/problem.h"

namespace fastcycle::campaign {
namespace {

using nlohmann::ordered_json;

/// Numbers by chance, the same on every machine (SplitMix64).
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : state_(seed) { static_cast<void>(bits()); }

  std::uint64_t bits() noexcept {
    std::uint64_t x = state_ += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31U);
  }
  double unit() noexcept { return static_cast<double>(bits() >> 11U) * 0x1.0p-53; }
  std::uint64_t between(std::uint64_t first, std::uint64_t last) noexcept {
    return first + static_cast<std::uint64_t>(unit() * static_cast<double>(last - first + 1));
  }

 private:
  std::uint64_t state_;
};

constexpr double kMaxTime = 86400;  ///< Of a fault, in s.

struct Limits {
  double least = std::numeric_limits<double>::lowest();
  double most = std::numeric_limits<double>::max();
};

/// The keys that may be ranges, with what a run accepts (schema/application.schema.json): a number
/// beyond would end the campaign at the seed that draws it.
const std::map<std::string, Limits>& ranged_keys() {
  static const std::map<std::string, Limits> keys = {
      {"from_s", {0, kMaxTime}},      {"for_s", {0, kMaxTime}},  {"probability", {0, 1}},
      {"by_ms", {0.001, 86'400'000}}, {"by_mb", {1, 1'000'000}}, {"value", {}}};
  return keys;
}
const std::set<std::string>& text_keys() {
  static const std::set<std::string> keys = {"kind",      "topic",   "publisher", "subscriber",
                                             "component", "process", "field",     "as"};
  return keys;
}

bool is_range(const ordered_json& value) {
  return value.is_array() && value.size() == 2 && value[0].is_number() && value[1].is_number() &&
         value[0].get<double>() <= value[1].get<double>();
}

/// Of a number, or of the numbers in a range.
double least_of(const ordered_json& value) {
  return (is_range(value) ? value[0] : value).get<double>();
}
double most_of(const ordered_json& value) {
  return (is_range(value) ? value[1] : value).get<double>();
}
bool is_number_or_range(const ordered_json& value) {
  return value.is_number() || is_range(value);
}

/// An end has to be after the begin.
double span_of(double for_s) {
  return std::max(for_s, 0.001);
}

/// Reads a plan, and collects what is wrong with it.
class Reader {
 public:
  Reader(std::string file, std::vector<std::string>& errors)
      : file_(std::move(file)), errors_(errors) {}

  void expect(const std::string& pointer, const std::string& expected, const ordered_json& found) {
    errors_.push_back(
        fmt::format("{}: {}: expected {}, found {}", file_, pointer, expected,
                    found.dump(-1, ' ', false, ordered_json::error_handler_t::replace)));
  }
  void add_error(const std::string& pointer, const std::string& what) {
    errors_.push_back(fmt::format("{}: {}: {}", file_, pointer, what));
  }

  void check_fault(const ordered_json& fault, const std::string& pointer) {
    if (!fault.is_object()) {
      expect(pointer, "an object", fault);
      return;
    }
    for (const auto& [key, value] : fault.items()) {
      const std::string at = pointer + "/" + key;
      if (const auto ranged = ranged_keys().find(key); ranged != ranged_keys().end()) {
        check_number(value, ranged->second, at);
      } else if (text_keys().contains(key)) {
        if (!value.is_string()) {
          expect(at, "a string", value);
        }
      } else {
        add_error(at,
                  "unknown key \"" + key +
                      "\"; a fault of a plan has kind, topic, publisher, subscriber, component, "
                      "process, field, as, value, by_ms, by_mb, probability, from_s, for_s");
      }
    }
    if (!fault.contains("kind")) {
      add_error(pointer, "the key \"kind\" is missing");
    } else if (fault["kind"].is_string()) {
      check_kind(fault, pointer);
    }
    if (!fault.contains("from_s")) {
      add_error(pointer,
                "the key \"from_s\" is missing: between which times it begins, as [0, 10]");
    } else if (fault.contains("for_s")) {
      check_end(fault["from_s"], fault["for_s"], pointer + "/for_s");
    }
  }

 private:
  void check_number(const ordered_json& value, const Limits& limits, const std::string& at) {
    if (!is_number_or_range(value)) {
      expect(at, "a number, or a range such as [1, 5]", value);
    } else if (least_of(value) < limits.least || most_of(value) > limits.most) {
      expect(at,
             fmt::format("a number in [{}, {}], or a range of these", limits.least, limits.most),
             value);
    }
  }

  void check_end(const ordered_json& from, const ordered_json& span, const std::string& at) {
    const auto is_time = [](const ordered_json& value) {
      return is_number_or_range(value) && least_of(value) >= 0 && most_of(value) <= kMaxTime;
    };
    if (is_time(from) && is_time(span) && most_of(from) + span_of(most_of(span)) > kMaxTime) {
      expect(at, fmt::format("an end, which is from_s + for_s, of at most {} s", kMaxTime), span);
    }
  }

  void check_kind(const ordered_json& fault, const std::string& pointer) {
    const auto name = fault["kind"].get<std::string>();
    const auto kind = config::fault_kind(name);
    if (kind == config::FaultKind::kHang) {
      add_error(pointer + "/kind",
                "\"hang\" has no effect in simulated time, in which a campaign runs; use \"slow\"");
      return;
    }
    if (!kind) {
      std::vector<std::string> kinds = config::fault_kinds();
      std::erase(kinds, config::to_string(config::FaultKind::kHang));
      const std::string hint = config::did_you_mean(config::nearest(name, kinds));
      add_error(pointer + "/kind",
                fmt::format("expected one of \"{}\", found \"{}\"{}", fmt::join(kinds, "\", \""),
                            name, hint.empty() ? "" : "; " + hint));
      return;
    }
    // A run has "to_s" where a plan has "for_s".
    const auto in_plan = [](const std::string& key) { return key == "to_s" ? "for_s" : key; };
    const auto has = [&](const char* key) { return fault.contains(in_plan(key)); };
    for (config::WrongKey& wrong : config::wrong_keys(*kind, has)) {
      if (const auto place = wrong.message.find("\"to_s\""); place != std::string::npos) {
        wrong.message.replace(place, 6, "\"for_s\"");
      }
      add_error(wrong.key.empty() ? pointer : pointer + "/" + in_plan(wrong.key), wrong.message);
    }
  }

  const std::string file_;
  std::vector<std::string>& errors_;
};

/// Three digits behind the point: an overlay is to be read by people.
double rounded(double value) {
  const double digits = std::round(value * 1000.0) / 1000.0;
  return std::isfinite(digits) ? digits : value;
}

double drawn(const ordered_json& value, Chance& chance) {
  if (value.is_number()) {
    return value.get<double>();
  }
  const double low = value[0].get<double>();
  const double high = value[1].get<double>();
  const double part = chance.unit();
  const double span = high - low;
  return rounded(std::isfinite(span) ? low + part * span : low * (1 - part) + high * part);
}

}  // namespace

std::optional<Plan> Plan::read(const std::string& text, const std::string& file,
                               std::vector<std::string>& errors) {
  ordered_json json;
  try {
    json = ordered_json::parse(text, nullptr, true, true);
  } catch (const ordered_json::exception& error) {
    errors.push_back(fmt::format("{}: this is not JSON: {}", file, error.what()));
    return std::nullopt;
  }
  const std::size_t before = errors.size();
  Reader reader(file, errors);
  Plan plan;
  if (!json.is_object()) {
    reader.expect("/", "an object", json);
    return std::nullopt;
  }
  for (const auto& [key, value] : json.items()) {
    if (key == "at_once") {
      const ordered_json range = is_range(value) ? value : ordered_json::array({value, value});
      if (!range[0].is_number_integer() || !range[1].is_number_integer() ||
          range[0].get<double>() < 1 || range[1].get<double>() > 64) {
        reader.expect("/at_once", "a number of faults in [1, 64], or a range of it", value);
      } else {
        plan.at_least_ = range[0];
        plan.at_most_ = range[1];
      }
    } else if (key != "faults") {
      reader.add_error("/" + key, "unknown key \"" + key + "\"; a plan has at_once, faults");
    }
  }
  if (!json.contains("faults") || !json["faults"].is_array() || json["faults"].empty()) {
    reader.add_error("/faults", "expected a list of at least one fault");
    return std::nullopt;
  }
  for (std::size_t i = 0; i < json["faults"].size(); ++i) {
    reader.check_fault(json["faults"][i], "/faults/" + std::to_string(i));
    plan.faults_.push_back(json["faults"][i]);
  }
  return errors.size() == before ? std::optional(std::move(plan)) : std::nullopt;
}

std::vector<DrawnFault> Plan::draw(std::uint64_t seed) const {
  Chance chance(seed);
  std::vector<DrawnFault> drawn_faults;
  const std::uint64_t count = chance.between(at_least_, at_most_);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::size_t source = chance.between(0, faults_.size() - 1);
    ordered_json fault = {{"name", "fault_" + std::to_string(i + 1)}};
    for (const auto& [key, value] : faults_[source].items()) {
      if (key == "for_s") {
        continue;
      }
      if (key == "by_mb") {
        fault[key] = std::max<std::int64_t>(1, std::llround(drawn(value, chance)));
      } else if (ranged_keys().contains(key)) {
        fault[key] = drawn(value, chance);
      } else {
        fault[key] = value;
      }
    }
    if (faults_[source].contains("for_s")) {
      const double span = drawn(faults_[source]["for_s"], chance);
      fault["to_s"] = rounded(fault["from_s"].get<double>() + span_of(span));
    }
    drawn_faults.push_back({std::move(fault), source});
  }
  return drawn_faults;
}

ordered_json overlay_of(const std::vector<DrawnFault>& faults, std::uint64_t seed) {
  auto list = ordered_json::array();
  for (const DrawnFault& fault : faults) {
    list.push_back(fault.json);
  }
  return {{"faults", {{"seed", seed}, {"list", std::move(list)}}}};
}

}  // namespace fastcycle::campaign
