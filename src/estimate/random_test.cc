// Random applications, analysed and simulated: what happens is never more than the bound.

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "estimate/analysis.h"
#include "estimate/duration_text.h"
#include "estimate/test_simulator.h"
#include "estimate/text.h"

namespace fastcycle::estimate {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr int kSets = 200;
constexpr int kParts = 8;
constexpr int kRuns = 4;

/// Makes applications of all kinds: chains of 1 to 6 callbacks, some of them by way of a timer or a
/// set, beside other load, on 1 to 3 executors with CPUs of their own or too few.
class RandomSystem {
 public:
  explicit RandomSystem(std::uint64_t seed) : random_(seed) {}

  System make() {
    add_executors();
    const int chains = pick(1, 2);
    for (int i = 0; i < chains; ++i) {
      add_chain(i);
    }
    const int loads = pick(0, 4);
    for (int i = 0; i < loads; ++i) {
      add_load(i);
    }
    set_run_times();
    return std::move(system_);
  }

 private:
  int pick(int least, int most) { return std::uniform_int_distribution(least, most)(random_); }
  bool one_in(int n) { return pick(1, n) == 1; }
  Duration period() {
    return milliseconds(
        std::array{2, 5, 10, 20, 33, 50, 100}[static_cast<std::size_t>(pick(0, 6))]);
  }

  void add_executors() {
    const int count = pick(1, 3);
    int workers = 0;
    for (int i = 0; i < count; ++i) {
      Executor executor;
      executor.name = "e" + std::to_string(i);
      executor.threads = static_cast<unsigned>(pick(1, 3));
      executor.hand_over = one_in(6);
      workers += static_cast<int>(executor.threads);
      system_.executors.push_back(executor);
    }
    system_.cpus = static_cast<unsigned>(one_in(3) ? pick(1, workers) : workers);
    if (system_.cpus < static_cast<unsigned>(workers) && one_in(2)) {
      for (Executor& executor : system_.executors) {
        executor.priority = one_in(2) ? pick(1, 3) : 0;
        if (one_in(2)) {
          executor.cpus = {pick(0, static_cast<int>(system_.cpus) - 1)};
          executor.threads = 1;
        }
      }
    }
    system_.wake_up = microseconds(pick(0, 1) * 50);
  }

  std::size_t add_topic(const std::string& name) {
    system_.topics.push_back(name);
    return system_.topics.size() - 1;
  }
  std::size_t add_component(const std::string& name) {
    system_.components.push_back(
        {name, static_cast<std::size_t>(pick(0, static_cast<int>(system_.executors.size()) - 1))});
    return system_.components.size() - 1;
  }
  Callback& add_callback(std::size_t component, std::vector<Input> inputs) {
    Callback callback;
    callback.name = inputs.empty() ? "timer" : system_.topics[inputs[0].topic];
    callback.component = component;
    callback.inputs = std::move(inputs);
    system_.callbacks.push_back(callback);
    return system_.callbacks.back();
  }
  void add_timer(std::size_t component, std::vector<Publication> publishes) {
    Callback& timer = add_callback(component, {});
    timer.arrivals = Arrivals{period()};
    timer.publishes = std::move(publishes);
  }
  void add_source(std::size_t topic) {
    const Duration its_period = period();
    Source source;
    source.name = "a driver";
    source.topic = topic;
    source.arrivals = Arrivals{its_period, its_period * pick(0, 3) / 4,
                               one_in(5) ? static_cast<std::uint64_t>(pick(2, 4)) : 1};
    source.age = microseconds(pick(0, 1) * 500);
    system_.sources.push_back(source);
  }

  void add_chain(int number) {
    const std::string name = "c" + std::to_string(number);
    std::size_t topic = add_topic(name + "/0");
    const std::size_t from = topic;
    if (one_in(3)) {
      add_timer(add_component(name + "_source"), {{topic}});
    } else {
      add_source(topic);
    }
    const int length = pick(1, 6);
    for (int i = 1; i <= length; ++i) {
      const std::size_t component = add_component(name + "_" + std::to_string(i));
      const std::size_t next = add_topic(name + "/" + std::to_string(i));
      const int kind = pick(0, 9);
      if (kind == 0) {  // What came is looked at by a timer.
        add_callback(component, {{topic}});
        add_timer(component, {{next}});
      } else if (kind == 1) {
        system_.views.push_back({component, topic});
        add_timer(component, {{next}});
      } else if (kind == 2 && i < length) {  // Two ways that come together again.
        const std::size_t left = add_topic(name + "/left");
        const std::size_t right = add_topic(name + "/right");
        add_callback(add_component(name + "_left"), {{topic}}).publishes = {{left}};
        add_callback(add_component(name + "_right"), {{topic}}).publishes = {{right}};
        Callback& join = add_callback(component, {{left}, {right}});
        join.joining = Joining::kSets;
        join.publishes = {{next}};
      } else {
        std::vector<Input> inputs{{topic}};
        if (kind == 3) {  // Somebody else's messages too.
          inputs.push_back({add_topic(name + "/other" + std::to_string(i))});
          add_source(inputs.back().topic);
        }
        add_callback(component, inputs).publishes = {{next, one_in(8) ? 2U : 1U}};
      }
      if (one_in(4)) {  // And somebody who only listens.
        add_callback(add_component(name + "_listener" + std::to_string(i)), {{next}});
      }
      if (one_in(5)) {
        add_timer(component, {});
      }
      topic = next;
    }
    add_callback(add_component(name + "_sink"), {{topic}});
    system_.chains.push_back({name, from, topic, std::chrono::seconds(9)});
  }

