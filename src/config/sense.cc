#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "config/describe.h"
#include "config/main_process.h"
#include "config/nearest.h"

namespace fastcycle::config {

namespace {

/// The checks of one application, one after the other. `check` runs them all.
class Sense {
 public:
  Sense(const ApplicationDescription& application, Problems& problems)
      : application_(application), problems_(problems) {
    for (const ComponentDescription& component : application.components) {
      components_.emplace(component.name, &component);
    }
    for (const TopicDescription& topic : application.topics) {
      topics_.emplace(topic.name, &topic);
    }
    for (const ProcessDescription& process : application.processes) {
      processes_.emplace(process.name, &process);
    }
  }

  void check() {
    check_application();
    check_names_are_used_once(application_.components, "component");
    check_names_are_used_once(application_.executors, "executor");
    check_names_are_used_once(application_.topics, "topic");
    for (const ExecutorDescription& executor : application_.executors) {
      check_policy(executor);
      check_cpus(executor);
      check_spin(executor);
      check_executor_is_used(executor);
      check_executor_in_processes(executor);
    }
    check_processes();
    for (const ShadowDescription& shadow : application_.shadows) {
      check_shadow(shadow);
    }
    for (const TopicDescription& topic : application_.topics) {
      check_pool(topic);
    }
    for (const ComponentDescription& component : application_.components) {
      check_name(component);
      check_library(component);
      check_executor_is_known(component);
      check_phase(component);
      check_ends(component);
      for (const auto& [name, thread] : component.threads) {
        check_policy(thread);
      }
      check_after_is_known(component);
    }
    check_starts_have_an_order();
    check_modes();
    check_chains();
  }

 private:
  void add(const Place& at, const std::string& key, std::string message, std::string hint = {}) {
    Place place = at;
    if (!key.empty()) {
      place = place_of(at, key);
    }
    problems_.add(make_error(std::move(place), std::move(message), std::move(hint)));
  }

  // The place of a key of the executor, topic or component at `at`: it may come from another file.
  [[nodiscard]] Place place_of(const Place& at, const std::string& key) {
    if (written_.empty()) {
      find_written();
    }
    const auto found = written_.find(to_string(at));
    const Value* value = found == written_.end() ? nullptr : found->second->find(key);
    return value == nullptr ? at : value->place();
  }

  // Of those that are written at the same place, as in a file that is included twice, the first.
  void find_written() {
    for (const auto section :
         {"executors", "processes", "components", "topics", "modes", "chains"}) {
      const Value* list = application_.effective.find(section);
      if (list == nullptr) {
        continue;
      }
      if (list->is_array()) {
        for (const Value& value : list->items()) {
          written_.emplace(to_string(value.place()), &value);
        }
      } else if (list->is_object()) {
        for (const auto& [name, value] : list->members()) {
          written_.emplace(to_string(value.place()), &value);
        }
      }
    }
  }

  // No search if the hint would not be reported.
  [[nodiscard]] std::string hint_for(const std::string& name,
                                     const std::vector<std::string>& known) const {
    return problems_.keeps_errors() ? did_you_mean(nearest(name, known)) : std::string();
  }

  void check_application() {
    if (application_.name.empty() && application_.effective.find("name") == nullptr) {
      add(application_.place, "", "the key \"name\" is missing");
    }
    if (application_.components.empty()) {
      add(application_.place, "", "the application has no components");
    }
  }

  void check_name(const ComponentDescription& component) {
    if (component.name == "fastcycle" || component.name.starts_with("fastcycle/")) {
      add(component.place, "name",
          "the component " + in_quotes(component.name) +
              " needs another name: \"fastcycle\" is the component of FastCycle itself");
    }
  }

  template <typename Described>
  void check_names_are_used_once(const std::vector<Described>& all, const std::string& what) {
    std::map<std::string, Place> first;
    for (const Described& one : all) {
      const auto [place, is_new] = first.emplace(one.name, one.place);
      if (!is_new && !one.name.empty()) {
        add(one.place, "name",
            "the " + what + " " + in_quotes(one.name) + " is there twice, first at " +
                to_string(place->second));
      }
    }
  }

