#include "component/reloading.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/message.h>

#include "base/build_id.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/declared_states.h"
#include "component/wiring.h"
#include "component/words.h"
#include "config/merge.h"

namespace fastcycle::detail {

namespace {

/// "planner_v2 (build 1f3a5c7e9b0d)"
std::string in_words(const ComponentVersion& version) {
  constexpr std::size_t kDigits = 12;
  const std::string library = version.library.empty() ? "the library of before" : version.library;
  return version.build_id.empty()
             ? library
             : fmt::format("{} (build {})", library, version.build_id.substr(0, kDigits));
}

double seconds(Duration span) {
  return std::chrono::duration<double>(span).count();
}

}  // namespace

Reloading::Reloading(ComponentCore& core) : core_(core) {
  news_.library = core.description.library;
  news_.build_id = base::build_id_at(reinterpret_cast<const void*>(core.component_class.create));
}

VersionNews Reloading::news() const {
  VersionNews news;
  {
    const std::lock_guard lock(mutex_);
    news = news_;
  }
  news.is_on_probation = is_on_probation();
  return news;
}

void Reloading::report(const std::string& what, bool is_trouble) {
  {
    const std::lock_guard lock(mutex_);
    news_.last = what;
  }
  core_.log_source.write(is_trouble ? LogLevel::kWarning : LogLevel::kInfo, what);
  core_.application.version_changed(core_);
}

// ---- The end of the probation ----

std::optional<QosEvent> Reloading::look(std::int64_t now_ns) noexcept {
  if (is_on_probation() && now_ns >= ends_ns_ && !is_end_asked_.exchange(true)) {
    core_.post(
        Cause::kMode, [this] { static_cast<void>(is_judged()); }, &core_,
        to_key(LifeStep::kConfirm));
  }
  return std::nullopt;
}

std::int64_t Reloading::next_look_ns() const noexcept {
  return is_on_probation() && !is_end_asked_.load() ? ends_ns_ : base::kNever;
}

void Reloading::watch() {
  if (is_on_probation()) {
    core_.add_watch(*this);
  }
}

bool Reloading::is_judged() {
  if (!is_on_probation()) {
    return false;
  }
  if (base::to_ns(core_.publishing.now) < ends_ns_) {
    return true;
  }
  static_cast<void>(confirm("its probation is over"));
  return false;
}

std::string Reloading::confirm(const std::string& why) {
  if (!is_on_probation_.exchange(false)) {
    return "it is not on probation";
  }
  const ComponentVersion present{.library = news().library, .build_id = news().build_id};
  before_.reset();
  report(fmt::format("{} stays: {}", in_words(present), why), false);
  return {};
}

// ---- Exchange ----

Reloading::States Reloading::copy_of_states() const {
  States states;
  if (core_.states != nullptr) {
    for (const auto& one : static_cast<const DeclaredStates&>(*core_.states).all()) {
      states.emplace_back(one->value->New());
      states.back()->CopyFrom(*one->value);
    }
  }
  return states;
}

void Reloading::set_states(const States& states) {
  const auto& all = static_cast<const DeclaredStates&>(*core_.states).all();
  for (std::size_t i = 0; i < std::min(all.size(), states.size()); ++i) {
    all[i]->save = nullptr;  // The object is not asked: it has faulted.
    all[i]->value->CopyFrom(*states[i]);
  }
}

void Reloading::end_in_order(const std::function<void()>& next) {
  if (core_.state == ComponentState::kActive) {
    core_.in_call_ = "its deactivate()";
    core_.component->deactivate();
    core_.in_call_ = nullptr;
  }
  // Its threads must not use resources released by `stop`.
  core_.owes_stop_ = true;
  core_.keeps_messages_ = true;
  core_.end_threads([this, next] {
    core_.owes_stop_ = false;
    core_.state = ComponentState::kStandby;
    core_.in_call_ = "its stop()";
    core_.component->stop();
    core_.in_call_ = nullptr;
    core_.end_calls("it is reloaded");
    next();
  });
}

void Reloading::reload(const std::shared_ptr<const ReloadOrder>& order) {
  const ComponentState state = core_.state;
  if (is_judged()) {
    order->on_result("it is on probation: confirm what it runs now, or roll it back, before");
    return;
  }
  if (state != ComponentState::kActive && state != ComponentState::kStandby) {
    order->on_result(std::string("it is ") + host::to_word(state));
    return;
  }
  on_result_ = order->on_result;
  end_in_order([this, order] { exchange(*order); });
}

void Reloading::answer(const std::string& why_not) {
  if (const auto on_result = std::exchange(on_result_, nullptr)) {
    on_result(why_not);
  }
}

void Reloading::exchange(const ReloadOrder& order) {
  if (core_.states != nullptr) {
    core_.states->end_object();
  }
  const VersionNews now = news();
  Before before{.version = {.component_class = core_.component_class,
                            .library = now.library,
                            .build_id = now.build_id},
                .params = params_,
                .ordered = {},
                .param_values = {},
                .states = copy_of_states()};
  params_.reset();
  if (order.params) {
    before.ordered = order.params;
    before.param_values = core_.param_table.keep(*order.params);
    config::Problems ignored;  // Both are objects.
    config::Value merged = core_.description.params;
    config::merge(merged, *order.params, ignored);
    params_ = std::move(merged);
    ordered_params_ = &*order.params;
  }
  before_ = std::move(before);
  core_.end_object();  // By the class that made it.
  core_.component_class = order.version.component_class;
  ++exchanges_;
  {
    const std::lock_guard lock(mutex_);
    ++news_.reloads;
    news_.library = order.version.library;
    news_.build_id = order.version.build_id;
  }
  const std::string why_not = core_.try_anew();
  ordered_params_ = nullptr;
  if (!why_not.empty()) {
    return_to_previous(false, why_not);
    answer(fmt::format("{}; {} is back", why_not,
                       in_words({.library = now.library, .build_id = now.build_id})));
    return;
  }
  misses_ = 0;
  misses_forgiven_ = order.misses_forgiven;
  is_rollback_asked_ = false;
  is_end_asked_ = false;
  ends_ns_ = base::to_ns(core_.publishing.now + order.probation);
  is_on_probation_ = order.probation > Duration(0);
  watch();
  report(fmt::format(
             "reloaded: {} in place of {}{}", in_words(order.version), in_words(before_->version),
             is_on_probation() ? fmt::format(", {} s on probation", seconds(order.probation)) : ""),
         false);
  if (!is_on_probation()) {
    before_.reset();
  }
  answer({});
}

void Reloading::put_back() {
  core_.component_class = before_->version.component_class;
  params_ = before_->params;
  if (before_->ordered) {
    core_.param_table.put_back(*before_->ordered, before_->param_values);
  }
  const std::lock_guard lock(mutex_);
  ++news_.rollbacks;
  news_.library = before_->version.library;
  news_.build_id = before_->version.build_id;
}

void Reloading::return_to_previous(bool keeps_state, const std::string& why) {
  is_on_probation_ = false;
  const VersionNews now = news();
  core_.end_calls(why);
  if (core_.states != nullptr && keeps_state) {
    core_.states->end_object();
  } else if (core_.states != nullptr) {
    set_states(before_->states);
  }
  core_.end_object();
  ++exchanges_;
  put_back();
  const std::string text = fmt::format("rolled back from {} to {}, with the state {}: {}",
                                       in_words({.library = now.library, .build_id = now.build_id}),
                                       in_words(before_->version),
                                       keeps_state ? "of now" : "that it had handed over", why);
  before_.reset();
  core_.make_anew();
  report(text, true);
}

// ---- Rollback ----

std::string Reloading::roll_back(const std::string& why) {
  const ComponentState state = core_.state;
  if (!is_judged()) {
    return "it is not on probation";
  }
  if (state != ComponentState::kActive && state != ComponentState::kStandby) {
    return std::string("it is ") + host::to_word(state);
  }
  end_in_order([this, why] { return_to_previous(true, why); });
  return {};
}

bool Reloading::take_fault(const std::string& what) {
  if (!is_judged() || !core_.has_started()) {
    return false;
  }
  core_.note_contained_fault(what);
  core_.end_calls(what);
  core_.keeps_messages_ = true;
  core_.end_threads([this, what] { return_to_previous(false, what); });
  return true;
}

void Reloading::ask_for_rollback(const std::string& why) {
  if (!is_on_probation() || is_rollback_asked_.exchange(true)) {
    return;
  }
  core_.post(
      Cause::kMode,
      [this, why] {
        if (is_judged()) {
          static_cast<void>(roll_back(why));
        }
      },
      nullptr, to_key(LifeStep::kRollBack));
}

void Reloading::note_miss(const std::string& what) {
  if (is_on_probation() && ++misses_ > misses_forgiven_.load()) {
    ask_for_rollback(fmt::format("it missed {} deadlines; the last: {}", misses_.load(), what));
  }
}

void Reloading::note_hang(const std::string& what) {
  ask_for_rollback(what);
}

}  // namespace fastcycle::detail
