#include "estimate/system_of.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include <sched.h>

#include "component/component_core.h"
#include "config/nearest.h"
#include "executor/synchronizer.h"

namespace fastcycle::estimate {
namespace {

using config::Problems;
using detail::CallbackSubscription;
using detail::ComponentCore;
using detail::Subscription;

/// As an adaptive worker does: src/executor/executor.cc.
constexpr Duration kAdaptiveLook = std::chrono::microseconds(50);

unsigned cpu_count() {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  if (sched_getaffinity(0, sizeof(cpus), &cpus) == 0) {
    return static_cast<unsigned>(CPU_COUNT(&cpus));
  }
  return std::max(1U, std::thread::hardware_concurrency());
}

class SystemBuilder {
 public:
  SystemBuilder(const host::Application& application, const Timing& timing, const Machine& machine,
                Problems& problems)
      : application_(application), timing_(timing), problems_(problems) {
    system_.cpus = machine.cpus == 0 ? cpu_count() : machine.cpus;
    system_.wake_up = machine.wake_up;
  }

  System build() {
    add_executors();
    for (const auto& [name, topic] : application_.topics().all()) {
      topics_[name] = system_.topics.size();
      system_.topics.push_back(name);
    }
    for (const auto& component : application_.components()) {
      add_component(*component);
    }
    add_sources();
    check_names();
    for (const config::ChainDescription& chain : application_.description().chains) {
      if (const auto from = place_of(chain.from), to = place_of(chain.to); from && to) {
        system_.chains.push_back({chain.name, *from, *to, chain.deadline});
      } else {
        problems_.add(
            config::make_error(chain.place, "chain " + config::in_quotes(chain.name) +
                                                ": nobody publishes or subscribes to " +
                                                config::in_quotes(from ? chain.to : chain.from)));
      }
    }
    return std::move(system_);
  }

 private:
  [[nodiscard]] std::optional<std::size_t> place_of(const std::string& topic) const {
    const auto found = topics_.find(topic);
    return found == topics_.end() ? std::nullopt : std::optional(found->second);
  }

  void add_executors() {
    for (const config::ExecutorDescription& its : application_.description().executors) {
      system_.executors.push_back(
          {.name = its.name,
           .threads = static_cast<unsigned>(its.threads),
           .cpus = its.cpus,
           .priority = its.policy == config::Policy::kOther ? 0 : its.priority,
           .hand_over = its.hand_over,
           .is_spinning = its.wait == config::Wait::kSpin,
           .looks_for = its.wait == config::Wait::kAdaptive ? kAdaptiveLook : Duration()});
    }
    const std::vector<std::string> names = application_.executor_names();
    if (names.size() > system_.executors.size()) {
      system_.executors.push_back({.name = names.back(), .threads = std::min(system_.cpus, 64U)});
    }
    executors_in_main_ = static_cast<std::ptrdiff_t>(system_.executors.size());
  }

  std::size_t executor_of(const ComponentCore& component) {
    const auto described = system_.executors.begin() + executors_in_main_;
    const auto found = std::ranges::find(system_.executors.begin(), described,
                                         component.description.executor, &Executor::name);
    const auto place = static_cast<std::size_t>((found == described ? described - 1 : found) -
                                                system_.executors.begin());
    const std::string& process = component.description.process;
    if (process.empty()) {
      return place;
    }
    const auto [known, is_new] =
        executors_in_processes_.emplace(std::pair(process, place), system_.executors.size());
    if (is_new) {
      system_.executors.push_back(in_process(system_.executors[place], process));
    }
    return known->second;
  }

  /// An executor exists in each process once, and runs where both may.
  [[nodiscard]] Executor in_process(Executor executor, const std::string& process) const {
    executor.name = process + '/' + executor.name;
    const auto& all = application_.description().processes;
    const auto its = std::ranges::find(all, process, &config::ProcessDescription::name);
    if (its == all.end() || its->cpus.empty()) {
      return executor;
    }
    if (executor.cpus.empty()) {
      executor.cpus = its->cpus;
    } else {
      std::erase_if(executor.cpus,
                    [&](int cpu) { return std::ranges::find(its->cpus, cpu) == its->cpus.end(); });
    }
    return executor;
  }

