#include "config/compose.h"

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>
#include <system_error>
#include <unordered_set>
#include <utility>

#include "base/pattern.h"
#include "base/utf8.h"
#include "config/main_process.h"
#include "config/merge.h"
#include "config/nearest.h"
#include "config/parse.h"

namespace fastcycle::config {

namespace {

// How the same file is known again, whatever way leads to it.
std::string identity_of(const std::filesystem::path& file) {
  std::error_code error;
  const auto canonical = std::filesystem::weakly_canonical(file, error);
  return error ? file.string() : canonical.string();
}

Value empty_tree(const Value& file) {
  Value tree = Value::object_at(file);
  for (const std::string_view key : {"name", "on_fault", "on_hang", "log_level", "initial_mode"}) {
    if (const Value* value = find_string(file, key)) {
      tree.set(key, *value);
    }
  }
  for (const std::string_view key : {"start_timeout_ms", "callback_limit_ms", "lifecycle_limit_ms",
                                     "status_period_ms", "state_period_s"}) {
    if (const Value* time = file.find(key); time != nullptr && time->is_number()) {
      tree.set(key, *time);
    }
  }
  for (const std::string_view key : {"library_path", "executors", "processes", "chains"}) {
    tree.set(key, Value(Value::Array{}, file.origin()));
  }
  for (const std::string_view key : {"topics", "shared_params", "modes", "restart"}) {
    tree.set(key, Value::object_at(file));
  }
  tree.set("components", Value(Value::Array{}, file.origin()));
  return tree;
}

}  // namespace

std::optional<Value> Composer::compose(const LoadOptions& options) {
  auto file = options.text ? parse(*options.text,
                                   std::make_shared<const Source>(Source{
                                       options.file.string(), options.file.parent_path(), true}),
                                   problems_)
                           : read(options.file, {});
  std::vector<Value> overlays;
  for (const auto& path : options.overlays) {
    if (auto overlay = read(path, {})) {
      overlays.push_back(std::move(*overlay));
    }
  }
  if (!file) {
    return std::nullopt;
  }
  // Values are given before any file is replaced, so that included files see them too.
  Variables variables;
  if (const Value* declared = find_object(*file, "variables")) {
    variables.declare(*declared);
  }
  for (const Value& overlay : overlays) {
    if (const Value* given = find_object(overlay, "variables")) {
      variables.give(*given, problems_);
    }
  }
  for (const std::string& option : options.variables) {
    variables.give_option(option, problems_);
  }
  variables.complete(problems_);

  std::vector<std::string> stack = {identity_of(options.file)};
  Value tree = compose_file(std::move(*file), variables, stack);
  for (Value& overlay : overlays) {
    substitute_members(overlay, variables);
    schema_.check_overlay(overlay, problems_);
    if (overlay.is_object()) {
      apply_overlay(tree, overlay, variables);
    }
  }
  for (const std::string& set : options.sets) {
    apply_set(tree, set);
  }
  for (const std::string& pattern : options.isolated) {
    isolate(tree, pattern);
  }
  std::erase_if(tree.members(), [](const auto& member) {
    // Each of these is significant even if it is empty.
    constexpr std::array<std::string_view, 6> kOptional = {
        "record", "flight_recorder", "trace", "inspect", "live", "libraries"};
    return member.value.size() == 0 && !member.value.is_string() && !member.value.is_number() &&
           std::ranges::find(kOptional, member.key) == kOptional.end();
  });
  return tree;
}

std::optional<Value> Composer::read(const std::filesystem::path& file, const Place& asked_at) {
  if (++file_count_ > kMaxFiles) {
    if (file_count_ == kMaxFiles + 1) {
      problems_.add(make_error(asked_at, "the application has more than 1000 files"));
    }
    return std::nullopt;
  }
  return parse_file(file, asked_at, problems_);
}

Value Composer::compose_file(Value file, Variables& variables, std::vector<std::string>& stack) {
  substitute_members(file, variables);
  schema_.check_application(file, problems_);

  Value tree = empty_tree(file);
  add_includes(tree, file, stack);
  add_own(tree, file, variables);
  return tree;
}

// All but `variables`: their values were dealt with when they were given.
void Composer::substitute_members(Value& file, Variables& variables) {
  if (!file.is_object()) {
    return;
  }
  for (auto& [key, value] : file.members()) {
    if (key != "variables") {
      variables.substitute(value, problems_);
    }
  }
}

void Composer::add_includes(Value& tree, const Value& file, std::vector<std::string>& stack) {
  const Value* includes = find_array(file, "include");
  if (includes == nullptr) {
    return;
  }
  for (const Value& include : includes->items()) {
    add_include(tree, include, stack);
  }
}

void Composer::add_include(Value& tree, const Value& include, std::vector<std::string>& stack) {
  const Value* name = find_string(include, "file");
  if (name == nullptr || !may_include(*name, stack)) {
    return;
  }
  auto file = read(name->as_path(), name->place());
  if (!file) {
    return;
  }
  Variables variables;
  if (const Value* declared = find_object(*file, "variables")) {
    variables.declare(*declared);
  }
  if (const Value* given = find_object(include, "variables")) {
    variables.give(*given, problems_);
  }
  variables.complete(problems_);

  stack.push_back(identity_of(name->as_path()));
  const Value part = compose_file(std::move(*file), variables, stack);
  stack.pop_back();
  add_part(tree, part, find_string(include, "namespace"));
}

bool Composer::may_include(const Value& name, const std::vector<std::string>& stack) {
  const std::string identity = identity_of(name.as_path());
  const auto first = std::ranges::find(stack, identity);
  if (first != stack.end()) {
    std::string circle;
    std::for_each(first, stack.end(), [&](const std::string& file) {
      circle += std::filesystem::path(file).filename().string() + " → ";
    });
    circle += std::filesystem::path(identity).filename().string();
    problems_.add(make_error(name.place(), "the file includes itself: " + circle));
    return false;
  }
  if (stack.size() > kMaxIncludeDepth) {
    problems_.add(make_error(name.place(), "files include each other deeper than 16"));
    return false;
  }
  return true;
}

void Composer::add_part(Value& tree, const Value& part, const Value* name_space) {
  for (const std::string_view key : {"library_path", "executors", "processes"}) {
    for (const Value& item : part[key].items()) {
      tree.find(key)->items().push_back(item);
    }
  }
  for (Value component : part["components"].items()) {
    if (name_space != nullptr) {
      const std::string whole = joined(name_space->as_string(), text_of(component, "namespace"));
      component.set("namespace", Value::string_at(*name_space, whole));
    }
    for (const std::string_view key : {"on_fault", "log_level", "start_timeout_ms",
                                       "callback_limit_ms", "lifecycle_limit_ms", "on_hang"}) {
      const Value* value = part.find(key);
      if (value != nullptr && component.find(key) == nullptr) {
        component.set(key, *value);
      }
    }
    if (part["restart"].size() > 0) {
      Value restart = part["restart"];
      if (const Value* own = find_object(component, "restart")) {
        merge(restart, *own, problems_);
      }
      component.set("restart", std::move(restart));
    }
    tree.find("components")->items().push_back(std::move(component));
  }
  for (const auto& [name, topic] : part["topics"].members()) {
    add_topic(tree, placed(name_space == nullptr ? "" : name_space->as_string(), name), topic);
  }
  add_shared_params(tree, part);
  for (const std::string_view key : {"record", "flight_recorder"}) {
    if (const Value* record = part.find(key)) {
      problems_.add(make_error(record->place(),
                               "only the main application file may define what is recorded"));
    }
  }
  if (const Value* trace = part.find("trace")) {
    problems_.add(make_error(trace->place(), "only the main application file may define a trace"));
  }
  if (const Value* inspect = part.find("inspect")) {
    problems_.add(make_error(inspect->place(),
                             "only the main application file may define who may inspect the run"));
  }
  if (const Value* live = part.find("live")) {
    problems_.add(
        make_error(live->place(), "only the main application file may define a live server"));
  }
  if (const Value* faults = part.find("faults")) {
    problems_.add(make_error(faults->place(), "only the main application file may define faults"));
  }
  if (const Value* shadow = part.find("shadow")) {
    problems_.add(make_error(shadow->place(), "only the main application file may define shadows"));
  }
  if (const Value* libraries = part.find("libraries")) {
    problems_.add(
        make_error(libraries->place(),
                   "only the main application file may define which libraries may be loaded"));
  }
  if (const Value& modes = part["modes"]; modes.size() > 0) {
    problems_.add(make_error(modes.place(), "only the main application file may define modes"));
  }
  if (const Value* mode = part.find("initial_mode")) {
    problems_.add(
        make_error(mode->place(), "only the main application file may define the initial mode"));
  }
  if (const Value& chains = part["chains"]; chains.size() > 0) {
    problems_.add(
        make_error(chains[0].place(), "only the main application file may define chains"));
  }
  if (const Value* period = part.find("state_period_s")) {
    problems_.add(make_error(period->place(),
                             "only the main application file may define the period of key frames"));
  }
  if (const Value* period = part.find("status_period_ms")) {
    problems_.add(make_error(period->place(),
                             "only the main application file may define the period of the status"));
  }
}

// Two included files may share a param only if they agree; there is no order that a reader would
// expect. The including file's own values go before both.
void Composer::add_shared_params(Value& tree, const Value& part) {
  Value* shared = tree.find("shared_params");
  for (const auto& [key, value] : part["shared_params"].members()) {
    const Value* other = shared->find(key);
    if (other != nullptr && !other->same_content(value)) {
      problems_.add(make_error(value.place(), "the shared param " + in_quotes(key) +
                                                  " has another value in " +
                                                  to_string(other->place())));
    } else {
      shared->set(key, value);
    }
  }
}

void Composer::add_topic(Value& tree, const std::string& name, const Value& topic) {
  Value* topics = tree.find("topics");
  if (const Value* other = topics->find(name)) {
    problems_.add(make_error(topic.place(), "the topic " + in_quotes(name) +
                                                " is described twice, first in " +
                                                to_string(other->place())));
    return;
  }
  topics->set(name, topic);
}

void Composer::add_own(Value& tree, const Value& file, Variables& variables) {
  for (const std::string_view key : {"library_path", "executors", "processes", "chains"}) {
    if (const Value* list = find_array(file, key)) {
      auto& items = tree.find(key)->items();
      items.insert(items.end(), list->items().begin(), list->items().end());
    }
  }
  if (const Value* topics = find_object(file, "topics")) {
    for (const auto& [name, topic] : topics->members()) {
      add_topic(tree, name, topic);
    }
  }
  if (const Value* components = find_array(file, "components")) {
    for (const Value& component : components->items()) {
      add_component(tree, component, variables);
    }
  }
  for (const std::string_view key : {"shared_params", "modes", "restart"}) {
    if (const Value* own = find_object(file, key)) {
      merge(*tree.find(key), *own, problems_);
    }
  }
  for (const std::string_view key :
       {"record", "flight_recorder", "trace", "inspect", "live", "libraries", "faults", "shadow"}) {
    if (const Value* own = file.find(key)) {
      tree.set(key, *own);
    }
  }
}

void Composer::add_component(Value& tree, const Value& component, Variables& variables) {
  if (!component.is_object()) {
    return;
  }
  const Value* name = find_string(component, "name");
  if (name != nullptr && name->as_string().find('/') != std::string::npos) {
    problems_.add(unexpected(*name, "a name without a slash", shown(*name),
                             "a component is placed by its \"namespace\""));
  }
  Value whole = Value::object_at(component);
  if (name != nullptr) {
    whole.set("name", *name);
  }
  merge_component(whole, component, variables);
  auto& components = tree.find("components")->items();
  components.push_back(std::move(whole));
  if (!component_places_.empty()) {
    component_places_.emplace(full_name(components.back()), components.size() - 1);
  }
}

Value* Composer::find_component(Value& tree, const std::string& name) {
  auto& components = tree.find("components")->items();
  if (component_places_.empty()) {
    for (std::size_t i = 0; i < components.size(); ++i) {
      component_places_.emplace(full_name(components[i]), i);
    }
  }
  const auto found = component_places_.find(name);
  return found == component_places_.end() ? nullptr : &components[found->second];
}

std::string Composer::nearest_component(const Value& tree, const std::string& name) const {
  std::vector<std::string> names;
  if (problems_.keeps_errors()) {  // Else it would not be reported.
    for (const Value& component : tree["components"].items()) {
      names.push_back(full_name(component));
    }
  }
  return did_you_mean(nearest(name, names));
}

// First its file, then what stands beside it, which goes before.
void Composer::merge_component(Value& whole, const Value& component, Variables& variables) {
  const Value* name = find_string(component, "file");
  if (name != nullptr) {
    if (auto file = read(name->as_path(), name->place())) {
      variables.substitute(*file, problems_);
      schema_.check_component_file(*file, problems_);
      if (file->is_object()) {
        file->erase("$schema");
        file->erase("name");
        merge(whole, *file, problems_);
      }
    }
  }
  Value own = component;
  own.erase("file");
  merge(whole, own, problems_);
}

void Composer::apply_overlay(Value& tree, const Value& overlay, Variables& variables) {
  const Value empty = empty_tree(overlay);
  for (const auto& [key, value] : overlay.members()) {
    if (key == "include") {
      problems_.add(make_error(value.place(), "an overlay cannot include files"));
      continue;
    }
    const Value* section = empty.find(key);
    if (section != nullptr && value.is_null()) {
      tree.set(key, *section);
      continue;
    }
    if (section != nullptr && value.type() != section->type()) {
      continue;  // The schema has reported it.
    }
    if (key == "components") {
      for (const Value& component : value.items()) {
        apply_overlay_component(tree, component, variables);
      }
    } else if (key == "executors" || key == "processes" || key == "chains") {
      for (const Value& one : value.items()) {
        apply_overlay_by_name(*tree.find(key), one);
      }
    } else if (key == "topics") {
      apply_overlay_topics(tree, value);
    } else if (key == "shared_params" || key == "modes" || key == "restart") {
      merge(*tree.find(key), value, problems_);
    } else if (key == "record" || key == "flight_recorder" || key == "trace" || key == "inspect" ||
               key == "live" || key == "libraries" || key == "faults" || key == "shadow") {
      apply_overlay_optional(tree, key, value);
    } else if (key == "name" || key == "on_fault" || key == "log_level" || key == "library_path" ||
               key == "initial_mode" || key == "start_timeout_ms" || key == "callback_limit_ms" ||
               key == "lifecycle_limit_ms" || key == "on_hang" || key == "status_period_ms" ||
               key == "state_period_s") {
      tree.set(key, value);
    }
  }
}

// Sections whose presence is significant, even if empty.
void Composer::apply_overlay_optional(Value& tree, const std::string& key, const Value& over) {
  Value* known = tree.find(key);
  if (over.is_null()) {
    tree.erase(key);
  } else if (over.is_object() && known != nullptr && known->is_object()) {
    merge(*known, over, problems_);
  } else {
    tree.set(key, over);
  }
}

void Composer::apply_overlay_component(Value& tree, const Value& over, Variables& variables) {
  const std::string name = full_name(over);
  if (name.empty()) {
    return;
  }
  Value* component = find_component(tree, name);
  if (component == nullptr) {
    if (find_string(over, "library") == nullptr && find_string(over, "file") == nullptr) {
      problems_.add(make_error(
          over.place(),
          "there is no component " + in_quotes(name) + ", and a new one needs a \"library\"",
          nearest_component(tree, name)));
      return;
    }
    add_component(tree, over, variables);
    return;
  }
  const Value* library = over.find("library");
  if (library != nullptr && library->is_null()) {
    auto& components = tree.find("components")->items();
    components.erase(components.begin() + (component - components.data()));
    component_places_.clear();
    return;
  }
  // Name and namespace only identify the component.
  Value rest = over;
  rest.erase("name");
  rest.erase("namespace");
  merge_component(*component, rest, variables);
}

void Composer::apply_overlay_by_name(Value& list, const Value& over) {
  const std::string name = text_of(over, "name");
  auto& known = list.items();
  const auto found =
      std::ranges::find(known, name, [](const Value& one) { return text_of(one, "name"); });
  if (name.empty()) {
    return;
  }
  if (found != known.end()) {
    merge(*found, over, problems_);
    return;
  }
  Value fresh = Value::object_at(over);
  merge(fresh, over, problems_);
  known.push_back(std::move(fresh));
}

void Composer::apply_overlay_topics(Value& tree, const Value& topics) {
  Value* known = tree.find("topics");
  Value renamed = Value::object_at(topics);
  for (const auto& [name, topic] : topics.members()) {
    const std::string other = name.starts_with('/') ? name.substr(1) : '/' + name;
    renamed.set(known->find(other) != nullptr ? other : name, topic);
  }
  merge(*known, renamed, problems_);
}

// `component.param.inner=value`; the component's name has no dot.
void Composer::apply_set(Value& tree, const std::string& set) {
  const std::string whole = "--set " + set;
  const Place place{whole, 0, ""};
  const std::size_t equals = set.find('=');
  const std::size_t dot = set.find('.');
  if (equals == std::string::npos || dot == 0 || dot >= equals || dot + 1 == equals) {
    problems_.add(make_error(place, "expected component.param=value, found " + in_quotes(set)));
    return;
  }
  // The depth of files is bounded too: whatever walks the tree needs stack by the level.
  if (std::count(set.begin(), set.begin() + static_cast<std::ptrdiff_t>(equals), '.') >
      static_cast<std::ptrdiff_t>(kMaxDepth)) {
    problems_.add(make_error(place, "the name has more than 64 parts"));
    return;
  }
  if (!base::is_utf8(set)) {
    problems_.add(make_error(place, "the option is not UTF-8"));
    return;
  }
  const std::string name = set.substr(0, dot);
  Value* component = find_component(tree, name);
  if (component == nullptr) {
    problems_.add(make_error(place, "there is no component " + in_quotes(name),
                             nearest_component(tree, name)));
    return;
  }
  // Made into {"params": {"limits": {"jerk": value}}}, and merged like an overlay.
  Value value = parse_option(set.substr(equals + 1), whole);
  std::string path = "params" + set.substr(dot, equals - dot);
  while (!path.empty()) {
    const std::size_t last = path.rfind('.');
    Value outer = Value::object_at(value);
    outer.set(last == std::string::npos ? path : path.substr(last + 1), std::move(value));
    value = std::move(outer);
    path.resize(last == std::string::npos ? 0 : last);
  }
  merge(*component, value, problems_);
}

// Those that have a process already stay there.
void Composer::isolate(Value& tree, const std::string& pattern) {
  const Place place{"--isolate " + pattern, 0, ""};
  const auto source = std::make_shared<const Source>(Source{place.file, {}, false});
  const bool is_all = pattern == "all";
  std::unordered_set<std::string> taken = {std::string(kMainProcess)};
  for (const Value& component : tree["components"].items()) {
    taken.insert(text_of(component, "process"));
  }
  bool is_anyone = is_all;
  for (Value& component : tree.find("components")->items()) {
    const std::string name = full_name(component);
    if (name.empty() || !(is_all || base::matches(pattern, name))) {
      continue;
    }
    is_anyone = true;
    if (const Value* process = component.find("process")) {
      if (name == pattern && text_of(component, "process") != name) {
        Problem problem =
            make_error(place, "the component " + in_quotes(name) +
                                  " stays in the process that it names, " + shown(*process));
        problem.warning = true;
        problems_.add(std::move(problem));
      }
    } else if (taken.contains(name)) {
      problems_.add(make_error(
          place,
          "the component " + in_quotes(name) +
              " cannot have a process of its own name: there is one, with other components",
          "name another by its key \"process\""));
    } else {
      component.set("process", Value(name, {source, 0, ""}));
    }
  }
  if (!is_anyone) {
    problems_.add(make_error(place, "there is no component " + in_quotes(pattern),
                             nearest_component(tree, pattern)));
  }
}

}  // namespace fastcycle::config