  void add_load(int number) {
    const std::size_t component = add_component("load" + std::to_string(number));
    add_timer(component, {});
    if (one_in(3)) {
      add_timer(component, {});
    }
  }

  /// So that the workers are busy for some tenth of their time, as far as one can say beforehand.
  void set_run_times() {
    const double share = pick(5, 45) / 100.0;
    for (Callback& callback : system_.callbacks) {
      const Executor& executor = system_.executors[system_.components[callback.component].executor];
      const auto mates = std::ranges::count_if(system_.callbacks, [&](const Callback& other) {
        return system_.components[other.component].executor ==
               system_.components[callback.component].executor;
      });
      const double mean_ms = 10.0 * share * executor.threads / static_cast<double>(mates);
      const double spread = std::exponential_distribution(1.0)(random_);
      callback.run_time = microseconds(10 + static_cast<int>(1000 * mean_ms * spread));
    }
  }

  std::mt19937_64 random_;
  System system_;
};

std::string dump(const System& system) {
  std::string text = "cpus " + std::to_string(system.cpus) + "\n";
  for (const Executor& e : system.executors) {
    text += e.name + " threads " + std::to_string(e.threads) + " priority " +
            std::to_string(e.priority) + (e.hand_over ? " hand_over" : "") +
            (e.cpus.empty() ? "" : " cpu " + std::to_string(e.cpus[0])) + "\n";
  }
  for (const Source& s : system.sources) {
    text += "source of " + system.topics[s.topic] + " every " + text_of(s.arrivals->period) +
            " jitter " + text_of(s.arrivals->jitter) + " burst " +
            std::to_string(s.arrivals->burst) + "\n";
  }
  for (const Callback& c : system.callbacks) {
    text += system.components[c.component].name + " on " +
            system.executors[system.components[c.component].executor].name + " takes " +
            text_of(*c.run_time);
    for (const Input& input : c.inputs) {
      text += " receives " + system.topics[input.topic];
    }
    if (c.arrivals) {
      text += " every " + text_of(c.arrivals->period);
    }
    for (const Publication& publication : c.publishes) {
      text += " publishes " + std::to_string(publication.messages) + " " +
              system.topics[publication.topic];
    }
    text += "\n";
  }
  return text;
}

class RandomSystems : public testing::TestWithParam<int> {};

TEST_P(RandomSystems, AreNeverSlowerThanTheyWereCalled) {
  int chains = 0;
  int safe = 0;
  std::vector<double> ratios;
  for (int set = GetParam(); set < kSets; set += kParts) {
    System system = RandomSystem(static_cast<std::uint64_t>(set)).make();
    // With the bound itself as the deadline every safe claim is as bold as it can be.
    Estimate estimate = analyze(system);
    for (std::size_t i = 0; i < system.chains.size(); ++i) {
      system.chains[i].deadline = estimate.chains[i].bound.value_or(std::chrono::seconds(9));
    }
    estimate = analyze(system);
    std::vector<std::optional<Duration>> oldest(system.chains.size());
    for (int run = 0; run < kRuns; ++run) {
      Simulator simulator(system, {.seed = static_cast<std::uint64_t>(set * kRuns + run),
                                   .is_worst = run % 2 == 0,
                                   .begins_at_once = run < 2});
      simulator.run(milliseconds(800));
      for (std::size_t i = 0; i < system.chains.size(); ++i) {
        oldest[i] = std::max(oldest[i], simulator.oldest(i));
      }
    }
    for (std::size_t i = 0; i < system.chains.size(); ++i) {
      const ChainEstimate& judged = estimate.chains[i];
      ++chains;
      if (judged.verdict != Verdict::kHolds) {
        continue;
      }
      ++safe;
      ASSERT_TRUE(oldest[i]) << "set " << set << ": nothing came";
      EXPECT_LE(*oldest[i], *judged.bound) << "set " << set << "\n"
                                           << dump(system) << to_text(system, estimate);
      ratios.push_back(static_cast<double>(judged.bound->count()) /
                       static_cast<double>(std::max(oldest[i]->count(), std::int64_t{1})));
    }
  }
  std::ranges::sort(ratios);
  // An estimate that calls nothing safe, or bounds nothing closely, would pass as well.
  EXPECT_GT(safe * 4, chains) << safe << " of " << chains;
  EXPECT_LT(ratios[ratios.size() / 2], 8.0);
}

INSTANTIATE_TEST_SUITE_P(Many, RandomSystems, testing::Range(0, kParts));

}  // namespace
}  // namespace fastcycle::estimate
