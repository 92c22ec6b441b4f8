// fastcycle_estimate_live SECONDS WAKE_MS: see tests/soak/estimate.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <google/protobuf/wrappers.pb.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "estimate/analysis.h"
#include "estimate/duration_text.h"
#include "estimate/read_timing.h"
#include "estimate/system_of.h"
#include "estimate/text.h"
#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "report/report.h"

namespace {

using fastcycle::Duration;
using google::protobuf::Int64Value;
using std::chrono::milliseconds;

/// The largest age of a message when the callback of a component began.
class Ages {
 public:
  void add(const std::string& component, Duration age) {
    const std::lock_guard lock(mutex_);
    auto& oldest = oldest_[component];
    oldest = std::max(oldest, age);
  }
  Duration take(const std::string& component) {
    const std::lock_guard lock(mutex_);
    return std::exchange(oldest_[component], Duration());
  }

 private:
  std::mutex mutex_;
  std::map<std::string, Duration> oldest_;
} g_ages;

/// Subscribes to a topic, or none, and keeps a CPU busy; publishes when it received something, or
/// each period.
class Busy final : public fastcycle::Component {
 public:
  explicit Busy(fastcycle::Context& context)
      : Component(context),
        run_us_(context.param<std::int64_t>("run_us", {.min = 0}).get()),
        random_(static_cast<unsigned>(run_us_)) {
    const std::string input = context.param<std::string>("input", {.fallback = ""}).get();
    const std::string publishes = context.param<std::string>("publishes", {.fallback = ""}).get();
    const auto period_us = context.param<std::int64_t>("period_us", {.fallback = 0}).get();
    if (!publishes.empty()) {
      publisher_.emplace(context.create_publisher<Int64Value>(publishes));
    }
    if (!input.empty()) {
      context.create_subscriber<Int64Value>(
          input, {.depth = 64}, [this, period_us](const fastcycle::Sample<Int64Value>& sample) {
            g_ages.add(name_, now() - sample.info().origin.taken);
            work(period_us == 0);
          });
    }
    if (period_us > 0) {
      context.create_timer({.period = std::chrono::microseconds(period_us)},
                           [this] { work(true); });
    }
    name_ = context.component_name();
  }

 private:
  void work(bool publishes) {
    const auto time = std::chrono::microseconds(
        std::uniform_int_distribution<std::int64_t>(run_us_ / 2, run_us_)(random_));
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) {
    }
    if (publishes && publisher_) {
      publisher_->publish(publisher_->loan());
    }
  }

  const std::int64_t run_us_;
  std::string name_;
  std::optional<fastcycle::Publisher<Int64Value>> publisher_;
  std::mt19937 random_;
};

/// An application's JSON: one chain, and load beside it.
nlohmann::json random_application(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto pick = [&](int least, int most) {
    return std::uniform_int_distribution(least, most)(random);
  };
  nlohmann::json application = {{"name", "live"},
                                {"executors", nlohmann::json::array()},
                                {"components", nlohmann::json::array()}};
  const int executors = pick(1, 2);
  for (int i = 0; i < executors; ++i) {
    application["executors"].push_back(
        {{"name", "e" + std::to_string(i)}, {"threads", executors == 1 ? pick(1, 2) : 1}});
  }
  const auto add = [&](const std::string& name, nlohmann::json params) {
    application["components"].push_back({{"name", name},
                                         {"library", "busy"},
                                         {"executor", "e" + std::to_string(pick(0, executors - 1))},
                                         {"params", std::move(params)}});
  };
  const int length = pick(1, 6);
  add("source", {{"run_us", 100}, {"period_us", 1000 * pick(20, 60)}, {"publishes", "t0"}});
  for (int i = 1; i <= length; ++i) {
    nlohmann::json params = {{"run_us", pick(100, 2000)},
                             {"input", "t" + std::to_string(i - 1)},
                             {"publishes", "t" + std::to_string(i)}};
    if (pick(1, 4) == 1) {
      params["period_us"] = 1000 * pick(10, 50);
    }
    add("c" + std::to_string(i), std::move(params));
  }
  add("sink", {{"run_us", pick(10, 500)}, {"input", "t" + std::to_string(length)}});
  const int loads = pick(0, 2);
  for (int i = 0; i < loads; ++i) {
    add("load" + std::to_string(i),
        {{"run_us", pick(100, 4000)}, {"period_us", 1000 * pick(20, 50)}});
  }
  application["chains"] = {{{"name", "chain"},
                            {"from", "t0"},
                            {"to", "t" + std::to_string(length)},
                            {"deadline_ms", 86'400'000}}};
  return application;
}

