#include "host/param_changes.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/time_driver.h"
#include "config/nearest.h"
#include "config/parse.h"
#include "params/param_info.h"
#include "params/param_value.h"

namespace fastcycle::host {

using detail::ComponentCore;
using detail::ParamSlot;

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kShared = "shared_params";
constexpr std::size_t kMostFacts = 1000;
constexpr std::size_t kMostOfALine = 380;  // A line of the log is cut at 400 bytes.

config::Problem mistake_of(const ParamChange& change, std::string message,
                           const std::string& near = {}) {
  return config::mistake({.file = change.param, .pointer = {}}, std::move(message),
                         config::did_you_mean(near));
}

ComponentCore* find_component(const ApplicationHost& application, std::string_view name) {
  const auto& all = application.components();
  const auto found =
      std::ranges::find_if(all, [&](const auto& component) { return component->name == name; });
  return found == all.end() ? nullptr : found->get();
}

/// What became of a change, and what became of it when this activation was recorded.
ParamsResult learn(const detail::PublishingComponent& component, const ParamsResult& result) {
  if (component.told != nullptr) {
    const auto* entry = component.told->take(detail::ReadKind::kResult);
    const auto json = nlohmann::json::parse(entry == nullptr ? "[]" : entry->text, nullptr, false);
    ParamsResult then;
    for (const auto& mistake : json.is_array() ? json : nlohmann::json::array()) {
      then.mistakes.push_back(mistake.is_string() ? mistake.get<std::string>() : mistake.dump());
    }
    return then;
  }
  if (component.reads != nullptr) {
    component.learned(detail::ReadKind::kResult,
                      nlohmann::json(result.mistakes)
                          .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
  return result;
}

std::vector<std::string> component_names(const ApplicationHost& application) {
  std::vector<std::string> names;
  for (const auto& component : application.components()) {
    names.push_back(component->name);
  }
  return names;
}

/// The values in a JSON object; those that do not fit go to `problems`.
ParamValues values_of(const ComponentCore& component, const Json& json,
                      config::Problems& problems) {
  ParamValues values;
  if (!json.is_object()) {
    problems.add(
        config::mistake({}, "the new values of params are no JSON object: " + json.dump()));
    return values;
  }
  for (const auto& [name, value] : json.items()) {
    const auto& all = component.param_table.all();
    const auto param = std::ranges::find_if(
        all, [&](const DeclaredParam& one) { return one.is_declared && one.spec().name == name; });
    if (param == all.end()) {
      problems.add(config::mistake({}, "there is no param " + config::in_quotes(name)));
      continue;
    }
    if (auto data = read_param(param->spec(), config::parse_option(value.dump(), name), problems)) {
      values.emplace_back(param->slot.get(), std::move(*data));
    }
  }
  return values;
}

}  // namespace

ParamsResult ParamChanges::make(const std::vector<ParamChange>& changes,
                                std::string_view asked_by) {
  const std::lock_guard lock(mutex_);
  if (is_ended_ || !application_.is_built()) {
    return {.mistakes = {is_ended_ ? "the application has stopped: its params stay as they are"
                                   : "the application is not built yet"}};
  }
  Plan plan;
  config::Problems problems;
  for (const ParamChange& change : changes) {
    plan_change(change, plan, problems);
  }
  check_together(plan, problems);
  ParamsResult result;
  for (const config::Problem& problem : problems.all()) {
    result.mistakes.push_back(config::to_string(problem));
  }
  if (result.has_changed()) {
    commit(plan, asked_by);
  }
  return result;
}

void ParamChanges::plan_change(const ParamChange& change, Plan& plan,
                               config::Problems& problems) const {
  const std::size_t dot = change.param.find('.');
  if (dot == std::string::npos) {
    problems.add(mistake_of(change,
                            "a param is named with its component, as in limiter.limit_mps, "
                            "or as shared_params.NAME"));
    return;
  }
  const std::string owner = change.param.substr(0, dot);
  const std::string name = change.param.substr(dot + 1);
  ComponentCore* component = find_component(application_, owner);
  if (component == nullptr && owner == kShared) {
    plan_shared(change, name, plan, problems);
    return;
  }
  if (component == nullptr) {
    problems.add(mistake_of(change, "there is no component " + config::in_quotes(owner),
                            config::nearest(owner, component_names(application_))));
    return;
  }
  if (application_.is_replayed(owner)) {
    return;
  }
  std::vector<std::string> known;
  bool is_known = false;
  for (const DeclaredParam& param : component->param_table.all()) {
    if (!param.is_declared) {
      continue;
    }
    known.push_back(param.spec().name);
    if (param.spec().name == name) {
      plan_value(change, true, *component, param, plan, problems);
      is_known = true;
    }
  }
  if (!is_known) {
    plan[component->index].is_wrong = true;
    problems.add(mistake_of(change, "there is no param " + config::in_quotes(name),
                            config::nearest(name, known)));
  }
}

void ParamChanges::plan_shared(const ParamChange& change, std::string_view name, Plan& plan,
                               config::Problems& problems) const {
  std::vector<std::string> known;
  bool is_known = false;
  for (const auto& component : application_.components()) {
    for (const DeclaredParam& param : component->param_table.all()) {
      if (!param.is_declared || param.origin != ParamOrigin::kShared) {
        continue;
      }
      known.push_back(param.spec().name);
      if (param.spec().name == name) {
        plan_value(change, false, *component, param, plan, problems);
        is_known = true;
      }
    }
  }
  // In a replay those that read it may not be there.
  if (!is_known && !application_.is_replay()) {
    problems.add(mistake_of(change, "no component reads a shared param " + config::in_quotes(name),
                            config::nearest(name, known)));
  }
}

void ParamChanges::plan_value(const ParamChange& change, bool is_own, ComponentCore& component,
                              const DeclaredParam& param, Plan& plan, config::Problems& problems) {
  Planned& planned = plan[component.index];
  planned.component = &component;
  const std::string of = is_own ? "" : " of component " + config::in_quotes(component.name);
  const auto refuse = [&](std::string message) {
    problems.add(mistake_of(change, std::move(message)));
    planned.is_wrong = true;
  };
  if (!param.spec().is_tunable) {
    refuse("the param" + of + " is not tunable: it is as the application file says");
    return;
  }
  const auto same = [&](const auto& value) { return value.first == param.slot.get(); };
  if (std::ranges::any_of(planned.values, same)) {
    refuse("the param" + of + " is changed twice");
    return;
  }
  const config::Value value = config::parse_option(change.json, change.param + of);
  if (auto data = read_param(param.spec(), value, problems)) {
    planned.values.emplace_back(param.slot.get(), std::move(*data));
    planned.names.push_back(component.name + "." + param.spec().name);
    planned.is_own.push_back(is_own);
  } else {
    planned.is_wrong = true;
  }
}

void ParamChanges::check_together(Plan& plan, config::Problems& problems) {
  for (auto& [index, planned] : plan) {
    if (planned.is_wrong) {
      continue;
    }
    for (const std::string& sentence : planned.component->param_table.objections(planned.values)) {
      problems.add(config::mistake({.file = planned.component->name, .pointer = {}}, sentence));
    }
  }
}

void ParamChanges::commit(const Plan& plan, std::string_view asked_by) {
  ++transactions_;
  note(plan, asked_by);
  for (const auto& [index, planned] : plan) {
    ComponentCore& component = *planned.component;
    component.param_table.commit(transactions_, planned.values);
    for (std::size_t i = 0; i < planned.values.size(); ++i) {
      for (DeclaredParam& param : component.param_table.all()) {
        if (param.slot.get() == planned.values[i].first && planned.is_own[i]) {
          param.origin = ParamOrigin::kChanged;
        }
      }
    }
    // Under the mutex, so that all components get all transactions in the same order.
    application_.time().between_rounds([&component, transaction = transactions_,
                                        values = planned.values, text = text_of(planned)] {
      component.post(
          detail::Cause::kParameter,
          [&component, transaction, values, text] {
            component.take_params(transaction, values, text);
          },
          nullptr, transaction);
    });
  }
}

/// As a log has it: a JSON object of the values by name.
std::string ParamChanges::text_of(const Planned& planned) {
  Json json = Json::object();
  for (const auto& [slot, data] : planned.values) {
    json[slot->spec.name] = to_json(slot->spec, data);
  }
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void ParamChanges::take_recorded(ComponentCore& component, std::uint64_t transaction,
                                 const std::string& text, config::Problems& problems) {
  const std::lock_guard lock(mutex_);
  const ParamValues values = values_of(component, Json::parse(text, nullptr, false), problems);
  if (transaction > component.param_table.committed()) {
    component.param_table.commit(transaction, values);
  }
  component.post(
      detail::Cause::kParameter,
      [&component, transaction, values, text] { component.take_params(transaction, values, text); },
      nullptr, transaction);
}

void ParamChanges::commit_recorded(ComponentCore& component, const std::string& text,
                                   config::Problems& problems) {
  const std::lock_guard lock(mutex_);
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_array() || json.size() != 2 || !json[0].is_number_unsigned()) {
    problems.add(config::mistake({}, "what a new object began with is no pair: " + text));
    return;
  }
  component.param_table.commit(json[0].get<std::uint64_t>(),
                               values_of(component, json[1], problems));
}

void ParamChanges::note(const Plan& plan, std::string_view asked_by) {
  std::string line;
  Json changed = Json::object();
  const auto write = [&] {
    if (!line.empty()) {
      application_.log(LogLevel::kInfo, asked_by, "params: " + line);
    }
    line.clear();
  };
  for (const auto& [index, planned] : plan) {
    for (std::size_t i = 0; i < planned.values.size(); ++i) {
      const auto& [slot, data] = planned.values[i];
      for (const DeclaredParam& param : planned.component->param_table.all()) {
        if (param.slot.get() != slot) {
          continue;
        }
        const std::string text = planned.names[i] + ": " + to_text(param.spec(), param.committed) +
                                 " → " + to_text(param.spec(), data);
        if (line.size() + text.size() > kMostOfALine) {
          write();
        }
        line += (line.empty() ? "" : ", ") + text;
        changed[planned.names[i]] = to_json(param.spec(), data);
      }
    }
  }
  write();
  const std::lock_guard lock(facts_mutex_);
  if (facts_.size() < kMostFacts) {
    Json fact = {
        {"time_ns", base::to_ns(application_.clock().now())}, {"by", asked_by}, {"set", changed}};
    facts_["params." + std::to_string(transactions_)] =
        fact.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  }
}

void ParamChanges::make_later(ComponentCore& component, std::vector<ParamChange> changes,
                              std::function<void(const ParamsResult&)> done) {
  const std::uint64_t key = ComponentCore::kParamsAsked | ++component.params_asked;
  component.params_answered += done ? 0 : 1;  // Nobody waits for an answer.
  const auto change = [this, &component, changes = std::move(changes), done = std::move(done),
                       object = component.restart_count, key] {
    // Where a recorded run is executed again, the log has what became of it.
    const ParamsResult result =
        application_.time().is_recorded() ? ParamsResult() : make(changes, component.name);
    if (!done) {
      for (const std::string& mistake : result.mistakes) {
        application_.log(LogLevel::kWarning, component.name, "params are not changed: " + mistake);
      }
      return;
    }
    const auto tell = [&component, done, object, result] {
      ++component.params_answered;
      // A restarted component is another object than the one that asked.
      const bool is_there = component.state == ComponentCore::State::kActive ||
                            component.state == ComponentCore::State::kStandby;
      if (is_there && component.restart_count == object) {
        done(learn(component.publishing, result));
      }
    };
    application_.time().between_rounds(
        [&component, tell, key] { component.post(detail::Cause::kParameter, tell, nullptr, key); });
  };
  application_.time().stage(component, change);
}

std::vector<ParamInfo> ParamChanges::list() const {
  std::vector<ParamInfo> infos;
  const std::lock_guard lock(mutex_);
  for (const auto& component : application_.components()) {
    for (const DeclaredParam& param : component->param_table.all()) {
      if (param.is_declared) {
        infos.push_back(info_of(component->name, param));
      }
    }
  }
  return infos;
}

std::map<std::string, std::string> ParamChanges::facts() const {
  const std::lock_guard lock(facts_mutex_);
  return facts_;
}

}  // namespace fastcycle::host