  template <typename Description>
  void check_policy(const Description& its) {
    const std::string policy = in_quotes(to_string(its.policy));
    const bool is_real_time = its.policy != Policy::kOther;
    if (is_real_time && its.priority == 0) {
      add(its.place, "policy", "the policy " + policy + " needs a \"priority\" in [1, 99]");
    }
    if (!is_real_time && its.priority != 0) {
      add(its.place, "priority", "a \"priority\" has no meaning with the policy " + policy,
          "set \"policy\" to \"fifo\" or \"rr\"");
    }
    if (is_real_time && its.slice_us != 0) {
      add(its.place, "slice_us", "a \"slice_us\" has no meaning with the policy " + policy,
          "remove it, or set \"policy\" to \"other\"");
    }
  }

  void check_cpus(const ExecutorDescription& executor) {
    const std::set<int> different(executor.cpus.begin(), executor.cpus.end());
    if (!different.empty() && executor.threads > static_cast<int>(different.size())) {
      add(executor.place, "threads",
          std::to_string(executor.threads) + " threads have only " +
              std::to_string(different.size()) + " of the \"cpus\" to run on");
    }
  }

  // The kernel stops real-time threads that leave a CPU no time for others: a spinning worker would
  // be halted in the middle of a callback, for milliseconds.
  void check_spin(const ExecutorDescription& executor) {
    if (executor.wait != Wait::kSpin || executor.policy == Policy::kOther) {
      return;
    }
    if (executor.cpus.empty()) {
      add(executor.place, "wait", "\"spin\" with a real-time policy needs \"cpus\" of its own");
    }
    for (const ExecutorDescription& other : application_.executors) {
      for (const int cpu : executor.cpus) {
        if (&other != &executor && std::ranges::find(other.cpus, cpu) != other.cpus.end()) {
          add(executor.place, "wait",
              "\"spin\" with a real-time policy needs a CPU of its own, but CPU " +
                  std::to_string(cpu) + " is also of the executor " + in_quotes(other.name));
        }
      }
    }
  }

  void check_executor_is_used(const ExecutorDescription& executor) {
    const bool is_used = std::ranges::any_of(
        application_.components,
        [&](const ComponentDescription& component) { return component.executor == executor.name; });
    if (!is_used && !executor.name.empty()) {
      warn(executor.place, "no component uses the executor " + in_quotes(executor.name));
    }
  }

  void warn(const Place& place, std::string message, std::string hint = {}) {
    Problem problem = make_error(place, std::move(message), std::move(hint));
    problem.warning = true;
    problems_.add(std::move(problem));
  }

  // An executor exists in each process that has a component of it, with all its workers.
  void check_executor_in_processes(const ExecutorDescription& executor) {
    std::set<std::string> names;
    for (const ComponentDescription& component : application_.components) {
      if (component.executor == executor.name && names.insert(component.process).second) {
        check_cpus_in_process(executor, component.process);
      }
    }
    if (names.size() > 1 && executor.wait == Wait::kSpin && !executor.cpus.empty()) {
      warn(place_of(executor.place, "wait"),
           "the executor " + in_quotes(executor.name) + " spins in " +
               std::to_string(names.size()) + " processes, which share its \"cpus\"",
           "give the components of each process an executor of their own");
    }
  }

  void check_cpus_in_process(const ExecutorDescription& executor, const std::string& name) {
    const auto process = processes_.find(name);
    if (executor.cpus.empty() || process == processes_.end() || process->second->cpus.empty()) {
      return;
    }
    const std::vector<int>& cpus = process->second->cpus;
    const bool has_one = std::ranges::any_of(
        executor.cpus, [&](int cpu) { return std::ranges::find(cpus, cpu) != cpus.end(); });
    if (!has_one) {
      add(executor.place, "cpus",
          "none of the \"cpus\" of the executor " + in_quotes(executor.name) +
              " is one of its process " + in_quotes(name));
    }
  }

