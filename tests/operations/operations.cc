// Random operations on random applications: players do whatever a component can, and throw wherever
// they can. At the end of each application what must hold whatever happened is looked at.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "component/component_core.h"
#include "component/words.h"
#include "host/test_application.h"
#include "player.h"
#include "world.h"

namespace fastcycle::operations {
namespace {

using detail::ComponentCore;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using State = ComponentCore::State;

constexpr const char* kHelp = R"(Random operations on random applications.

  fastcycle_operations [OPTION]...

  --mode live|simulated   live by default
  --seed N                of the first application; the next one has the next number; 1 by default
  --operations N          ends when so many are done; 20000 by default
  --seconds S             ends after so many seconds instead
  --each N                operations in one application; 5000 by default
  --only A,B  --without A,B   which operations; all by default
  --limit S               seconds without progress that mean a live-lock or a lost component; 120
  --list                  says which operations there are
  --verbose               says what became of each application

Ends with status 1 when something did not hold, and says with which seed.
)";

struct Options {
  bool is_live = true;
  bool is_verbose = false;
  std::uint64_t seed = 1;
  std::uint64_t operations = 20'000;
  std::uint64_t each = 5'000;
  std::optional<std::chrono::seconds> time;
  std::chrono::seconds limit{120};
};

/// Ends the program when nothing was received from its owner for too long.
class Watchdog {
 public:
  explicit Watchdog(std::chrono::seconds limit)
      : limit_(limit), thread_([this](const std::stop_token& stop) { watch(stop); }) {}

  void expect(std::string what) {
    const std::lock_guard lock(mutex_);
    what_ = std::move(what);
    since_ = Clock::now();
  }

 private:
  void watch(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      changed_.wait_for(lock, stop, 200ms, [] { return false; });
      if (Clock::now() - since_ > limit_) {
        fmt::print(stderr, "operations: FAILED: {} takes longer than {} s\n", what_,
                   limit_.count());
        std::fflush(stderr);
        std::abort();  // For a debugger, or a core.
      }
    }
  }

  const std::chrono::seconds limit_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::string what_ = "the beginning";
  Clock::time_point since_ = Clock::now();
  std::jthread thread_;
};

/// An application with players, and perhaps a driver, all of it drawn from `seed`.
Json random_application(std::uint64_t seed, bool is_live, bool has_driver) {
  std::mt19937_64 random(seed);
  const auto below = [&](std::uint64_t count) { return random() % count; };
  const std::vector<std::string> executors = {"one", "two", "three"};
  Json application = {{"name", fmt::format("run_{}", seed)}, {"status_period_ms", 20}};
  application["executors"] = {{{"name", "one"}},
                              {{"name", "two"}, {"threads", 2}},
                              {{"name", "three"}, {"wait", "adaptive"}}};
  const std::size_t count = 3 + below(4);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) {
    names.push_back(fmt::format("p{}", i));
  }
  std::vector<std::string> modes;
  for (std::size_t i = 0; i < below(4); ++i) {
    modes.push_back(fmt::format("m{}", i));
    Json members = Json::array();
    for (const std::string& name : names) {
      if (below(3) != 0) {
        members.push_back(name);
      }
    }
    if (has_driver && below(2) == 0) {
      members.push_back("driver");
    }
    application["modes"][modes.back()] = {{"components", members}};
  }
  if (!modes.empty()) {
    application["initial_mode"] = modes[below(modes.size())];
  }
  const bool has_chain = below(3) == 0;
  if (has_chain) {
    application["chains"] = {{{"name", "chain"},
                              {"from", names[0] + "/out"},
                              {"to", "shared"},
                              {"deadline_ms", 2},
                              {"on_breach", below(2) == 0 ? "drop" : "count"}}};
  }
  Json topics = {{"shared", {{"multiple_publishers", true}, {"keep", 8}}}};
  for (const std::string& name : names) {
    Json its;
    if (below(3) == 0 && !(has_chain && name == names[0])) {
      its["latched"] = 1 + below(3);
    }
    if (below(4) == 0) {
      its["lifespan_ms"] = 2;
    }
    if (!its.is_null()) {
      topics[name + "/out"] = its;
    }
  }
  application["topics"] = topics;
  Json components = Json::array();
  for (const std::string& name : names) {
    Json peers = Json::array();
    for (const std::string& other : names) {
      const bool is_in_chain = has_chain && name == names[1] && other == names[0];
      if (other != name && (below(2) == 0 || is_in_chain)) {
        peers.push_back(other);
      }
    }
    Json component = {
        {"name", name},
        {"library", "player"},
        {"serve_period_ms", 1 + below(3)},
        {"on_fault", below(5) == 0 ? "stop_component" : "restart"},
        {"restart", {{"limit", 1'000'000}, {"back_off_ms", below(3)}, {"back_off_max_ms", 3}}},
        {"params",
         {{"peers", peers},
          {"modes", modes},
          {"executors", executors},
          {"wildness", below(3) == 0 ? 0 : 1 + below(25)}}}};
    if (is_live) {
      component["executor"] = executors[below(executors.size())];
    } else if (below(4) == 0) {
      component["simulated_cost_ms"] = 0.1;
    }
    components.push_back(std::move(component));
  }
  Json pinger = {{"name", "pinger"}, {"library", "pinger"}, {"serve_period_ms", 2}};
  if (is_live) {
    pinger["executor"] = "two";
  }
  components.push_back(pinger);
  if (has_driver) {
    Json driver = {
        {"name", "driver"}, {"library", "driver"}, {"params", {{"count", is_live ? 0 : 200}}}};
    if (is_live) {
      driver["executor"] = "one";
    }
    components.push_back(driver);
  }
  application["components"] = components;
  return application;
}

