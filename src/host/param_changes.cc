#include "host/param_changes.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <future>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "component/peers.h"
#include "component/time_driver.h"
#include "config/main_process.h"
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

config::Problem error_of(const ParamChange& change, std::string message,
                         const std::string& near = {}) {
  return config::make_error({.file = change.param, .pointer = {}}, std::move(message),
                            config::did_you_mean(near));
}

ComponentCore* find_component(const ApplicationHost& application, std::string_view name) {
  const auto& all = application.components();
  const auto found =
      std::ranges::find_if(all, [&](const auto& component) { return component->name == name; });
  return found == all.end() ? nullptr : found->get();
}

/// The result of a change, or in a replay the recorded one.
ParamsResult learn(const detail::PublishingComponent& component, const ParamsResult& result) {
  if (component.replayed != nullptr) {
    const auto* entry = component.replayed->take(detail::ReadKind::kResult);
    const auto json = nlohmann::json::parse(entry == nullptr ? "[]" : entry->text, nullptr, false);
    ParamsResult then;
    for (const auto& error : json.is_array() ? json : nlohmann::json::array()) {
      then.errors.push_back(error.is_string() ? error.get<std::string>() : error.dump());
    }
    return then;
  }
  if (component.reads != nullptr) {
    component.learned(detail::ReadKind::kResult,
                      nlohmann::json(result.errors)
                          .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
  return result;
}

std::string unknown_shared(std::string_view name) {
  return "no component reads a shared param " + config::in_quotes(name);
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
        config::make_error({}, "the new values of params are no JSON object: " + json.dump()));
    return values;
  }
  for (const auto& [name, value] : json.items()) {
    const auto& all = component.param_table.all();
    const auto param = std::ranges::find_if(
        all, [&](const DeclaredParam& one) { return one.is_declared && one.spec().name == name; });
    if (param == all.end()) {
      problems.add(config::make_error({}, "there is no param " + config::in_quotes(name)));
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
  if (is_ended_ || !application_.is_built()) {
    return {.errors = {is_ended_ ? "the application has stopped: its params stay as they are"
                                 : "the application is not built yet"}};
  }
  if (application_.peers() != nullptr) {
    return ask_all_and_wait(changes);
  }
  const std::lock_guard lock(mutex_);
  Plan plan;
  config::Problems problems;
  for (const ParamChange& change : changes) {
    plan_change(change, plan, problems);
  }
  check_together(plan, problems);
  ParamsResult result;
  for (const config::Problem& problem : problems.all()) {
    result.errors.push_back(config::to_string(problem));
  }
  if (result.has_changed()) {
    ++transactions_;
    note(noted_of(plan), asked_by);
    commit(plan);
  }
  return result;
}

/// Whether this process reports errors that concern no component.
bool ParamChanges::speaks_for_all() const {
  const Peers* const peers = application_.peers();
  return peers == nullptr || peers->is_main();
}

/// False if it means nothing to any component here.
bool ParamChanges::plan_change(const ParamChange& change, Plan& plan,
                               config::Problems& problems) const {
  const std::size_t dot = change.param.find('.');
  if (dot == std::string::npos) {
    if (speaks_for_all()) {
      problems.add(error_of(change,
                            "a param is named with its component, as in limiter.limit_mps, "
                            "or as shared_params.NAME"));
    }
    return speaks_for_all();
  }
  const std::string owner = change.param.substr(0, dot);
  const std::string name = change.param.substr(dot + 1);
  ComponentCore* component = find_component(application_, owner);
  if (component == nullptr && owner == kShared) {
    return plan_shared(change, name, plan, problems);
  }
  if (component == nullptr) {
    if (speaks_for_all()) {
      problems.add(error_of(change, "there is no component " + config::in_quotes(owner),
                            config::nearest(owner, component_names(application_))));
    }
    return speaks_for_all();
  }
  if (application_.is_replayed(owner)) {
    return !application_.runs_elsewhere(owner);
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
    problems.add(error_of(change, "there is no param " + config::in_quotes(name),
                          config::nearest(name, known)));
  }
  return true;
}

bool ParamChanges::plan_shared(const ParamChange& change, std::string_view name, Plan& plan,
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
  // In a replay those that read it may not be there; elsewhere there may be one.
  if (!is_known && !application_.is_replay() && application_.peers() == nullptr) {
    problems.add(error_of(change, unknown_shared(name), config::nearest(name, known)));
  }
  return is_known || application_.is_replay();
}

void ParamChanges::plan_value(const ParamChange& change, bool is_own, ComponentCore& component,
                              const DeclaredParam& param, Plan& plan, config::Problems& problems) {
  Planned& planned = plan[component.index];
  planned.component = &component;
  const std::string of = is_own ? "" : " of component " + config::in_quotes(component.name);
  const auto refuse = [&](std::string message) {
    problems.add(error_of(change, std::move(message)));
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
      problems.add(config::make_error({.file = planned.component->name, .pointer = {}}, sentence));
    }
  }
}

void ParamChanges::commit(const Plan& plan) {
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
    problems.add(config::make_error({}, "what a new object began with is no pair: " + text));
    return;
  }
  component.param_table.commit(json[0].get<std::uint64_t>(),
                               values_of(component, json[1], problems));
}

