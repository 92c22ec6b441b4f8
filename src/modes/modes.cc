#include "modes/modes.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "component/application_host.h"
#include "component/bell.h"
#include "component/component_core.h"
#include "component/peers.h"
#include "component/time_driver.h"
#include "component/wait.h"
#include "config/nearest.h"
#include "mcap/topic_filter.h"

namespace fastcycle::host {

using detail::Cause;
using detail::ComponentCore;
using detail::LifeStep;
using detail::to_key;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t kMaxWaiting = 64;
constexpr std::size_t kMaxKept = 10'000;  // Switches kept for the report.

}  // namespace

void explain(const std::vector<ModeSwitch>& switches, std::map<std::string, std::string>& facts) {
  constexpr std::size_t kMost = 1000;
  for (std::size_t i = 0; i < std::min(switches.size(), kMost); ++i) {
    const std::string key = fmt::format("switch.{}.", i);
    facts[key + "time_ns"] = std::to_string(base::to_ns(switches[i].stamp));
    facts[key + "to"] = switches[i].to;
    facts[key + "by"] = switches[i].by;
  }
}

std::vector<ModeSwitch> switches_in(const std::map<std::string, std::string>& facts) {
  std::vector<ModeSwitch> switches;
  for (;;) {
    const std::string key = fmt::format("switch.{}.", switches.size());
    const auto time = facts.find(key + "time_ns");
    const auto to = facts.find(key + "to");
    const auto by = facts.find(key + "by");
    if (time == facts.end() || to == facts.end() || by == facts.end()) {
      return switches;
    }
    std::int64_t time_ns = 0;
    std::from_chars(time->second.data(), time->second.data() + time->second.size(), time_ns);
    switches.push_back({.stamp = base::from_ns(time_ns),
                        .from = {},
                        .to = to->second,
                        .why = {},
                        .by = by->second});
  }
}

Modes::Modes(ApplicationHost& application) : application_(application) {}

void Modes::resolve(config::Problems& problems) {
  const config::ApplicationDescription& description = application_.description();
  const std::vector<std::string> executors = executor_names(description);
  std::vector<std::string> components;
  for (const config::ComponentDescription& component : description.components) {
    components.push_back(component.name);
  }
  is_switched_.assign(components.size(), false);
  for (const config::ModeDescription& described : description.modes) {
    Mode mode{.name = described.name, .is_active = std::vector<bool>(components.size(), false)};
    const auto add_those = [&](const auto& is_meant) {
      bool is_anyone = false;
      for (std::size_t i = 0; i < components.size(); ++i) {
        if (is_meant(description.components[i])) {
          mode.is_active[i] = true;
          is_switched_[i] = true;
          is_anyone = true;
        }
      }
      return is_anyone;
    };
    const std::string its = "the mode \"" + described.name + "\" names ";
    for (const std::string& pattern : described.components) {
      if (!add_those([&](const auto& one) { return mcap::matches(pattern, one.name); })) {
        const bool is_pattern = pattern.find_first_of("*?") != std::string::npos;
        problems.add(config::make_error(
            described.place,
            is_pattern ? its + "no component by the pattern \"" + pattern + "\""
                       : its + "the component \"" + pattern + "\", which does not exist",
            config::did_you_mean(config::nearest(pattern, components))));
      }
    }
    for (const std::string& executor : described.executors) {
      if (std::ranges::find(executors, executor) == executors.end()) {
        problems.add(config::make_error(
            described.place, its + "the executor \"" + executor + "\", which does not exist",
            config::did_you_mean(config::nearest(executor, executors))));
      } else {
        add_those([&](const auto& one) {
          return one.executor == executor || (one.executor.empty() && executor == executors.back());
        });
      }
    }
    modes_.push_back(std::move(mode));
  }
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    if (modes_[i].name == description.initial_mode) {
      current_ = i;
      last_asked_ = i;
    }
  }
}

bool Modes::is_active_at_first(std::uint32_t component) const {
  return !is_switched(component) || modes_[current_].is_active[component];
}

bool Modes::is_switched(std::uint32_t component) const {
  return component < is_switched_.size() && is_switched_[component];
}