  void check_processes() {
    const std::vector<ProcessDescription> described = described_processes(application_.effective);
    check_names_are_used_once(described, "process");
    std::unordered_set<std::string> names;
    std::vector<std::string> unused;
    for (const ProcessDescription& process : described) {
      names.insert(process.name);
      if (process.name == kMainProcess) {
        add(process.place, "name",
            "\"main\" is the process that was started, which is not described",
            "name another, or leave it out");
      } else if (!process.name.empty() && !processes_.contains(process.name)) {
        warn(process.place, "no component is in the process " + in_quotes(process.name));
        unused.push_back(process.name);
      }
    }
    // A process need not be described. But an unused described one may have been meant.
    constexpr std::size_t kMaxCompared = 20;
    unused.resize(std::min(unused.size(), kMaxCompared));
    for (const ProcessDescription& process : application_.processes) {
      const std::string meant =
          names.contains(process.name) ? std::string() : nearest(process.name, unused);
      if (!meant.empty()) {
        warn(process.place, "the process " + in_quotes(process.name) + " is not described",
             did_you_mean(meant));
      }
    }
  }

  void check_shadow(const ShadowDescription& shadow) {
    const auto found = components_.find(shadow.of);
    if (found == components_.end()) {
      std::vector<std::string> names;
      for (const ComponentDescription& component : application_.components) {
        names.push_back(component.name);
      }
      add(shadow.place, "of", "there is no component " + in_quotes(shadow.of),
          did_you_mean(nearest(shadow.of, names)));
      return;
    }
    const auto process = processes_.find(found->second->process);
    if (process != processes_.end() && process->second->has_standby) {
      add(shadow.place, "of",
          "the process of the component " + in_quotes(shadow.of) + " has a standby, and no shadow");
    }
    const auto is_of_that_name = [&](const auto& one) { return one.name == shadow.name; };
    if (processes_.contains(shadow.name) || components_.contains(shadow.name) ||
        std::ranges::count_if(application_.shadows, is_of_that_name) > 1) {
      add(shadow.place, "name", "the name " + in_quotes(shadow.name) + " is used twice",
          "give each shadow a \"name\" of its own");
    }
  }

  void check_pool(const TopicDescription& topic) {
    const std::size_t held = topic.keep + static_cast<std::size_t>(std::max(0, topic.latched));
    if (topic.pool_max && held >= *topic.pool_max) {
      add(topic.place, "pool_max",
          "a pool of at most " + std::to_string(*topic.pool_max) +
              " has no message left to lend: " + std::to_string(held) + " are kept or latched");
    }
  }

  void check_library(const ComponentDescription& component) {
    const bool has_library =
        !component.library.empty() || place_of(component.place, "library") != component.place;
    if (!has_library) {
      add(component.place, "", "the key \"library\" is missing");
    }
  }

  void check_executor_is_known(const ComponentDescription& component) {
    const auto& executors = application_.executors;
    if (component.executor.empty() ||
        std::ranges::find(executors, component.executor, &ExecutorDescription::name) !=
            executors.end()) {
      return;
    }
    std::vector<std::string> names;
    for (const ExecutorDescription& executor : executors) {
      names.push_back(executor.name);
    }
    std::string hint = hint_for(component.executor, names);
    if (names.empty()) {
      hint = "the application describes no \"executors\"";
    }
    add(component.place, "executor", "there is no executor " + in_quotes(component.executor),
        std::move(hint));
  }

  [[nodiscard]] const ComponentDescription* find_component(const std::string& name) const {
    const auto found = components_.find(name);
    return found == components_.end() ? nullptr : found->second;
  }