std::vector<ParamChanges::Noted> ParamChanges::noted_of(const Plan& plan) {
  std::vector<Noted> noted;
  for (const auto& [index, planned] : plan) {
    for (std::size_t i = 0; i < planned.values.size(); ++i) {
      const auto& [slot, data] = planned.values[i];
      for (const DeclaredParam& param : planned.component->param_table.all()) {
        if (param.slot.get() == slot) {
          noted.push_back(
              {.component = index,
               .name = planned.names[i],
               .text = planned.names[i] + ": " + to_text(param.spec(), param.committed) + " → " +
                       to_text(param.spec(), data),
               .json = to_json(param.spec(), data)
                           .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)});
        }
      }
    }
  }
  return noted;
}

void ParamChanges::note(const std::vector<Noted>& noted, std::string_view asked_by) {
  std::string line;
  Json changed = Json::object();
  const auto write = [&] {
    if (!line.empty() && speaks_for_all()) {
      application_.log(LogLevel::kInfo, asked_by, "params: " + line);
    }
    line.clear();
  };
  for (const Noted& one : noted) {
    if (line.size() + one.text.size() > kMostOfALine) {
      write();
    }
    line += (line.empty() ? "" : ", ") + one.text;
    changed[one.name] = Json::parse(one.json, nullptr, false);
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
  const auto answer = [this, &component, done = std::move(done), object = component.restart_count,
                       key](const ParamsResult& result) {
    if (!done) {
      for (const std::string& error : result.errors) {
        application_.log(LogLevel::kWarning, component.name, "params are not changed: " + error);
      }
      return;
    }
    const auto finish = [&component, done, object, result] {
      ++component.params_answered;
      // A restarted component is another object than the one that asked.
      const bool is_there = component.state == ComponentCore::State::kActive ||
                            component.state == ComponentCore::State::kStandby;
      if (is_there && component.restart_count == object) {
        done(learn(component.publishing, result));
      }
    };
    application_.time().between_rounds([&component, finish, key] {
      component.post(detail::Cause::kParameter, finish, nullptr, key);
    });
  };
  application_.time().stage(component, [this, &component, changes = std::move(changes), answer] {
    if (application_.time().is_recorded() || component.publishing.is_following) {
      answer({});  // The result is known from the recording, or from the other process.
    } else if (application_.peers() == nullptr) {
      answer(make(changes, component.name));
    } else {
      ask_all(component.index, component.name, changes, answer);
    }
  });
}

std::vector<ParamInfo> ParamChanges::list() const {
  std::vector<ParamInfo> infos;
  const std::lock_guard lock(mutex_);
  for (const auto& component : application_.components()) {
    if (application_.runs_elsewhere(component->name)) {
      for (const RemoteParam& param : list_elsewhere(component->index)) {
        infos.push_back(param.info);
      }
      continue;
    }
    for (const DeclaredParam& param : component->param_table.all()) {
      if (param.is_declared) {
        infos.push_back(info_of(component->name, param));
      }
    }
  }
  return infos;
}

// ---- Several processes ----

namespace {

constexpr std::size_t kMostAsked = 1024;      // That wait for the answers of all.
constexpr std::chrono::seconds kPatience{3};  // For all processes: less than tools have for us.

std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// Parses a notice of another process, which may be broken.
template <typename Take>
void read_notice(const std::string& text, const Take& take) {
  try {
    take(Json::parse(text));
  } catch (const nlohmann::json::exception&) {  // Ignored.
  }
}

}  // namespace

void ParamChanges::send_all() {
  for (const auto& component : application_.components()) {
    if (application_.runs_elsewhere(component->name)) {
      continue;
    }
    std::vector<RemoteParam> params;
    {
      const std::lock_guard lock(mutex_);
      for (const DeclaredParam& param : component->param_table.all()) {
        if (param.is_declared) {
          params.push_back(remote_of(component->name, param));
        }
      }
    }
    try {
      if (!params.empty()) {
        application_.peers()->send_notice(Notice::Kind::kParamsListed, component->index,
                                          to_text(params));
      }
    } catch (const std::length_error& error) {
      application_.log(
          LogLevel::kWarning, component->name,
          std::string("its params are not sent to the other processes: ") + error.what());
    }
  }
}

std::vector<RemoteParam> ParamChanges::list_elsewhere(std::uint32_t component) const {
  const auto its = elsewhere_.find(component);
  return its == elsewhere_.end() ? std::vector<RemoteParam>() : its->second;
}

std::uint64_t ParamChanges::ask_all(std::uint32_t component, std::string_view by,
                                    const std::vector<ParamChange>& changes, Done done) {
  Json json{{"by", by}, {"changes", Json::array()}};
  for (const ParamChange& change : changes) {
    json["changes"].push_back({change.param, change.json});
  }
  std::uint64_t number = 0;
  {
    const std::lock_guard lock(waiting_mutex_);
    number = ++numbers_;
    waiting_[number] = done;
  }
  json["number"] = number;
  try {
    application_.peers()->send_notice(Notice::Kind::kParamsAsked, component, dumped(json));
  } catch (const std::length_error& error) {
    {
      const std::lock_guard lock(waiting_mutex_);
      waiting_.erase(number);
    }
    done({.errors = {error.what()}});
  }
  return number;
}

ParamsResult ParamChanges::ask_all_and_wait(const std::vector<ParamChange>& changes) {
  const auto answer = std::make_shared<std::promise<ParamsResult>>();
  std::future<ParamsResult> result = answer->get_future();
  const std::uint64_t number =
      ask_all(static_cast<std::uint32_t>(application_.components().size()), {}, changes,
              [answer](const ParamsResult& made) { answer->set_value(made); });
  if (result.wait_for(kPatience) != std::future_status::ready) {
    // It was made before this is taken, in all processes, or will be in none.
    application_.peers()->send_notice(Notice::Kind::kParamsDropped, 0,
                                      dumped(Json{{"number", number}}));
    if (result.wait_for(kPatience) != std::future_status::ready) {
      return {.errors = {"the application hangs; it is not known whether the params are changed"}};
    }
  }
  return result.get();
}

/// Of the processes that have not answered, as far as the file names them.
std::string ParamChanges::names_of_awaited() const {
  std::set<std::string> names;
  for (const auto& component : application_.components()) {
    if (verdict_.awaited.contains(application_.peers()->process_of(component->name))) {
      const std::string& process = component->description.process;
      names.insert(config::in_quotes(process.empty() ? config::kMainProcess : process));
    }
  }
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

/// The requester waits no more.
void ParamChanges::drop(std::uint32_t process, std::uint64_t number) {
  const auto dropped = std::ranges::find_if(
      asked_, [&](const Asked& one) { return one.process == process && one.number == number; });
  if (dropped == asked_.end()) {
    return;
  }
  const std::string why = "no answer within 3 s from process " + names_of_awaited();
  if (dropped == asked_.begin()) {
    verdict_.errors.emplace(0, why);
    decide();
    return;
  }
  asked_.erase(dropped);
  if (application_.peers()->is_here(process)) {
    answer(number, {.errors = {why}});
  }
}

/// Whether its component runs in the sending process.
bool ParamChanges::is_of(const Notice& notice) const {
  const auto& all = application_.components();
  return notice.component < all.size() &&
         application_.peers()->process_of(all[notice.component]->name) == notice.process;
}

void ParamChanges::take(const Notice& notice) {
  switch (notice.kind) {
    case Notice::Kind::kParamsListed:
      if (!application_.peers()->is_here(notice.process) && is_of(notice)) {
        const std::lock_guard lock(mutex_);
        elsewhere_[notice.component] = remote_params_of(notice.text);
      }
      break;
    case Notice::Kind::kParamsAsked:
      read_notice(notice.text, [&](const Json& json) {
        Asked asked{.process = notice.process,
                    .number = json.at("number").get<std::uint64_t>(),
                    .by = json.at("by").get<std::string>(),
                    .changes = {}};
        for (const Json& change : json.at("changes")) {
          asked.changes.push_back(
              {change.at(0).get<std::string>(), change.at(1).get<std::string>()});
        }
        if (asked_.size() == kMostAsked) {
          if (application_.peers()->is_here(asked.process)) {
            answer(asked.number, {.errors = {"too many changes of params wait: 1024"}});
          }
          return;
        }
        asked_.push_back(std::move(asked));
        if (asked_.size() == 1) {
          check_next();
        }
      });
      break;
    case Notice::Kind::kParamsChecked:
      take_verdict(notice);
      break;
    case Notice::Kind::kCame:
      if (!application_.peers()->is_here(notice.process)) {
        send_all();  // It has not received earlier notices.
      }
      break;
    case Notice::Kind::kParamsDropped:
      read_notice(notice.text, [&](const Json& json) {
        drop(notice.process, json.at("number").get<std::uint64_t>());
      });
      break;
    case Notice::Kind::kParamsInPlace:
      read_notice(notice.text, [&](const Json& json) {
        if (application_.peers()->is_here(json.at("process").get<std::uint32_t>())) {
          settle(notice.process, json.at("number").get<std::uint64_t>());
        }
      });
      break;
    case Notice::Kind::kGone:
      settle(notice.process, std::nullopt);
      if (verdict_.awaited.erase(notice.process) != 0 && verdict_.awaited.empty()) {
        decide();
      }
      break;
    default:
      break;
  }
}

/// Checks the first queued transaction for the components here, and sends the result to the others.
void ParamChanges::check_next() {
  const Asked& asked = asked_.front();
  plan_.clear();
  verdict_ = {
      .awaited = application_.peers()->recipients(), .errors = {}, .found = {}, .noted = {}};
  Json errors = Json::array();
  Json found = Json::array();
  Json noted = Json::array();
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < asked.changes.size(); ++i) {
      config::Problems problems;
      if (plan_change(asked.changes[i], plan_, problems)) {
        found.push_back(i);
      }
      for (const config::Problem& problem : problems.all()) {
        errors.push_back({i, config::to_string(problem)});
      }
    }
    config::Problems together;
    check_together(plan_, together);
    for (const config::Problem& problem : together.all()) {
      errors.push_back({asked.changes.size(), config::to_string(problem)});
    }
    if (is_ended_) {
      errors.push_back({0, "the application has stopped: its params stay as they are"});
    }
    if (errors.empty()) {
      for (const Noted& one : noted_of(plan_)) {
        noted.push_back({one.component, one.name, one.text, one.json});
      }
    }
  }
  Json said{{"process", asked.process}, {"number", asked.number}, {"found", found}};
  const auto send = [&] {
    application_.peers()->send_notice(Notice::Kind::kParamsChecked, 0, dumped(said));
  };
  said["errors"] = errors;
  said["noted"] = noted;
  try {
    send();
  } catch (const std::length_error& error) {
    said["errors"] = Json::array({Json::array({0, error.what()})});
    said["noted"] = Json::array();
    send();
  }
}

