#include "host/life_changes.h"

#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "component/application_host.h"
#include "component/component_core.h"
#include "component/time_driver.h"
#include "component/words.h"

namespace fastcycle::host {

using detail::ComponentCore;
using detail::LifeStep;
using nlohmann::json;

namespace {

std::string dumped(const json& said) {
  return said.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// The requested step; none if it is not allowed for tools.
std::optional<LifeStep> step_of(const json& said) {
  for (const LifeStep step : {LifeStep::kRenew, LifeStep::kToolStop, LifeStep::kToolStart,
                              LifeStep::kReload, LifeStep::kRollBack, LifeStep::kConfirm}) {
    if (said == static_cast<unsigned>(step)) {
      return step;
    }
  }
  return std::nullopt;
}

}  // namespace

void LifeChanges::make(ComponentCore& component, LifeStep step, Done done) {
  if (!application_.runs_elsewhere(component.name)) {
    make_here(component, step, std::move(done));
    return;
  }
  ask_elsewhere(component, {{"step", static_cast<unsigned>(step)}}, std::move(done));
}

void LifeChanges::reload(ComponentCore& component, const json& order, Done done) {
  if (!application_.runs_elsewhere(component.name)) {
    on_reload(component, order, std::move(done));
    return;
  }
  ask_elsewhere(component, {{"step", static_cast<unsigned>(LifeStep::kReload)}, {"order", order}},
                std::move(done));
}

void LifeChanges::ask_elsewhere(ComponentCore& component, json what, Done done) {
  Peers& peers = *application_.peers();
  std::uint64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    number = ++numbers_;
    asked_[number] = {.process = peers.process_of(component.name), .done = std::move(done)};
  }
  what["number"] = number;
  try {
    peers.send_notice(Notice::Kind::kLifeAsked, component.index, dumped(what));
  } catch (const std::length_error& error) {
    answer(number, error.what(), {});
  }
}

void LifeChanges::make_here(ComponentCore& component, LifeStep step, Done done) {
  const auto why_not = std::make_shared<std::string>();
  // In the component's own activation.
  const auto change = [&component, step, why_not] { *why_not = component.obey(step); };
  const auto finish = [&component, why_not, done = std::move(done)] {
    done(*why_not, to_word(component.state.load()));
  };
  application_.time().between_rounds([&component, change, finish, step] {
    component.post_and_notify(detail::Cause::kMode, change, finish, detail::to_key(step));
  });
}

void LifeChanges::take(const Notice& notice) {
  Peers& peers = *application_.peers();
  if (notice.kind == Notice::Kind::kGone) {
    process_has_ended(notice.process);
    return;
  }
  if (notice.kind != Notice::Kind::kLifeAsked && notice.kind != Notice::Kind::kLifeMade) {
    return;
  }
  try {
    const json said = json::parse(notice.text);
    const std::uint64_t number = said.at("number");
    if (notice.kind == Notice::Kind::kLifeMade) {
      if (peers.is_here(said.at("process").get<std::uint32_t>())) {
        answer(number, said.at("why_not"), said.at("state"));
      }
      return;
    }
    const auto step = step_of(said.at("step"));
    if (!step || notice.component >= application_.components().size()) {
      return;
    }
    ComponentCore& component = *application_.components()[notice.component];
    if (application_.runs_elsewhere(component.name)) {
      return;
    }
    const Done answer = [&peers, number, process = notice.process](const std::string& why_not,
                                                                   const std::string& state) {
      peers.send_notice(
          Notice::Kind::kLifeMade, 0,
          dumped(
              {{"process", process}, {"number", number}, {"why_not", why_not}, {"state", state}}));
    };
    if (*step == LifeStep::kReload) {
      on_reload(component, said.at("order"), answer);
    } else {
      make_here(component, *step, answer);
    }
  } catch (const json::exception&) {  // The sender is broken: ignored.
  }
}

void LifeChanges::answer(std::uint64_t number, const std::string& why_not,
                         const std::string& state) {
  Done done;
  {
    const std::lock_guard lock(mutex_);
    const auto asked = asked_.find(number);
    if (asked == asked_.end()) {
      return;
    }
    done = std::move(asked->second.done);
    asked_.erase(asked);
  }
  done(why_not, state);
}

void LifeChanges::process_has_ended(std::uint32_t process) {
  std::vector<std::uint64_t> numbers;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [number, asked] : asked_) {
      if (asked.process == process) {
        numbers.push_back(number);
      }
    }
  }
  for (const std::uint64_t number : numbers) {
    answer(number, "its process has ended", {});
  }
}

}  // namespace fastcycle::host