/// One application from its start to its end.
class Round {
 public:
  Round(const Options& options, std::uint64_t seed, unsigned workers, Watchdog& watchdog)
      : options_(options),
        seed_(seed),
        has_driver_(seed % 2 == 0),
        watchdog_(watchdog),
        before_(g_world.total()) {
    g_world.begin(options.is_live);
    const Json text = random_application(seed, options.is_live, has_driver_);
    for (const Json& component : text["components"]) {
      g_world.received[component["name"].get<std::string>()] = 0;
    }
    classes_.with<Player>("player").with<Driver>("driver").with<Pinger>("pinger");
    application_ = host::make_application(
        text.dump(), classes_,
        {.is_simulated = !options.is_live, .workers = options.is_live ? 0 : workers});
  }

  /// False if something did not hold.
  bool run(std::uint64_t operations) {
    expect("start");
    application_->start();
    g_world.is_wild = true;
    play(operations);
    g_world.is_wild = false;
    settle();
    expect_all_alive();
    expect("stop");
    application_->stop();
    expect("the ledgers");
    for (const auto& component : application_->components()) {
      check_end(*component);
    }
    check_ledgers();
    application_.reset();
    hold(g_world.objects == 0, "{} objects are left", g_world.objects.load());
    return is_fine_;
  }

  [[nodiscard]] bool is_deterministic() const { return !options_.is_live && !has_driver_; }
  /// What happened, for runs that must be equal.
  [[nodiscard]] const std::string& story() const { return story_; }
  [[nodiscard]] std::uint64_t done() const { return g_world.total() - before_; }

 private:
  void expect(std::string_view what) {
    watchdog_.expect(fmt::format("{} of the application with the seed {}", what, seed_));
  }

  template <typename... Args>
  void hold(bool holds, fmt::format_string<Args...> text, Args&&... args) {
    if (!holds) {
      is_fine_ = false;
      fmt::print(stderr, "operations: FAILED: seed {}: {}\n", seed_,
                 fmt::format(text, std::forward<Args>(args)...));
    }
  }

  void advance(Duration span) {
    if (options_.is_live) {
      std::this_thread::sleep_for(1ms);
    } else {
      simulated_ += span;
      application_->advance_to(application_->start_time() + simulated_);
    }
  }

