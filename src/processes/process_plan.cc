#include "processes/process_plan.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "component/time_driver.h"

namespace fastcycle::processes {

using segment::ProcessIndex;

namespace {

/// Maximum depth of a queue between processes; below 65536 together with messages held beside it.
constexpr std::size_t kMaxDepth = 16'384;
/// Margin above the intended holders: for messages returned but not collected yet, and messages in
/// a callback.
constexpr std::size_t kSpare = 8;
/// Minimum depth for a component that is, or was, on standby.
constexpr std::size_t kDepthOfStandbyIfLarge = 16;  // While more than 16 MiB are out.
constexpr std::size_t kDepthOfStandby = 256;

}  // namespace

ProcessPlan::ProcessPlan(config::ApplicationDescription description, host::ApplicationWiring wiring,
                         const Needs& needs)
    : description_(std::move(description)),
      wiring_(std::move(wiring)),
      is_simulated_(needs.is_simulated) {
  names_ = {"supervisor", kMainName};
  for (const config::ProcessDescription& process : description_.processes) {
    names_.push_back(process.name);
  }
  if (!is_simulated_) {
    first_standby_ = count();
    add_standbys();
  }
  find_problems();
  if (problem_) {
    return;
  }
  wire_.processes = count();
  wire_.is_simulated = is_simulated_;
  // After each component's stage: the progress, when timers began (two words), heartbeat, pid.
  wire_.components = description_.components.size() + 5;
  std::set<std::string> roots;
  for (const config::ChainDescription& chain : description_.chains) {
    roots.insert(chain.from);
  }
  wire_.roots = roots.size();
  for (ProcessIndex process = kMain; process < count(); ++process) {
    wire_.executors =
        std::max(wire_.executors, static_cast<unsigned>(executors_in(process).size()));
  }
  add_links(needs);
  if (needs.has_activity || !wiring_.recorders.empty() ||
      (first_standby_ > 0 && count() > first_standby_)) {
    add_activity(needs);
  }
  wire_.lay_out();
}

/// None in simulated time: no failures are expected there.
void ProcessPlan::add_standbys() {
  for (ProcessIndex process = kMain + 1; process < first_standby_; ++process) {
    if (description_of(process).has_standby) {
      names_.push_back(names_[process] + kStandbySuffix);
      primaries_.push_back(process);
    }
  }
  first_shadow_ = count();
  for (const config::ShadowDescription& shadow : description_.shadows) {
    names_.push_back(shadow.name);
  }
}

const config::ShadowDescription* ProcessPlan::shadow_in(ProcessIndex process) const {
  return first_shadow_ > 0 && process >= first_shadow_
             ? &description_.shadows[process - first_shadow_]
             : nullptr;
}

std::optional<ProcessIndex> ProcessPlan::other_of(ProcessIndex process) const {
  if (const config::ShadowDescription* const shadow = shadow_in(process)) {
    return process_of(shadow->of);
  }
  return twin_of(process);
}

std::vector<ProcessIndex> ProcessPlan::followers_of(ProcessIndex process) const {
  std::vector<ProcessIndex> followers;
  for (ProcessIndex one = kMain; one < count(); ++one) {
    if (one != process && shadow_in(process) == nullptr && other_of(one) == process) {
      followers.push_back(one);
    }
  }
  return followers;
}

config::ComponentDescription described_as_shadow(config::ComponentDescription component,
                                                 const config::ShadowDescription& shadow) {
  if (!shadow.library.empty()) {
    component.library = shadow.library;
    component.class_name = shadow.class_name;
  } else if (!shadow.class_name.empty()) {
    component.class_name = shadow.class_name;
  }
  for (const auto& [name, value] : shadow.params.members()) {
    component.params.set(name, value);
  }
  component.executor.clear();
  component.threads.clear();
  return component;
}

std::optional<ProcessIndex> ProcessPlan::twin_of(ProcessIndex process) const {
  if (shadow_in(process) != nullptr) {
    return std::nullopt;
  }
  if (first_standby_ > 0 && process >= first_standby_) {
    return primaries_[process - first_standby_];
  }
  const auto found = std::ranges::find(primaries_, process);
  if (found == primaries_.end()) {
    return std::nullopt;
  }
  return first_standby_ + static_cast<ProcessIndex>(found - primaries_.begin());
}

bool ProcessPlan::hosts(ProcessIndex process, const std::string& component) const {
  if (const config::ShadowDescription* const shadow = shadow_in(process)) {
    return shadow->of == component;
  }
  const ProcessIndex its = process_of(component);
  return its == process || (follows_at_start(process) && twin_of(process) == its);
}

void ProcessPlan::add_activity(const Needs& needs) {
  wire_.workers = {0};  // The supervisor has none.
  for (ProcessIndex process = kMain; process < count(); ++process) {
    wire_.workers.push_back(needs.is_simulated ? needs.simulated_workers
                                               : host::worker_count(description_in(process)));
  }
  for (const config::ComponentDescription& component : description_.components) {
    const ProcessIndex process = process_of(component.name);
    wire_.reads.push_back({.process = process});
    const auto standby = twin_of(process);
    wire_.reads_on_standby.push_back({.process = standby.value_or(0)});
  }
}

void ProcessPlan::find_problems() {
  for (ProcessIndex process = kMain; process < count(); ++process) {
    const auto other = other_of(process);
    if (other && !description_of(*other).is_trusted) {
      problem_ = fmt::format(
          "process \"{}\" is not trusted, and \"{}\" follows it: a standby or shadow reads its "
          "messages where they are, which needs trust; remove \"trusted\": false, or the {}",
          name(*other), name(process), shadow_in(process) == nullptr ? "standby" : "shadow");
    }
  }
  for (const auto& publisher : wiring_.publishers) {
    const ProcessIndex its = process_of(publisher.component);
    if (publisher.is_external && its != kMain && description_of(its).has_standby) {
      // It repeats callbacks; a thread does not run there, and has no device to go on with.
      problem_ = fmt::format(
          "component \"{}\" publishes \"{}\" from a thread of its own, and its process \"{}\" has "
          "a standby, which cannot take a thread over; let the process be restarted instead "
          "(\"on_exit\": \"restart\"), or publish from a callback",
          publisher.component, publisher.topic, name(its));
    }
    for (const auto& subscription : wiring_.subscriptions) {
      const ProcessIndex from = process_of(publisher.component);
      const ProcessIndex to = process_of(subscription.component);
      if (publisher.credits == 0 || subscription.topic != publisher.topic ||
          !subscription.is_called || from == to) {
        continue;
      }
      if (publisher.credits > kMaxDepth) {
        problem_ = fmt::format(
            "topic \"{}\" has {} credits, and goes from process \"{}\" to \"{}\", between which at "
            "most {} messages may wait; put both components into one process, or use fewer credits",
            publisher.topic, publisher.credits, name(from), name(to), kMaxDepth);
      }
      if (twin_of(from) || twin_of(to)) {
        problem_ = fmt::format(
            "topic \"{}\" has credits, and goes from process \"{}\" to \"{}\": a process with a "
            "standby neither awaits nor returns credits; put both components into one process, or "
            "remove the credits or the standby",
            publisher.topic, name(from), name(to));
      }
    }
  }
}

ProcessIndex ProcessPlan::process_of(const std::string& component) const {
  const auto found =
      std::ranges::find(description_.components, component, &config::ComponentDescription::name);
  if (found == description_.components.end() || found->process.empty()) {
    return kMain;
  }
  const auto name = std::ranges::find(names_.begin() + kMain, names_.end(), found->process);
  return name == names_.end() ? kMain : static_cast<ProcessIndex>(name - names_.begin());
}

config::ProcessDescription ProcessPlan::description_of(ProcessIndex process) const {
  if (const config::ShadowDescription* const shadow = shadow_in(process)) {
    config::ProcessDescription its;
    its.name = shadow->name;
    its.on_exit = config::OnExit::kContinue;
    return its;
  }
  if (follows_at_start(process)) {
    return description_of(primaries_[process - first_standby_]);
  }
  if (process > kMain) {
    return description_.processes[process - kMain - 1];
  }
  config::ProcessDescription main;
  main.name = names_[process];
  return main;
}

config::ApplicationDescription ProcessPlan::description_in(ProcessIndex process) const {
  config::ApplicationDescription part = description_;
  std::set<std::string> used;
  for (config::ComponentDescription& component : part.components) {
    if (hosts(process, component.name)) {
      if (const config::ShadowDescription* const shadow = shadow_in(process)) {
        component = described_as_shadow(std::move(component), *shadow);
      }
      used.insert(component.executor);
      continue;
    }
    // The part that other processes need.
    config::ComponentDescription known;
    known.name = component.name;
    known.name_space = component.name_space;
    known.library = component.library;
    known.class_name = component.class_name;
    known.process = component.process;
    known.after = component.after;
    known.executor = kLinkExecutor;
    known.params = config::Value::object_at(part.shared_params);
    known.place = component.place;
    known.hang = component.hang;
    // The main process needs it if this one is gone for good.
    known.fault_mode = component.fault_mode;
    component = std::move(known);
  }
  for (config::ModeDescription& mode : part.modes) {
    // In each process the same components, also those whose executors are elsewhere.
    for (const config::ComponentDescription& component : description_.components) {
      const std::string& executor =
          component.executor.empty() ? host::kPoolName : component.executor;
      if (std::ranges::find(mode.executors, executor) != mode.executors.end()) {
        mode.components.push_back(component.name);
      }
    }
    mode.executors.clear();
  }
  std::erase_if(part.executors, [&](const config::ExecutorDescription& executor) {
    return !used.contains(executor.name);
  });
  config::ExecutorDescription links;
  links.name = kLinkExecutor;
  links.place = part.place;
  part.executors.push_back(std::move(links));
  if (process != kMain) {  // The main process has the tools.
    part.record.reset();
    part.flight_recorder.reset();
    part.trace.reset();
    part.inspect.reset();
    part.live.reset();
  }
  return part;
}

std::string ProcessPlan::executor_of(const std::string& component) const {
  const auto described =
      std::ranges::find(description_.components, component, &config::ComponentDescription::name);
  return described->executor.empty() ? host::kPoolName : described->executor;
}

std::vector<std::string> ProcessPlan::executors_in(ProcessIndex process) const {
  return host::executor_names(description_in(process));
}

/// Whether tools there read topics to which no component there subscribes.
bool ProcessPlan::gets_all(ProcessIndex process, const Needs& needs) const {
  return (process == kMain && needs.main_gets_all) ||
         std::ranges::any_of(wiring_.recorders,
                             [&](const std::string& recorder) { return hosts(process, recorder); });
}

void ProcessPlan::add_links(const Needs& needs) {
  std::map<ProcessIndex, std::vector<std::string>> executors;
  std::map<std::pair<std::string, std::string>, std::size_t> ordinals;
  for (const auto& publisher : wiring_.publishers) {
    const std::size_t ordinal = ordinals[{publisher.topic, publisher.component}]++;
    const ProcessIndex its = process_of(publisher.component);
    std::vector<ProcessIndex> sources = {its};
    if (const auto standby = twin_of(its)) {
      sources.push_back(*standby);
    }
    for (const ProcessIndex from : sources) {
      for (ProcessIndex to = kMain; to < count(); ++to) {
        add_link(publisher, ordinal, from, to, needs, executors);
      }
    }
  }
}
void ProcessPlan::add_link(const host::ApplicationWiring::Publisher& publisher, std::size_t ordinal,
                           ProcessIndex from, ProcessIndex to, const Needs& needs,
                           std::map<ProcessIndex, std::vector<std::string>>& executors) {
  std::size_t depth = 0;
  std::size_t keep = 0;
  // A follower compares its own output with the primary's.
  const config::ShadowDescription* const shadow = shadow_in(to);
  const bool is_followed =
      twin_of(from) == to || (shadow != nullptr && shadow->of == publisher.component);
  bool is_wanted = gets_all(to, needs) || is_followed;
  bool drops_newest = true;
  bool returns_credits = false;
  std::string component;
  for (const auto& subscription : wiring_.subscriptions) {
    if (subscription.topic != publisher.topic || !hosts(to, subscription.component)) {
      continue;
    }
    is_wanted = true;
    drops_newest = drops_newest && subscription.drops_newest;
    depth = std::max(depth, subscription.depth);
    keep += subscription.depth + subscription.keep + 1;
    if (subscription.is_called && component.empty()) {
      component = subscription.component;
    }
    returns_credits = returns_credits || (subscription.is_called && shadow == nullptr);
  }
  if (to == from || !is_wanted) {
    return;
  }
  const bool is_followed_there = twin_of(to) || shadow != nullptr;
  std::size_t depth_of_large = depth;
  if (is_followed_there) {
    // A follower lags behind, and must not lose what the primary still takes: most of all while it
    // makes its component's object.
    depth_of_large = std::max(2 * depth, kDepthOfStandbyIfLarge);
    depth = std::max(2 * depth, kDepthOfStandby);
    keep += 2 * depth;
  }
  const auto place_in = [&](ProcessIndex process, const std::string& name) {
    std::vector<std::string>& its = executors[process];
    if (its.empty()) {
      its = executors_in(process);
    }
    return static_cast<unsigned>(std::ranges::find(its, name) - its.begin());
  };
  const std::string executor = component.empty() ? kLinkExecutor : executor_of(component);
  // A burst must not be lost while a worker is busy; and a recorder must not lose anything while
  // its process waits for a CPU. In simulated time all of a round waits for its end.
  const std::size_t least_depth = needs.is_simulated || gets_all(to, needs) ? 256 : 16;
  const std::size_t queue = std::clamp(2 * depth, least_depth, kMaxDepth);
  const std::size_t queue_of_large =
      needs.is_simulated ? queue : std::clamp(2 * depth_of_large, std::size_t{16}, queue);
  segment::LinkPlan link{.from = from, .to = to};
  link.depth = static_cast<std::uint32_t>(queue);
  link.depth_of_large = static_cast<std::uint32_t>(queue_of_large);
  link.capacity = static_cast<std::uint32_t>(
      std::min(2 * queue + keep + publisher.latched + kSpare, 3 * kMaxDepth));
  link.executor = place_in(to, executor);
  link.drops_newest = drops_newest && depth > 0 && !is_followed;
  link.is_serialized = !description_of(from).is_trusted;
  if (publisher.credits > 0 && returns_credits) {
    link.credits = static_cast<std::uint32_t>(publisher.credits);
    link.publisher_executor = place_in(from, executor_of(publisher.component));
    link.depth_of_large = std::max(link.depth_of_large, link.credits);
  }
  links_.push_back({.topic = publisher.topic,
                    .component = publisher.component,
                    .ordinal = ordinal,
                    .executor = executor,
                    .wire = wire_.links.size(),
                    .depth = std::max<std::size_t>(depth, 1)});
  wire_.links.push_back(link);
}

}  // namespace fastcycle::processes