  void check_after_is_known(const ComponentDescription& component) {
    for (const std::string& name : component.after) {
      if (find_component(name) == nullptr) {
        if (component_names_.empty()) {
          for (const ComponentDescription& known : application_.components) {
            component_names_.push_back(known.name);
          }
        }
        add(component.place, "after",
            "there is no component " + in_quotes(name) + " to start after",
            hint_for(name, component_names_));
      }
    }
  }

  // Each circle once, from the component in it that comes first in the file.
  void check_starts_have_an_order() {
    std::set<std::string> done;
    for (const ComponentDescription& component : application_.components) {
      follow(component, done);
    }
  }

  /// A component on the way, and which of those that it starts after comes next.
  struct Step {
    const ComponentDescription* component;
    std::size_t next = 0;
  };

  // Follows "after" from `first` to all that is not `done` yet. Not by recursion: a way may be as
  // long as there are components.
  void follow(const ComponentDescription& first, std::set<std::string>& done) {
    std::vector<Step> way;
    std::map<std::string, std::size_t> on_way;
    const auto enter = [&](const ComponentDescription& component) {
      if (const auto begin = on_way.find(component.name); begin != on_way.end()) {
        add_circle(way, begin->second);
      } else if (!done.contains(component.name)) {
        on_way.emplace(component.name, way.size());
        way.push_back({&component});
      }
    };
    enter(first);
    while (!way.empty()) {
      Step& last = way.back();
      if (last.next < last.component->after.size()) {
        const std::string& name = last.component->after[last.next++];
        if (const ComponentDescription* before = find_component(name)) {
          enter(*before);
        }
        continue;
      }
      on_way.erase(last.component->name);
      done.insert(last.component->name);
      way.pop_back();
    }
  }

  void add_circle(const std::vector<Step>& way, std::size_t begin) {
    constexpr std::size_t kMaxShown = 16;
    std::string circle;
    for (std::size_t i = begin; i < std::min(way.size(), begin + kMaxShown); ++i) {
      circle += in_quotes(way[i].component->name) + " after ";
    }
    if (way.size() > begin + kMaxShown) {
      circle += "… after ";
    }
    const std::string& first = way[begin].component->name;
    add(find_component(first)->place, "after",
        "components start after each other: " + circle + in_quotes(first));
  }

  void check_modes() {
    const std::vector<std::string> names = mode_names();
    if (names.empty()) {
      if (const Value* initial = application_.effective.find("initial_mode")) {
        add(initial->place(), "", "an \"initial_mode\" has no meaning without \"modes\"");
      }
    } else if (application_.initial_mode.empty()) {
      add(application_.place, "", "the key \"initial_mode\" is missing, which \"modes\" need");
    } else if (std::ranges::find(names, application_.initial_mode) == names.end()) {
      add(application_.effective["initial_mode"].place(), "",
          "there is no mode " + in_quotes(application_.initial_mode),
          did_you_mean(nearest(application_.initial_mode, names)));
    }
    for (const ComponentDescription& component : application_.components) {
      const std::string& mode = component.fault_mode;
      if (!mode.empty() && std::ranges::find(names, mode) == names.end()) {
        add(component.place, "fault_mode", "there is no mode " + in_quotes(mode),
            names.empty() ? "the application describes no \"modes\"" : hint_for(mode, names));
      }
    }
  }

  [[nodiscard]] std::vector<std::string> mode_names() const {
    std::vector<std::string> names;
    for (const ModeDescription& mode : application_.modes) {
      names.push_back(mode.name);
    }
    return names;
  }

  // Whether its topics exist and are connected can be checked only with the code.
  void check_chains() {
    check_names_are_used_once(application_.chains, "chain");
    std::set<std::string> roots;
    for (const ChainDescription& chain : application_.chains) {
      check_chain_is_complete(chain);
      check_chain_mode(chain);
      if (chain.from == chain.to && !chain.from.empty()) {
        add(chain.place, "to",
            "the chain " + in_quotes(chain.name) + " ends where it begins, at " +
                in_quotes(chain.to));
      }
      const bool is_new = !chain.from.empty() && roots.insert(chain.from).second;
      if (is_new && roots.size() == kMaxChainRoots + 1) {
        add(chain.place, "from",
            "chains begin at more than " + std::to_string(kMaxChainRoots) + " topics");
      }
    }
  }