  void add_component(const ComponentCore& core) {
    const std::size_t component = system_.components.size();
    system_.components.push_back({core.name, executor_of(core)});
    const std::size_t first = system_.callbacks.size();
    for (const CallbackSubscription* subscription : core.subscriptions.callbacks()) {
      if (subscription->kind == Subscription::Kind::kCallback) {
        add_callback(core.name, component, {subscription});
      }
    }
    for (const auto& synchronizer : core.subscriptions.synchronizers()) {
      std::vector<const CallbackSubscription*> inputs;
      for (std::size_t i = 0; i < synchronizer->input_count(); ++i) {
        inputs.push_back(&synchronizer->input(i));
      }
      Callback& callback = add_callback(core.name, component, inputs);
      const SynchronizerOptions& options = synchronizer->options();
      callback.max_difference = options.max_difference;
      callback.joining = options.policy == SyncPolicy::kLatest ? Joining::kLatest
                         : options.time == SyncTime::kTaken    ? Joining::kSets
                                                               : Joining::kPublishedSets;
    }
    for (const detail::View* view : core.subscriptions.views()) {
      system_.views.push_back({component, topics_.at(view->topic.name), view->topic.ages()});
    }
    add_timers(core, component);
    add_publications(core, first);
  }

  Callback& add_callback(const std::string& name, std::size_t component,
                         const std::vector<const CallbackSubscription*>& inputs) {
    Callback callback;
    callback.component = component;
    std::vector<std::string> keys;
    for (const CallbackSubscription* input : inputs) {
      keys.push_back(input->topic.name);
      callback.inputs.push_back({topics_.at(input->topic.name), input->depth, input->topic.ages()});
      callback.name += (callback.name.empty() ? "" : " + ") + input->topic.name;
    }
    take_timing(name, callback, keys);
    return system_.callbacks.emplace_back(std::move(callback));
  }

  void add_timers(const ComponentCore& core, std::size_t component) {
    for (const auto& timer : core.timers()) {
      // The framework's own timers call the component only after errors.
      if (timer->watch != nullptr || (!timer->is_periodic() && !timer->role.name.empty())) {
        continue;
      }
      std::vector<std::string> keys{"timer " + std::to_string(timer->number)};
      if (timer->role.name == "serve") {
        keys.insert(keys.begin(), "serve");
      }
      Callback callback;
      callback.name = keys.front();
      callback.component = component;
      if (timer->is_periodic()) {
        callback.arrivals = Arrivals{timer->options.period};
      }
      take_timing(core.name, callback, keys);
      system_.callbacks.push_back(std::move(callback));
    }
  }

  /// `keys`: what timing may call it; the first is its name.
  void take_timing(const std::string& component, Callback& callback,
                   const std::vector<std::string>& keys) {
    keys_[component].insert(keys_[component].end(), keys.begin(), keys.end());
    const auto its = timing_.components.find(component);
    if (its == timing_.components.end()) {
      return;
    }
    for (const std::string& key : keys) {
      if (const auto found = its->second.callbacks.find(key);
          found != its->second.callbacks.end()) {
        take_timing(component, callback, found->second);
      }
    }
    if (!callback.run_time) {
      callback.run_time = its->second.run_time;
    }
  }

  void take_timing(const std::string& component, Callback& callback, const CallbackTiming& said) {
    if (said.run_time) {
      callback.run_time = std::max(callback.run_time.value_or(Duration()), *said.run_time);
    }
    if (said.arrivals && callback.inputs.empty() && !callback.arrivals) {
      callback.arrivals = said.arrivals;
    }
    if (said.publishes) {
      callback.always_publishes = said.always_publishes;
      for (const auto& [topic, messages] : *said.publishes) {
        if (const auto place = place_of(topic)) {
          callback.publishes.push_back({*place, messages});
        } else {
          problems_.add(
              config::make_error(said.place, "there is no topic " + config::in_quotes(topic),
                                 config::did_you_mean(config::nearest(topic, system_.topics))));
        }
      }
      given_.insert(component + "\n" + callback.name);
    }
  }

