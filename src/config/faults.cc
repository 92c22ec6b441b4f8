#include <algorithm>
#include <cstdint>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/describe.h"
#include "config/fault_keys.h"
#include "config/nearest.h"

namespace fastcycle::config {
namespace {

using Kinds = std::set<FaultKind>;

/// A key that only some kinds have.
struct Key {
  const char* name;
  Kinds kinds;        ///< That may have it.
  Kinds needed = {};  ///< That must have it.
};

const std::vector<Key>& keys() {
  using enum FaultKind;
  static const std::vector<Key> all = {
      {"topic",
       {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt},
       {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt}},
      {"publisher", {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt}},
      {"subscriber", {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt}},
      {"messages", {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt}},
      {"probability", {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt}},
      {"component",
       {kThrow, kSlow, kHang, kRestart, kCrash, kLeak},
       {kThrow, kSlow, kHang, kRestart, kCrash, kLeak}},
      {"process", {kKill, kSuspend}, {kKill, kSuspend}},
      {"to_s", {kDrop, kDelay, kDuplicate, kFreeze, kCorrupt, kSlow}},
      {"by_ms", {kDelay, kSlow, kHang}, {kDelay, kSlow, kHang}},
      {"by_mb", {kLeak}, {kLeak}},
      {"field", {kCorrupt}, {kCorrupt}},
      {"as", {kCorrupt}, {kCorrupt}},
      {"value", {kCorrupt}}};
  return all;
}

/// The checks of one fault, which is written as `written`.
class FaultSense {
 public:
  FaultSense(const FaultDescription& fault, const Value& written, Problems& problems)
      : fault_(fault), written_(written), problems_(problems) {}

  void check(const std::vector<std::string>& components,
             const std::vector<std::string>& processes) {
    const Value* const kind = written_.find("kind");
    if (kind == nullptr || !kind->is_string() || kind->as_string() != to_string(fault_.kind)) {
      return;  // An error already; what else it needs is unknown.
    }
    const auto has = [this](const char* key) { return written_.find(key) != nullptr; };
    for (WrongKey& wrong : wrong_keys(fault_.kind, has)) {
      add(wrong.key, std::move(wrong.message));
    }
    if (fault_.to && *fault_.to <= fault_.from) {
      add("to_s", "\"to_s\" has to be greater than \"from_s\"");
    }
    check_value();
    for (const auto& [key, name] : {std::pair{"publisher", fault_.publisher},
                                    {"subscriber", fault_.subscriber},
                                    {"component", fault_.component}}) {
      if (!name.empty() && std::ranges::find(components, name) == components.end()) {
        add(key, "there is no component " + in_quotes(name),
            did_you_mean(nearest(name, components)));
      }
    }
    if (!fault_.process.empty() &&
        std::ranges::find(processes, fault_.process) == processes.end()) {
      add("process", "no component runs in a process " + in_quotes(fault_.process),
          did_you_mean(nearest(fault_.process, processes)));
    }
  }

 private:
  void add(std::string_view key, std::string message, std::string hint = {}) {
    const Value* value = key.empty() ? nullptr : written_.find(key);
    problems_.add(make_error(value == nullptr ? written_.place() : value->place(),
                             std::move(message), std::move(hint)));
  }

  void check_value() {
    const bool has_value = written_.find("value") != nullptr;
    if (fault_.kind != FaultKind::kCorrupt || written_.find("as") == nullptr) {
      return;
    }
    if (fault_.corruption == Corruption::kValue && !has_value) {
      add("as", "\"as\": \"value\" needs the key \"value\"");
    } else if (fault_.corruption != Corruption::kValue && has_value) {
      add("value", "a \"value\" has no meaning where \"as\" is not \"value\"");
    }
  }

  const FaultDescription& fault_;
  const Value& written_;
  Problems& problems_;
};

}  // namespace

std::vector<std::string> fault_kinds() {
  std::vector<std::string> names;
  for (auto kind = std::uint8_t{0}; kind <= static_cast<std::uint8_t>(FaultKind::kSuspend);
       ++kind) {
    names.emplace_back(to_string(static_cast<FaultKind>(kind)));
  }
  return names;
}

std::optional<FaultKind> fault_kind(std::string_view name) {
  const std::vector<std::string> names = fault_kinds();
  const auto found = std::ranges::find(names, name);
  return found == names.end()
             ? std::nullopt
             : std::optional(static_cast<FaultKind>(std::distance(names.begin(), found)));
}

std::vector<WrongKey> wrong_keys(FaultKind kind, const std::function<bool(const char*)>& has) {
  std::vector<WrongKey> wrong;
  for (const Key& key : keys()) {
    const bool is_there = has(key.name);
    if (!is_there && key.needed.contains(kind)) {
      wrong.push_back(
          {.key = "",
           .message = in_quotes(to_string(kind)) + " needs the key " + in_quotes(key.name)});
    } else if (is_there && !key.kinds.contains(kind)) {
      wrong.push_back({.key = key.name,
                       .message = "a " + in_quotes(key.name) + " has no meaning with the kind " +
                                  in_quotes(to_string(kind))});
    }
  }
  return wrong;
}

void check_faults(const ApplicationDescription& application, Problems& problems) {
  const Value* faults = application.effective.find("faults");
  const Value* list = faults == nullptr ? nullptr : faults->find("list");
  if (list == nullptr || !list->is_array()) {
    return;
  }
  std::vector<std::string> components;
  for (const ComponentDescription& component : application.components) {
    components.push_back(component.name);
  }
  std::vector<std::string> processes;
  for (const ComponentDescription& component : application.components) {
    if (!component.process.empty()) {
      processes.push_back(component.process);
    }
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < application.faults.list.size(); ++i) {
    const FaultDescription& fault = application.faults.list[i];
    const Value& written = (*list)[i];
    FaultSense(fault, written, problems).check(components, processes);
    if (!names.insert(fault.name).second) {
      problems.add(make_error(written.place(), "the fault " + in_quotes(fault.name) +
                                                   " is there twice; give each a \"name\""));
    }
  }
}

}  // namespace fastcycle::config