void ParamChanges::take_verdict(const Notice& notice) {
  if (asked_.empty() || !verdict_.awaited.contains(notice.process)) {
    return;
  }
  read_notice(notice.text, [&](const Json& json) {
    if (json.at("process") != asked_.front().process ||
        json.at("number") != asked_.front().number) {
      return;
    }
    for (const Json& one : json.at("errors")) {
      verdict_.errors.emplace(one.at(0).get<std::size_t>(), one.at(1).get<std::string>());
    }
    for (const Json& one : json.at("found")) {
      verdict_.found.insert(one.get<std::size_t>());
    }
    for (const Json& one : json.at("noted")) {
      const auto component = one.at(0).get<std::uint32_t>();
      verdict_.noted.emplace(component, Noted{.component = component,
                                              .name = one.at(1).get<std::string>(),
                                              .text = one.at(2).get<std::string>(),
                                              .json = one.at(3).get<std::string>()});
    }
    verdict_.awaited.erase(notice.process);
    if (verdict_.awaited.empty()) {
      decide();
    }
  });
}

/// All have answered the first queued transaction.
void ParamChanges::decide() {
  const Asked asked = std::move(asked_.front());
  asked_.pop_front();
  Verdict verdict = std::exchange(verdict_, {});
  for (std::size_t i = 0; i < asked.changes.size(); ++i) {
    if (!verdict.found.contains(i)) {
      const std::string& param = asked.changes[i].param;
      const std::string_view name = std::string_view(param).substr(param.find('.') + 1);
      const bool is_shared = param.starts_with(std::string(kShared) + ".");
      verdict.errors.emplace(
          i, config::to_string(error_of(
                 asked.changes[i],
                 is_shared ? unknown_shared(name) : "the process of its component is not there")));
    }
  }
  ParamsResult result;
  for (auto& [place, error] : verdict.errors) {
    result.errors.push_back(std::move(error));
  }
  if (result.has_changed()) {
    const std::lock_guard lock(mutex_);
    ++transactions_;
    std::vector<Noted> noted;
    for (auto& [component, one] : verdict.noted) {
      noted.push_back(std::move(one));
    }
    note(noted, asked.by);
    commit(plan_);
    for (const Noted& one : noted) {
      changed_[one.name] = one.json;
      const auto its = elsewhere_.find(one.component);
      if (its == elsewhere_.end()) {
        continue;
      }
      for (RemoteParam& param : its->second) {
        if (param.info.param == one.name) {
          param.info.json = one.json;
          param.origin = ParamOrigin::kChanged;
        }
      }
    }
  }
  Peers& peers = *application_.peers();
  if (peers.is_here(asked.process)) {
    answer(asked.number, result);
  }
  if (result.has_changed() && !application_.time().is_simulated()) {
    peers.send_notice(Notice::Kind::kParamsInPlace, 0,
                      dumped(Json{{"process", asked.process}, {"number", asked.number}}));
  }
  if (!asked_.empty()) {
    check_next();
  }
}