  /// Lets the players play until so many operations are done, or nobody is left who plays.
  void play(std::uint64_t operations) {
    expect("playing");
    std::uint64_t last = 0;
    int idle = 0;
    while (done() < operations && idle < 200) {
      advance(10ms);
      idle = done() == last ? idle + 1 : 0;
      if (done() != last) {
        expect("playing");
      }
      last = done();
    }
  }

  template <typename Condition>
  void wait_for(std::string_view what, const Condition& condition) {
    expect(what);
    while (!condition()) {
      advance(5ms);
    }
  }

  /// Waits for what is under way: mode switches, and restarts.
  void settle() {
    wait_for("a mode switch", [&] { return !application_->modes().is_switching(); });
    wait_for("a restart", [&] {
      return std::ranges::none_of(application_->components(), [](const auto& component) {
        return component->state == State::kRestarting;
      });
    });
  }

  /// Each component serves its controls, and if it is active receives what is published from now
  /// on.
  void expect_all_alive() {
    std::vector<std::shared_ptr<std::atomic<bool>>> served;
    for (const auto& component : application_->components()) {
      served.push_back(std::make_shared<std::atomic<bool>>(false));
      component->post(detail::Cause::kEvent, [flag = served.back()] { *flag = true; });
    }
    for (std::size_t i = 0; i < served.size(); ++i) {
      wait_for(fmt::format("a control of {}", application_->components()[i]->name),
               [&] { return served[i]->load(); });
    }
    const std::uint64_t next = g_world.pings + 1;
    for (const auto& component : application_->components()) {
      if (component->description.library == "player") {
        wait_for(fmt::format("a message to {}", component->name), [&] {
          return component->state != State::kActive || g_world.received.at(component->name) >= next;
        });
      }
    }
  }

  void check_end(const ComponentCore& component) {
    const State state = component.state;
    const std::string last = component.last_fault;
    const bool may_fail = component.description.on_fault != config::OnFault::kRestart ||
                          last.find("when it was restarted") != std::string::npos;
    hold(state == State::kStopped || (state == State::kFailed && may_fail),
         "component {} ended as {} after \"{}\"", component.name, host::to_word(state), last);
    hold(component.description.library == "player" || component.fault_count == 0,
         "component {} faulted: {}", component.name, last);
    story_ += fmt::format("{} {} {}\n", component.name, component.statistics.activations.get(),
                          component.statistics.faults.get());
  }

  void check_ledgers() {
    for (const auto& [name, topic] : application_->topics().all()) {
      for (const auto& subscription : topic->subscriptions) {
        const detail::Ledger ledger = subscription->ledger();
        hold(ledger.adds_up(), "the ledger of {} to {} does not add up: {} ≠ {} + {} + {}", name,
             subscription->component, ledger.published, ledger.delivered, ledger.dropped_total(),
             ledger.queued);
        hold(ledger.queued == 0, "{} messages of {} are left to {}", ledger.queued, name,
             subscription->component);
        story_ += fmt::format("{} {} {} {}", name, subscription->component, ledger.published,
                              ledger.delivered);
        for (const std::uint64_t dropped : ledger.dropped) {
          story_ += fmt::format(" {}", dropped);
        }
        story_ += "\n";
      }
    }
  }

  const Options& options_;
  const std::uint64_t seed_;
  const bool has_driver_;
  Watchdog& watchdog_;
  const std::uint64_t before_;
  bool is_fine_ = true;
  Duration simulated_{0};
  std::string story_;
  host::TestClasses classes_;
  std::unique_ptr<host::Application> application_;
};

bool run_one(const Options& options, std::uint64_t seed, Watchdog& watchdog) {
  Round first(options, seed, 1, watchdog);
  const bool is_deterministic = first.is_deterministic();
  bool is_fine = first.run(options.each);
  const std::string story = first.story();
  if (is_fine && is_deterministic) {
    Round second(options, seed, 3, watchdog);
    is_fine = second.run(options.each);
    if (second.story() != story) {
      fmt::print(stderr, "operations: FAILED: seed {}: another run with three workers\n{}\n---\n{}",
                 seed, story, second.story());
      is_fine = false;
    }
  }
  return is_fine;
}

