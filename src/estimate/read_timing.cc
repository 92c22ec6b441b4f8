#include "estimate/read_timing.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include "config/nearest.h"
#include "config/parse.h"
#include "estimate/recorded.h"

namespace fastcycle::estimate {
namespace {

using config::Problems;
using config::Value;

constexpr double kMaxMs = 86'400'000;

Duration milliseconds(double ms) {
  return std::chrono::ceil<Duration>(std::chrono::duration<double, std::milli>(ms));
}

/// Reads the members of objects, and reports their errors.
class TimingReader {
 public:
  TimingReader(double margin, Timing& timing, Problems& problems)
      : margin_(margin), timing_(timing), problems_(problems) {}

  void read(const Value& root) {
    if (!is_object(root)) {
      return;
    }
    if (root.find("clock") != nullptr && root.find("topics") != nullptr) {
      read_report(root);
      return;
    }
    check_keys(root, {"components", "sources"});
    for_each(root.find("components"), [&](const std::string& name, const Value& value) {
      read_component(value, timing_.components[name]);
    });
    for_each(root.find("sources"), [&](const std::string& name, const Value& value) {
      read_source(value, timing_.sources[name]);
    });
  }

 private:
  bool is_object(const Value& value) {
    if (!value.is_object()) {
      problems_.add(config::unexpected(value, "an object"));
    }
    return value.is_object();
  }

  template <typename Use>
  void for_each(const Value* value, const Use& use) {
    if (value == nullptr || !is_object(*value)) {
      return;
    }
    for (const Value::Member& member : value->members()) {
      if (is_object(member.value)) {
        use(member.key, member.value);
      }
    }
  }

  void check_keys(const Value& value, const std::vector<std::string>& known) {
    for (const Value::Member& member : value.members()) {
      if (std::ranges::find(known, member.key) == known.end()) {
        problems_.add(config::make_error(member.value.place(),
                                         "unknown key " + config::in_quotes(member.key),
                                         config::did_you_mean(config::nearest(member.key, known))));
      }
    }
  }

  std::optional<Duration> span(const Value& value, std::string_view key, double least) {
    const Value* its = value.find(key);
    if (its == nullptr) {
      return std::nullopt;
    }
    if (!its->is_number() || !(its->as_double() >= least) || !(its->as_double() <= kMaxMs)) {
      problems_.add(config::unexpected(
          *its, least > 0 ? "milliseconds in [0.001, 86400000]" : "milliseconds in [0, 86400000]"));
      return std::nullopt;
    }
    return milliseconds(its->as_double());
  }

  std::uint64_t count(const Value& value) {
    if (!value.is_integer() || value.as_double() < 1 || value.as_double() > 65536) {
      problems_.add(config::unexpected(value, "a number in [1, 65536]"));
      return 1;
    }
    return value.as_uint64();
  }

  std::optional<Arrivals> arrivals(const Value& value) {
    const auto period = span(value, "period_ms", 0.001);
    const auto jitter = span(value, "jitter_ms", 0);
    const Value* burst = value.find("burst");
    const std::uint64_t events = burst == nullptr ? 1 : count(*burst);
    if (!period) {
      if (jitter || burst != nullptr) {
        problems_.add(config::make_error(value.place(),
                                         "\"jitter_ms\" and \"burst\" mean nothing "
                                         "without \"period_ms\""));
      }
      return std::nullopt;
    }
    return Arrivals{*period, jitter.value_or(Duration()), events};
  }

  bool truth(const Value& value, std::string_view key, bool fallback) {
    const Value* its = value.find(key);
    if (its != nullptr && !its->is_bool()) {
      problems_.add(config::unexpected(*its, "true or false"));
      return fallback;
    }
    return its == nullptr ? fallback : its->as_bool();
  }

  void read_component(const Value& value, ComponentTiming& component) {
    check_keys(value, {"run_ms", "callbacks"});
    component.is_given = true;
    component.place = value.place();
    if (const auto run_time = span(value, "run_ms", 0)) {
      component.run_time = run_time;
    }
    for_each(value.find("callbacks"), [&](const std::string& name, const Value& its) {
      read_callback(its, component.callbacks[name]);
    });
  }

  void read_callback(const Value& value, CallbackTiming& callback) {
    check_keys(value, {"run_ms", "publishes", "may_publish", "period_ms", "jitter_ms", "burst"});
    callback.is_given = true;
    callback.place = value.place();
    if (const auto run_time = span(value, "run_ms", 0)) {
      callback.run_time = run_time;
    }
    if (const auto its_arrivals = arrivals(value)) {
      callback.arrivals = its_arrivals;
    }
    for (const char* key : {"publishes", "may_publish"}) {
      const Value* topics = value.find(key);
      if (topics == nullptr) {
        continue;
      }
      if (!callback.publishes) {
        callback.publishes.emplace();
      }
      callback.always_publishes = value.find("may_publish") == nullptr;
      if (topics->is_object()) {
        for (const Value::Member& member : topics->members()) {
          callback.publishes->emplace_back(member.key, count(member.value));
        }
      } else if (topics->is_array()) {
        for (const Value& topic : topics->items()) {
          if (topic.is_string()) {
            callback.publishes->emplace_back(topic.as_string(), 1);
          } else {
            problems_.add(config::unexpected(topic, "the name of a topic"));
          }
        }
      } else {
        problems_.add(config::unexpected(
            *topics, "a list of topics, or an object of topics and numbers of messages"));
      }
    }
  }

  void read_source(const Value& value, SourceTiming& source) {
    check_keys(value, {"period_ms", "jitter_ms", "burst", "age_ms", "keeps_coming"});
    source.place = value.place();
    if (const auto its_arrivals = arrivals(value)) {
      source.arrivals = *its_arrivals;
    } else if (value.find("period_ms") == nullptr) {
      problems_.add(config::make_error(value.place(), "a source needs \"period_ms\""));
    }
    source.age = span(value, "age_ms", 0).value_or(source.age);
    source.keeps_coming = truth(value, "keeps_coming", source.keeps_coming);
  }

  /// The report of a run: of each component the longest callback.
  void read_report(const Value& root) {
    for_each(root.find("components"), [&](const std::string& name, const Value& value) {
      const Value* callback = value.find("callback_us");
      const Value* longest = callback == nullptr ? nullptr : callback->find("max");
      if (longest == nullptr || !longest->is_number()) {
        return;  // It was never called.
      }
      ComponentTiming& component = timing_.components[name];
      component.place = value.place();
      component.run_time = milliseconds(longest->as_double() / 1e3 * margin_);
    });
  }

  const double margin_;
  Timing& timing_;
  Problems& problems_;
};

}  // namespace

void read_timing(const std::filesystem::path& file, double margin, Timing& timing,
                 Problems& problems) {
  if (file.extension() == ".mcap") {
    read_recorded_timing(file, margin, timing, problems);
    return;
  }
  if (const auto root = config::parse_file(file, {}, problems)) {
    TimingReader(margin, timing, problems).read(*root);
  }
}

}  // namespace fastcycle::estimate
