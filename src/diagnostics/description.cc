#include "diagnostics/description.h"

#include "broker/topics.h"
#include "executor/actor.h"

namespace fastcycle::diagnostics {

void describe_call(const detail::RunningActivation& running, TextBuffer& text) noexcept {
  if (const char* call = running.call.load(std::memory_order_relaxed)) {
    text << call;
    if (running.detail != nullptr) {
      text << " \"" << Foreign{running.detail} << "\"";
    }
  } else if (running.subscription != nullptr) {
    text << "its callback for \"" << running.subscription->topic.name << "\"";
  } else if (running.timer != nullptr) {
    const detail::TimerRole& role = running.timer->role;
    if (role.name.empty()) {
      text << "its timer " << running.timer->number;
    } else {
      text << role.label;
    }
  } else if (running.record != nullptr) {
    text << "an activation by cause " << detail::to_word(running.record->cause);
  } else {
    text << "?";
  }
}

void describe_cause(const detail::RunningActivation& running, TextBuffer& text) noexcept {
  const detail::ActivationRecord* const record = running.record;
  if (record == nullptr || running.call.load(std::memory_order_relaxed) != nullptr) {
    return;
  }
  const Span late{record->time_ns - record->cause_ns};
  if (running.subscription != nullptr) {
    const detail::Topic& topic = running.subscription->topic;
    text << "message " << record->key << " of \"" << topic.name << "\"";
    for (const auto& publisher : topic.publishers) {
      if (publisher->id == record->publisher) {
        text << " from \"" << publisher->owner.name << "\"";
      }
    }
    text << ", published " << late << " before the callback";
  } else if (running.timer != nullptr) {
    text << "tick that was due " << late << " before the callback, " << record->skipped
         << " skipped";
  }
}

}  // namespace fastcycle::diagnostics