/// Answers the requester, once all processes have applied it: messages published after the answer
/// follow the change.
void ParamChanges::answer(std::uint64_t number, const ParamsResult& result) {
  Done done;
  {
    const std::lock_guard lock(waiting_mutex_);
    const auto waiting = waiting_.find(number);
    if (waiting == waiting_.end()) {
      return;
    }
    done = std::move(waiting->second);
    waiting_.erase(waiting);
  }
  if (result.has_changed() && !application_.time().is_simulated()) {
    settling_.push_back(
        {.number = number, .done = std::move(done), .awaited = application_.peers()->recipients()});
  } else {
    done(result);
  }
}

/// `process` has made it; without a number, it has ended.
void ParamChanges::settle(std::uint32_t process, std::optional<std::uint64_t> number) {
  for (std::size_t i = 0; i < settling_.size();) {
    Settling& one = settling_[i];
    if (!number || one.number == *number) {
      one.awaited.erase(process);
    }
    if (one.awaited.empty()) {
      const Done done = std::move(one.done);
      settling_.erase(settling_.begin() + static_cast<std::ptrdiff_t>(i));
      done({});
    } else {
      ++i;
    }
  }
}

void ParamChanges::all_have_answered() {
  if (asked_.empty()) {
    return;
  }
  // A process was restarted in the midst of it.
  verdict_.awaited.clear();
  verdict_.errors.emplace(0, "a process was restarted meanwhile: the params stay as they are");
  decide();
}

