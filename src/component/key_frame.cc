#include "component/key_frame.h"

#include <optional>

#include <google/protobuf/message.h>

#include "base/clock.h"
#include "component/component_core.h"
#include "component/declared_states.h"
#include "config/problem.h"
#include "executor/life_step.h"

namespace fastcycle::detail {

namespace {

using Number = DeclaredStates::FrameNumber;

std::optional<std::uint64_t> find_number(const KeyFrame& frame, Number place) {
  for (const ReplayedReads::Entry& entry : frame.reads) {
    if (entry.read.kind == ReadKind::kFrameNumber && entry.read.place == place) {
      return entry.read.value;
    }
  }
  return std::nullopt;
}

void copy_states(ComponentCore& core, const KeyFrame& frame) {
  if (core.states == nullptr) {
    return;
  }
  const auto& states = static_cast<DeclaredStates&>(*core.states).all();
  for (const ReplayedReads::Entry& entry : frame.reads) {
    if (entry.read.kind != ReadKind::kKeyFrame || entry.read.place >= states.size()) {
      continue;
    }
    const google::protobuf::Message& state = frame.state(entry.read);
    if (states[entry.read.place]->value->GetDescriptor() == state.GetDescriptor()) {
      states[entry.read.place]->value->CopyFrom(state);
    }
  }
}

void take_params(host::ApplicationHost& application, ComponentCore& core, ActivationRing& ring,
                 ReplayedReads& replayed, const KeyFrame& frame) {
  for (const ReplayedReads::Entry& entry : frame.reads) {
    if (entry.read.kind == ReadKind::kFrameParams) {
      const std::uint64_t transaction = find_number(frame, Number::kTransaction).value_or(0);
      config::Problems problems;
      application.put_recorded_params(core, transaction, entry.text, problems);
      core.repeat_next(frame.activation, replayed);
      static_cast<void>(core.repeat_posted(ring, Cause::kParameter, transaction));
    }
  }
}

}  // namespace

void begin_at_key_frame(host::ApplicationHost& application, ComponentCore& core,
                        ActivationRing& ring, ReplayedReads& replayed, const KeyFrame& frame) {
  const auto number = [&frame](Number place) { return find_number(frame, place).value_or(0); };
  replayed.begin({});
  copy_states(core, frame);
  core.is_wanted = true;
  if (const std::uint64_t began = number(Number::kTimersBegan); began > 0) {
    core.timers_began = base::from_ns(static_cast<std::int64_t>(began));
  }
  core.repeat_next(frame.activation, replayed);
  core.repeat(ring, {.cause = Cause::kMode,
                     .body = [&core] { core.begin_anew(); },
                     .key = to_key(LifeStep::kStart)});
  take_params(application, core, ring, replayed, frame);
  core.hand_over_stage();
  core.restarts = static_cast<std::uint32_t>(number(Number::kRestarts));
  core.first_restart_ns = static_cast<std::int64_t>(number(Number::kFirstRestart));
  core.restart_count = number(Number::kObjects);
  core.jobs_made = core.jobs_ended = number(Number::kJobs);
  core.params_asked = core.params_answered = number(Number::kParamsAsked);
}

}  // namespace fastcycle::detail
