#include "host/diagnosis.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>

#include "component/component_core.h"
#include "host/application.h"

namespace fastcycle::host {
namespace {

using detail::ComponentCore;
using diagnostics::RunningCall;
using namespace std::chrono_literals;

/// How long a call of the life cycle may take before it is reported.
constexpr auto kNotice = 750ms;
/// After a component that hangs asked for the end of the run.
constexpr auto kEndLimit = 2s;

ComponentCore& core_of(const RunningCall& call) {
  return const_cast<ComponentCore&>(static_cast<const ComponentCore&>(*call.actor));
}

std::chrono::nanoseconds limit_of(const config::HangDescription& hang, bool is_lifecycle) {
  return is_lifecycle ? hang.lifecycle_limit : hang.callback_limit;
}

/// Where it stands. Below the component's own code there is only how the framework came to call it.
std::vector<std::string> stack_of(const RunningCall& call) {
  constexpr std::size_t kMaxLines = 12;
  const std::size_t own = call.own_frames();
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < std::min(own == 0 ? call.stack.size() : own, kMaxLines); ++i) {
    lines.push_back("  #" + std::to_string(i) + " " + call.stack[i]);
  }
  return lines;
}

/// Applies the component's policy. Printed directly, since the log may not be written any more.
[[noreturn]] void end_process_of(const RunningCall& call) {
  const ComponentCore& core = core_of(call);
  std::string text = "\nfastcycle: component \"" + core.name + "\": " + call.in_words() +
                     "; its process ends now, as its \"on_hang\" says\n  it stands in " +
                     call.place() + ", thread " + call.thread + "\n";
  for (const std::string& line : stack_of(call)) {
    text += line + "\n";
  }
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
  diagnostics::end_process(1);
}

}  // namespace

std::uint32_t component_of_this_thread() noexcept {
  const detail::RunningActivation* const running = detail::current_activation();
  const detail::ActorBase* const actor =
      running == nullptr ? nullptr : running->actor.load(std::memory_order_relaxed);
  return actor == nullptr ? 0 : actor->index + 1;
}

Diagnosis::Diagnosis(Application& application, std::filesystem::path folder)
    : application_(application), folder_(std::move(folder)) {
  update_reporter({});
  watchdog_.emplace(options());
}

Diagnosis::~Diagnosis() = default;

void Diagnosis::update_reporter(std::vector<const detail::ActivationRing*> rings) {
  diagnostics::RunFacts facts;
  facts.application = application_.description().name;
  facts.folder = folder_;
  if (application_.components().empty()) {
    for (const config::ComponentDescription& component : application_.description().components) {
      facts.components.push_back({.name = component.name, .library = component.library});
    }
  }
  for (const auto& component : application_.components()) {
    facts.components.push_back(
        {.name = component->name, .library = component->description.library});
  }
  for (const auto& [name, topic] : application_.topics().all()) {
    for (const auto& publisher : topic->publishers) {
      facts.publishers.push_back({.id = publisher->id,
                                  .topic = name,
                                  .component = publisher->owner.name,
                                  .core = publisher.get()});
    }
  }
  if (const record::FlightRecorder* recorder = application_.flight_recorder();
      recorder != nullptr && recorder->ring() != nullptr) {
    facts.note = &recorder->ring()->crash_note();
    facts.folder = recorder->ring()->file().parent_path();
    if (facts.folder.empty()) {
      facts.folder = ".";
    }
  }
  if (Peers* const peers = application_.peers()) {
    facts.crashed = peers->crashed();
  }
  facts.rings = std::move(rings);
  facts.log = &application_.log_queue();
  reporter_.know(std::move(facts));
}

void Diagnosis::open(config::Problems&) {
  update_reporter({});
}

void Diagnosis::start(const ObserverView& view, std::vector<base::Refusal>&) {
  update_reporter(view.rings);
}

void Diagnosis::stop(const Application&) {
  // Observers that have stopped may give up what a report would write into.
  update_reporter({});
}

diagnostics::Watchdog::Options Diagnosis::options() {
  diagnostics::Watchdog::Options options;
  for (const config::ComponentDescription& component : application_.description().components) {
    for (const auto limit : {component.hang.callback_limit, component.hang.lifecycle_limit}) {
      if (limit.count() > 0 &&
          (options.smallest_limit.count() == 0 || limit < options.smallest_limit)) {
        options.smallest_limit = limit;
      }
    }
  }
  options.limit_of = [this](const RunningCall& call) -> std::optional<std::chrono::nanoseconds> {
    const ComponentCore& core = core_of(call);
    const auto limit = limit_of(core.description.hang, call.is_lifecycle);
    return &core.application != &application_ || limit.count() == 0 ? std::nullopt
                                                                    : std::optional(limit);
  };
  // A start may take long: it is reported before its limit.
  options.notice = kNotice;
  options.on_slow = [this](const RunningCall& call) {
    if (call.is_lifecycle) {
      application_.log(LogLevel::kInfo, core_of(call).name, call.in_words());
    }
  };
  options.on_hang = [this](const RunningCall& call) { hangs(call); };
  options.on_look = [this](const RunningCall& call) { goes_on_hanging(call); };
  options.on_return = [this](const RunningCall& call) { returns(call); };
  return options;
}

void Diagnosis::hangs(const RunningCall& call) {
  ComponentCore& core = core_of(call);
  if (core.description.hang.on_hang == config::OnHang::kEndProcess) {
    end_process_of(call);
  }
  const bool is_end = core.description.hang.on_hang == config::OnHang::kStop;
  const LogLevel level = is_end ? LogLevel::kError : LogLevel::kWarning;
  application_.log(level, core.name, call.in_words());
  application_.log(level, core.name, "it stands in " + call.place() + ", thread " + call.thread);
  for (const std::string& line : stack_of(call)) {
    application_.log(level, core.name, line);
  }
  application_.hang_changed(core, call.in_words());
  if (is_end) {
    application_.log(level, core.name, "the run ends, as its \"on_hang\" says");
    application_.request_end(EndReason::kFault);
    endings_.push_back({.call = call, .since = std::chrono::steady_clock::now()});
  }
}

void Diagnosis::goes_on_hanging(const RunningCall& call) {
  core_of(call).set_hang(call.in_words());  // With the time until now.
  for (const Ending& ending : endings_) {
    if (ending.call.begin_ns != call.begin_ns || ending.call.actor != call.actor ||
        std::chrono::steady_clock::now() - ending.since < kEndLimit) {
      continue;
    }
    std::fprintf(stderr,
                 "\nfastcycle: component \"%s\": %s, and keeps the run from ending; the process "
                 "ends now, with exit code 1\n",
                 core_of(call).name.c_str(), call.in_words().c_str());
    std::fflush(stderr);
    diagnostics::end_process(1);
  }
}

void Diagnosis::returns(const RunningCall& call) {
  ComponentCore& core = core_of(call);
  application_.log(LogLevel::kInfo, core.name, call.call + " has returned after all");
  application_.hang_changed(core, {});
}

}  // namespace fastcycle::host