std::string ParamChanges::make_snapshot() const {
  const std::lock_guard lock(mutex_);
  return dumped(Json{{"transactions", transactions_}, {"changed", changed_}});
}

void ParamChanges::take_snapshot(const std::string& text) {
  const Json json = Json::parse(text);
  const std::lock_guard lock(mutex_);
  transactions_ = json.at("transactions").get<std::uint64_t>();
  changed_ = json.at("changed").get<std::map<std::string, std::string>>();
  for (const auto& component : application_.components()) {
    if (application_.runs_elsewhere(component->name)) {
      continue;
    }
    Json own = Json::object();
    for (const DeclaredParam& param : component->param_table.all()) {
      const auto changed = changed_.find(component->name + "." + param.spec().name);
      if (param.is_declared && changed != changed_.end() &&
          dumped(to_json(param.spec(), param.committed)) != changed->second) {
        own[param.spec().name] = Json::parse(changed->second, nullptr, false);
      }
    }
    config::Problems ignored;  // The values were good for the process before.
    const ParamValues values = values_of(*component, own, ignored);
    if (!values.empty()) {
      component->param_table.commit(transactions_, values);
      component->post(
          detail::Cause::kParameter,
          [&core = *component, transaction = transactions_, values, text = dumped(own)] {
            core.take_params(transaction, values, text);
          },
          nullptr, transactions_);
    }
  }
}

std::map<std::string, std::string> ParamChanges::facts() const {
  const std::lock_guard lock(facts_mutex_);
  return facts_;
}

}  // namespace fastcycle::host