/// What a callback publishes; the report does not say it.
void add_publications(const nlohmann::json& application, fastcycle::estimate::Timing& timing) {
  for (const auto& component : application["components"]) {
    auto& its = timing.components[component["name"]];
    const auto& params = component["params"];
    const bool has_timer = params.contains("period_us");
    const auto published = [&](bool publishes) {
      std::vector<std::pair<std::string, std::uint64_t>> topics;
      if (publishes && params.contains("publishes")) {
        topics.emplace_back(params["publishes"], 1);
      }
      return topics;
    };
    if (params.contains("input")) {
      its.callbacks[params["input"]].publishes = published(!has_timer);
    }
    if (has_timer) {
      its.callbacks["timer 0"].publishes = published(true);
    }
  }
}

struct Outcome {
  Duration observed{};
  fastcycle::estimate::ChainEstimate estimate;
  std::string text;
};

Outcome run_one(std::uint64_t seed, Duration wake_up, const std::filesystem::path& folder) {
  namespace estimate = fastcycle::estimate;
  namespace host = fastcycle::host;
  const nlohmann::json json = random_application(seed);
  host::TestClasses classes;
  classes.with<Busy>("busy");
  Outcome outcome;
  estimate::Timing timing;
  fastcycle::config::Problems problems;
  {
    const auto application = host::make_application(json.dump(), classes);
    const auto begin = std::chrono::steady_clock::now();
    application->start();
    application->run(milliseconds(700));
    application->stop();
    outcome.observed = g_ages.take("sink");
    const std::filesystem::path file = folder / "report.json";
    std::ofstream(file) << host::to_json(
        host::make_report(*application, std::chrono::steady_clock::now() - begin));
    estimate::read_timing(file, 1.0, timing, problems);
  }
  add_publications(json, timing);
  const auto unstarted =
      host::make_application(json.dump(), classes, {.is_simulated = true, .workers = 1});
  const estimate::System system =
      estimate::system_of(*unstarted, timing, {.wake_up = wake_up}, problems);
  for (const auto& problem : problems.all()) {
    std::printf("%s\n", to_string(problem).c_str());
  }
  const estimate::Estimate result = estimate::analyze(system);
  outcome.estimate = result.chains.at(0);
  outcome.text = to_text(system, result);
  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  namespace estimate = fastcycle::estimate;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 60;
  const Duration wake_up = milliseconds(argc > 2 ? std::atoi(argv[2]) : 50);
  std::string name = (std::filesystem::temp_directory_path() / "estimate.XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    std::perror("estimate: a folder for reports");
    return 1;
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  int runs = 0;
  int safe = 0;
  int exceeded = 0;
  std::vector<double> ratios;
  while (std::chrono::steady_clock::now() < end) {
    const auto seed = static_cast<std::uint64_t>(++runs);
    const Outcome outcome = run_one(seed, wake_up, name);
    if (outcome.estimate.verdict != estimate::Verdict::kHolds) {
      continue;
    }
    ++safe;
    const Duration bound = *outcome.estimate.bound;
    ratios.push_back(static_cast<double>(bound.count()) /
                     static_cast<double>(std::max<std::int64_t>(outcome.observed.count(), 1)));
    std::printf("%4d  observed %10s  estimated %10s\n", runs,
                estimate::text_of(outcome.observed).c_str(), estimate::text_of(bound).c_str());
    if (outcome.observed > bound) {
      ++exceeded;
      std::printf("older than what was called safe:\n%s", outcome.text.c_str());
    }
  }
  std::filesystem::remove_all(name);
  std::ranges::sort(ratios);
  std::printf(
      "estimate: %d applications, %d called safe, %d older than that; estimated / observed "
      "at the median %.1f\n",
      runs, safe, exceeded, ratios.empty() ? 0 : ratios[ratios.size() / 2]);
  return exceeded == 0 && safe * 4 >= runs ? 0 : 1;
}