std::size_t Modes::find(std::string_view mode) const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < modes_.size(); ++i) {
    if (modes_[i].name == mode) {
      return i;
    }
    names.push_back(modes_[i].name);
  }
  const std::string hint = config::did_you_mean(config::nearest(mode, names));
  throw std::invalid_argument("there is no mode \"" + std::string(mode) + "\"" +
                              (hint.empty() ? "" : "; " + hint));
}

nlohmann::json Modes::to_json(const Request& request) {
  return {{"to", request.to}, {"why", request.why}, {"by", request.by}};
}

/// None if invalid: it comes from another process, which may be faulty.
std::optional<Modes::Request> Modes::request_from(const nlohmann::json& json) const {
  const bool is_one = json.is_object() && json.contains("to") && json["to"].is_number_unsigned() &&
                      json["to"].get<std::size_t>() < modes_.size() && json.contains("why") &&
                      json["why"].is_string() && json.contains("by") && json["by"].is_string();
  if (!is_one) {
    return std::nullopt;
  }
  return Request{.to = json["to"], .why = json["why"], .by = json["by"]};
}

Modes::Request Modes::request(std::string_view mode, std::string_view why,
                              const ComponentCore* by) const {
  return {.to = find(mode), .why = std::string(why), .by = by == nullptr ? "" : by->name};
}

void Modes::ask(std::string_view mode, std::string_view why, ComponentCore* by) {
  if (by != nullptr && by->publishing.is_in_activation()) {
    ask_in_turn(mode, why, *by);
    return;
  }
  application_.time().between_rounds([this, request = request(mode, why, by)] { put(request); });
}

void Modes::ask_in_turn(std::string_view mode, std::string_view why, ComponentCore& by) {
  // In simulated time between two rounds, so that the result does not depend on worker speed.
  application_.time().stage(by, [this, request = request(mode, why, &by)] { put(request); });
}

bool Modes::is_asked(std::string_view mode) const noexcept {
  return !modes_.empty() && modes_[last_asked_.load()].name == mode;
}

void Modes::put(Request request) {
  Peers* const peers = application_.peers();
  if (peers == nullptr) {
    put_in_order(std::move(request));
    return;
  }
  const auto& all = application_.components();
  const auto by =
      std::ranges::find_if(all, [&](const auto& one) { return one->name == request.by; });
  peers->send_notice(
      Notice::Kind::kModeAsked, static_cast<std::uint32_t>(by - all.begin()),
      to_json(request).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

void Modes::put_in_order(Request request) {
  {
    const std::lock_guard lock(mutex_);
    if (is_over_ || request.to == last_asked_) {
      return;
    }
    if (waiting_.size() == kMaxWaiting) {
      ++refused_;
      return;
    }
    last_asked_ = request.to;
    waiting_.push_back(std::move(request));
    if (!has_begun_ || is_switching_) {
      return;
    }
    is_switching_ = true;
  }
  begin_next();
}

void Modes::begin() {
  Peers* const peers = application_.peers();
  if (peers == nullptr || application_.time().is_simulated()) {
    begin_in_order();
  } else if (peers->is_main()) {  // By now the components of all processes have started.
    peers->send_notice(Notice::Kind::kModesBegun, 0, {});
  }
}

void Modes::begin_in_order() {
  {
    const std::lock_guard lock(mutex_);
    has_begun_ = true;
    if (is_over_ || waiting_.empty()) {
      return;
    }
    is_switching_ = true;
  }
  begin_next();
}

void Modes::end() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
    waiting_.clear();
  }
  if (application_.time().is_simulated()) {
    return;
  }
  wait_until(deadline_in(1s), [this] { return !is_switching(); });
}

/// Starts the first waiting request.
void Modes::begin_next() {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty()) {
      is_switching_ = false;
      return;
    }
    request_ = std::move(waiting_.front());
    waiting_.pop_front();
    from_ = current_;
  }
  if (application_.time().is_simulated()) {
    switch_at_once();
    return;
  }
  if (const Peers* const peers = application_.peers()) {
    awaited_processes_ = peers->recipients();
  }
  is_entering_ = false;
  step_ = Step::kLeaving;
  awaited_ = 1;  // This function itself: prevents completion before all are asked.
  for (const auto& component : application_.components()) {
    if (leaves(component->index) && !application_.runs_elsewhere(component->name)) {
      awaited_.fetch_add(1);
      component->post_and_notify(
          Cause::kMode, [&core = *component] { core.call_deactivate(); }, [this] { arrive(); },
          to_key(LifeStep::kDeactivate));
    }
  }
  arrive();
}