  void add_publications(const ComponentCore& core, std::size_t first) {
    std::vector<Publication> all;
    for (const auto& [name, topic] : application_.topics().all()) {
      for (const auto& publisher : topic->publishers) {
        if (publisher->owner.name != core.name) {
          continue;
        }
        if (!publisher->options.is_external) {
          all.push_back({topics_.at(name), 1});
        }
      }
    }
    const std::size_t count = system_.callbacks.size() - first;
    for (std::size_t i = first; i < system_.callbacks.size(); ++i) {
      Callback& callback = system_.callbacks[i];
      if (!given_.contains(core.name + "\n" + callback.name)) {
        callback.publishes = all;
        callback.always_publishes = count == 1;
      }
    }
  }

  void add_sources() {
    for (const auto& [name, topic] : application_.topics().all()) {
      for (const auto& publisher : topic->publishers) {
        if (!publisher->options.is_external) {
          continue;
        }
        Source source;
        source.name = "the threads of \"" + publisher->owner.name + "\"";
        source.topic = topics_.at(name);
        if (const auto said = timing_.sources.find(name); said != timing_.sources.end()) {
          source.arrivals = said->second.arrivals;
          source.keeps_coming = said->second.keeps_coming;
          source.age = said->second.age;
        }
        system_.sources.push_back(std::move(source));
      }
    }
  }

  /// Reports names of the timing without a match.
  void check_names() {
    std::vector<std::string> components;
    for (const Component& component : system_.components) {
      components.push_back(component.name);
    }
    for (const auto& [name, component] : timing_.components) {
      if (std::ranges::find(components, name) == components.end()) {
        problems_.add(config::make_error(component.place,
                                         "there is no component " + config::in_quotes(name),
                                         config::did_you_mean(config::nearest(name, components))));
        continue;
      }
      for (const auto& [key, callback] : component.callbacks) {
        const std::vector<std::string>& known = keys_[name];
        if (std::ranges::find(known, key) == known.end()) {
          if (!callback.is_given) {
            continue;  // From a recording in which this component was another, or had other inputs.
          }
          std::string all;
          for (const std::string& one : known) {
            all += (all.empty() ? "" : ", ") + config::in_quotes(one);
          }
          problems_.add(config::make_error(callback.place,
                                           config::in_quotes(name) + " has no callback " +
                                               config::in_quotes(key) + ", only " + all,
                                           config::did_you_mean(config::nearest(key, known))));
        }
      }
    }
    std::vector<std::string> outside;
    for (const Source& source : system_.sources) {
      outside.push_back(system_.topics[source.topic]);
    }
    for (const auto& [topic, source] : timing_.sources) {
      if (std::ranges::find(outside, topic) == outside.end()) {
        problems_.add(config::make_error(
            source.place, "no thread of a component publishes " + config::in_quotes(topic),
            config::did_you_mean(config::nearest(topic, outside))));
      }
    }
  }

  const host::Application& application_;
  const Timing& timing_;
  Problems& problems_;
  System system_;
  std::ptrdiff_t executors_in_main_ = 0;  ///< Those of other processes come after these.
  /// By process and place in the main process.
  std::map<std::pair<std::string, std::size_t>, std::size_t> executors_in_processes_;
  std::map<std::string, std::size_t> topics_;
  std::map<std::string, std::vector<std::string>> keys_;  ///< Of callbacks, by component.
  std::set<std::string> given_;  ///< Component and callback, whose publishes are given.
};

}  // namespace

System system_of(const host::Application& application, const Timing& timing, const Machine& machine,
                 config::Problems& problems) {
  return SystemBuilder(application, timing, machine, problems).build();
}

}  // namespace fastcycle::estimate