void print_counts() {
  std::string text;
  for (std::size_t place = 0; place < kOperations; ++place) {
    text += fmt::format("{}{} {}", place == 0 ? "" : ", ", to_word(static_cast<Operation>(place)),
                        g_world.done[place].load());
  }
  fmt::print("{}\n", text);
}

std::size_t operation_named(std::string_view word) {
  for (std::size_t place = 0; place < kOperations; ++place) {
    if (to_word(static_cast<Operation>(place)) == word) {
      return place;
    }
  }
  throw std::runtime_error(
      fmt::format("there is no operation \"{}\"; --list says which there are", word));
}

void set_all(std::string_view names, bool is_allowed) {
  while (!names.empty()) {
    const std::size_t end = std::min(names.find(','), names.size());
    g_world.is_allowed[operation_named(names.substr(0, end))] = is_allowed;
    names.remove_prefix(std::min(end + 1, names.size()));
  }
}

/// Null if there is nothing to run.
std::optional<Options> options_of(const std::vector<std::string>& arguments) {
  Options options;
  g_world.is_allowed.fill(true);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    if (word == "--list") {
      for (std::size_t place = 0; place < kOperations; ++place) {
        fmt::print("{}\n", to_word(static_cast<Operation>(place)));
      }
      return std::nullopt;
    }
    if (word == "--help") {
      fmt::print("{}", kHelp);
      return std::nullopt;
    }
    if (word == "--verbose") {
      options.is_verbose = true;
      continue;
    }
    if (i + 1 == arguments.size()) {
      throw std::runtime_error(fmt::format("\"{}\" is no option, or has no value", word));
    }
    const std::string& value = arguments[++i];
    if (word == "--mode") {
      options.is_live = value == "live";
    } else if (word == "--seed") {
      options.seed = std::stoull(value);
    } else if (word == "--operations") {
      options.operations = std::stoull(value);
    } else if (word == "--each") {
      options.each = std::stoull(value);
    } else if (word == "--seconds") {
      options.time = std::chrono::seconds(std::stoll(value));
    } else if (word == "--limit") {
      options.limit = std::chrono::seconds(std::stoll(value));
    } else if (word == "--only") {
      g_world.is_allowed.fill(false);
      set_all(value, true);
    } else if (word == "--without") {
      set_all(value, false);
    } else {
      throw std::runtime_error(
          fmt::format("\"{}\" is no option; --help says which there are", word));
    }
  }
  if (!options.is_live) {
    // It would never come to an end at one moment of simulated time.
    g_world.is_allowed[static_cast<std::size_t>(Operation::kInsist)] = false;
  }
  return options;
}

int run(const Options& options) {
  Watchdog watchdog(options.limit);
  const Clock::time_point end = Clock::now() + options.time.value_or(0s);
  std::uint64_t seed = options.seed;
  std::uint64_t applications = 0;
  while (options.time ? Clock::now() < end : g_world.total() < options.operations) {
    const std::uint64_t before = g_world.total();
    if (!run_one(options, seed, watchdog)) {
      print_counts();
      return 1;
    }
    if (options.is_verbose) {
      fmt::print("seed {}: {} operations\n", seed, g_world.total() - before);
      std::fflush(stdout);
    }
    ++seed;
    ++applications;
  }
  fmt::print("operations: {} in {} applications, {}, seeds {} to {}: all holds\n", g_world.total(),
             applications, options.is_live ? "live" : "simulated", options.seed, seed - 1);
  print_counts();
  return 0;
}

}  // namespace
}  // namespace fastcycle::operations

int main(int argc, char** argv) {
  try {
    const auto options = fastcycle::operations::options_of({argv + 1, argv + argc});
    return options ? fastcycle::operations::run(*options) : 0;
  } catch (const std::exception& exception) {
    fmt::print(stderr, "operations: {}\n", exception.what());
    return 2;
  }
}