bool Modes::leaves(std::uint32_t component) const {
  return is_switched(component) && modes_[from_].is_active[component] &&
         !modes_[request_.to].is_active[component];
}

bool Modes::joins(std::uint32_t component) const {
  return is_switched(component) && !modes_[from_].is_active[component] &&
         modes_[request_.to].is_active[component];
}

/// One more awaited component has done its step.
void Modes::arrive() {
  if (awaited_.fetch_sub(1) != 1) {
    return;
  }
  if (application_.peers() != nullptr) {
    report_done();
  } else if (step_ == Step::kLeaving) {
    enter(application_.clock().now());
  } else {
    begin_next();
  }
}

/// All leaving components have left: the mode changes, and joining ones may begin.
void Modes::enter(Time stamp) {
  bool is_over = false;
  {
    const std::lock_guard lock(mutex_);
    is_over = is_over_;
  }
  set_mode(stamp);
  if (const Peers* const peers = application_.peers()) {
    awaited_processes_ = peers->recipients();
  }
  step_ = Step::kJoining;
  awaited_ = 1;
  for (const auto& component : application_.components()) {
    if (!is_over && joins(component->index) && !application_.runs_elsewhere(component->name)) {
      awaited_.fetch_add(1);
      component->post_and_notify(
          Cause::kMode, [&core = *component] { core.call_activate(); }, [this] { arrive(); },
          to_key(LifeStep::kActivate));
    }
  }
  arrive();
}

/// Simulated time, between two rounds: the switch takes effect with the next one.
void Modes::switch_at_once() {
  set_mode(application_.clock().now());
  step_ = Step::kJoining;
  awaited_ = 1;
  std::vector<std::uint32_t> leaving;
  for (const auto& component : application_.components()) {
    const bool is_leaving = leaves(component->index);
    if ((!is_leaving && !joins(component->index)) || application_.runs_elsewhere(component->name)) {
      continue;
    }
    if (is_leaving) {
      leaving.push_back(component->index);
    }
    awaited_.fetch_add(1);
    component->post_and_notify(
        Cause::kMode,
        [&core = *component, is_leaving] {
          is_leaving ? core.call_deactivate() : core.call_activate();
        },
        [this, &core = *component] { core.stage([this] { arrive(); }); },
        to_key(is_leaving ? LifeStep::kDeactivate : LifeStep::kActivate));
  }
  application_.time().serve_first(std::move(leaving));
  arrive();
  if (application_.peers() != nullptr && !is_anyone_concerned()) {
    begin_next();  // Else at the end of the next round.
  }
}

bool Modes::is_anyone_concerned() const {
  for (std::uint32_t component = 0; component < is_switched_.size(); ++component) {
    if (leaves(component) || joins(component)) {
      return true;
    }
  }
  return false;
}

/// Sets the stamp of the switch in progress.
void Modes::set_mode(Time stamp) {
  ModeSwitch made{.stamp = stamp,
                  .from = {},
                  .to = modes_[request_.to].name,
                  .why = request_.why,
                  .by = request_.by};
  {
    const std::lock_guard lock(mutex_);
    made.from = modes_[current_].name;
    current_ = request_.to;
    if (switches_.size() < kMaxKept) {
      switches_.push_back(made);
    }
  }
  if (const Peers* const peers = application_.peers(); peers != nullptr && !peers->is_main()) {
    return;  // The main process reports it.
  }
  std::string text = "mode \"" + made.from + "\" → \"" + made.to + "\"";
  if (!made.by.empty()) {
    text += ", requested by " + made.by;
  }
  if (!made.why.empty()) {
    text += ": " + made.why;
  }
  application_.log(LogLevel::kInfo, {}, text);
  application_.mode_changed();
}

// ---- Several processes ----

/// The components of this process have done their step.
void Modes::report_done() {
  if (application_.time().is_simulated()) {
    return;  // Checked at the end of the round.
  }
  application_.peers()->send_notice(
      step_ == Step::kLeaving ? Notice::Kind::kModeLeft : Notice::Kind::kModeJoined, 0, {});
}