  // Not by the schema, which an overlay has to keep to as well.
  void check_chain_is_complete(const ChainDescription& chain) {
    for (const char* key : {"from", "to", "deadline_ms"}) {
      if (place_of(chain.place, key) == chain.place) {
        add(chain.place, "", "the key " + in_quotes(key) + " is missing");
      }
    }
  }

  void check_chain_mode(const ChainDescription& chain) {
    const std::vector<std::string> names = mode_names();
    const bool is_degrading = chain.on_breach == OnBreach::kDegrade;
    if (is_degrading && chain.mode.empty()) {
      add(chain.place, "on_breach", "\"degrade\" needs the key \"mode\"");
    } else if (!is_degrading && !chain.mode.empty()) {
      add(chain.place, "mode", "a \"mode\" has no meaning where \"on_breach\" is not \"degrade\"");
    } else if (is_degrading && std::ranges::find(names, chain.mode) == names.end()) {
      add(chain.place, "mode", "there is no mode " + in_quotes(chain.mode),
          names.empty() ? "the application describes no \"modes\"" : hint_for(chain.mode, names));
    }
  }

  void check_phase(const ComponentDescription& component) {
    if (component.serve_phase.count() == 0) {
      return;
    }
    if (!component.serve_period) {
      add(component.place, "serve_phase_ms",
          "\"serve_phase_ms\" has no meaning without \"serve_period_ms\"");
    } else if (component.serve_phase >= *component.serve_period) {
      add(component.place, "serve_phase_ms",
          "\"serve_phase_ms\" has to be less than \"serve_period_ms\"");
    }
  }

  // Duplicate options of a topic, by its name with and without the slash or by a remap, would
  // depend on the order.
  void check_ends(const ComponentDescription& component) {
    check_topics_are_different(component, component.subscribers);
    check_topics_are_different(component, component.publishers);
    for (const auto& [name, subscriber] : component.subscribers) {
      check_history(component, name, subscriber);
    }
  }

  void check_history(const ComponentDescription& component, const std::string& name,
                     const SubscriberDescription& subscriber) {
    const std::string topic = resolve_topic(component, name);
    const auto found = topics_.find(topic);
    const int latched = found == topics_.end() ? 0 : found->second->latched;
    if (subscriber.history && std::cmp_greater(*subscriber.history, latched)) {
      add(subscriber.place, "",
          "a \"history\" of " + std::to_string(*subscriber.history) + ", but the topic " +
              in_quotes(topic) +
              (latched == 0 ? " is not latched" : " keeps only " + std::to_string(latched)),
          "set \"latched\" under \"topics\"");
    }
  }

  template <typename End>
  void check_topics_are_different(const ComponentDescription& component,
                                  const std::map<std::string, End>& ends) {
    std::map<std::string, std::string> first;
    for (const auto& [name, end] : ends) {
      const std::string topic = resolve_topic(component, name);
      const auto [other, is_new] = first.emplace(topic, name);
      if (!is_new) {
        add(end.place, "",
            in_quotes(name) + " and " + in_quotes(other->second) + " are the same topic " +
                in_quotes(topic));
      }
    }
  }

  const ApplicationDescription& application_;
  Problems& problems_;
  // By name; of several with one name the first.
  std::unordered_map<std::string, const ComponentDescription*> components_;
  std::unordered_map<std::string, const TopicDescription*> topics_;
  std::unordered_map<std::string, const ProcessDescription*> processes_;
  // Filled by the first error that needs them.
  std::vector<std::string> component_names_;
  std::unordered_map<std::string, const Value*> written_;  ///< By place, as text.
};

}  // namespace

void check_sense(const ApplicationDescription& application, Problems& problems) {
  Sense(application, problems).check();
  check_faults(application, problems);
}

}  // namespace fastcycle::config