void Modes::take(const Notice& notice) {
  using Kind = Notice::Kind;
  switch (notice.kind) {
    case Kind::kModesBegun:
      begin_in_order();
      break;
    case Kind::kModeAsked: {
      const auto json = nlohmann::json::parse(notice.text, nullptr, false);
      if (auto request = request_from(json)) {
        put_in_order(std::move(*request));
      }
      break;
    }
    case Kind::kModeEntered: {
      std::int64_t stamp_ns = 0;
      std::from_chars(notice.text.data(), notice.text.data() + notice.text.size(), stamp_ns);
      if (is_switching() && step_ == Step::kLeaving) {
        enter(base::from_ns(stamp_ns));
      }
      break;
    }
    case Kind::kModeLeft:
    case Kind::kModeJoined:
      if ((notice.kind == Kind::kModeLeft) == (step_ == Step::kLeaving)) {
        awaited_processes_.erase(notice.process);
        go_on_if_all_have_done();
      }
      break;
    case Kind::kGone:
      awaited_processes_.erase(notice.process);
      go_on_if_all_have_done();
      break;
    default:
      break;
  }
}

void Modes::go_on_if_all_have_done() {
  if (!is_switching() || !awaited_processes_.empty() || application_.time().is_simulated()) {
    return;
  }
  if (step_ == Step::kJoining) {
    begin_next();
  } else if (application_.peers()->is_main() && !std::exchange(is_entering_, true)) {
    application_.peers()->send_notice(Notice::Kind::kModeEntered, 0,
                                      std::to_string(base::to_ns(application_.clock().now())));
  }
}

void Modes::round_is_over(bool is_anyone_busy) {
  if (!is_anyone_busy && is_switching()) {
    begin_next();
  }
}

std::string Modes::make_snapshot() const {
  const std::lock_guard lock(mutex_);
  auto waiting = nlohmann::json::array();
  for (const Request& request : waiting_) {
    waiting.push_back(to_json(request));
  }
  nlohmann::json json{{"mode", current_},
                      {"last_asked", last_asked_.load()},
                      {"waiting", waiting},
                      {"has_begun", has_begun_},
                      {"is_switching", is_switching_},
                      {"from", from_},
                      {"request", to_json(request_)},
                      {"is_joining", step_ == Step::kJoining},
                      {"awaited", awaited_processes_}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void Modes::take_snapshot(const std::string& text) {
  const auto json = nlohmann::json::parse(text);
  {
    const std::lock_guard lock(mutex_);
    current_ = json.at("mode");
    last_asked_ = json.at("last_asked").get<std::size_t>();
    waiting_.clear();
    for (const auto& one : json.at("waiting")) {
      if (auto request = request_from(one)) {
        waiting_.push_back(std::move(*request));
      }
    }
    has_begun_ = json.at("has_begun");
    is_switching_ = json.at("is_switching");
    from_ = json.at("from");
    request_ = request_from(json.at("request")).value_or(Request{});
    step_ = json.at("is_joining").get<bool>() ? Step::kJoining : Step::kLeaving;
    awaited_processes_ = json.at("awaited").get<std::set<std::uint32_t>>();
  }
  const bool is_leaving = is_switching_ && step_ == Step::kLeaving;
  for (const auto& component : application_.components()) {
    const std::uint32_t index = component->index;
    if (!is_switched(index) || application_.runs_elsewhere(component->name)) {
      continue;
    }
    const bool is_wanted = is_active_at_first(index) && !(is_leaving && leaves(index));
    if (component->state == ComponentCore::State::kConstructed) {
      component->is_wanted = is_wanted;
    } else {
      component->post(Cause::kMode, [&core = *component, is_wanted] {
        is_wanted ? core.call_activate() : core.call_deactivate();
      });
    }
  }
  if (is_switching_) {
    report_done();
  }
}

std::string Modes::current() const {
  const std::lock_guard lock(mutex_);
  return modes_.empty() ? std::string() : modes_[current_].name;
}

std::vector<ModeSwitch> Modes::switches() const {
  const std::lock_guard lock(mutex_);
  return switches_;
}

std::uint64_t Modes::refused() const {
  const std::lock_guard lock(mutex_);
  return refused_;
}

bool Modes::is_switching() const {
  const std::lock_guard lock(mutex_);
  return is_switching_;
}

}  // namespace fastcycle::host
