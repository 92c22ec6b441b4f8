#include "component/declared_states.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "broker/publisher_core.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/declare.h"
#include "component/service_topics.h"

namespace fastcycle::detail {
namespace {

bool is_name(std::string_view name) {
  constexpr std::size_t kLongest = 64;
  return !name.empty() && name.size() <= kLongest && std::ranges::all_of(name, [](char letter) {
    return (letter >= 'a' && letter <= 'z') || (letter >= '0' && letter <= '9') || letter == '_';
  });
}

}  // namespace

std::string state_topic(std::string_view component, std::string_view state) {
  return fmt::format("{}{}state/{}", component, kServiceMark, state);
}

DeclaredStates::DeclaredStates(ComponentCore& core) : core_(core) {
  core.publishing.key_frames = this;
}

DeclaredStates::~DeclaredStates() {
  core_.publishing.key_frames = nullptr;
}

google::protobuf::Message& DeclaredStates::declare(
    std::string_view name, const google::protobuf::Message& default_instance,
    std::function<void(google::protobuf::Message&)> save) {
  const auto add_error = [&](const std::string& what) {
    core_.problems->add(config::make_error(
        core_.description.place,
        fmt::format("component \"{}\": state \"{}\" {}", core_.name, name, what)));
  };
  const auto found = std::ranges::find(all_, name, [](const auto& one) { return one->name; });
  if (found != all_.end()) {
    One& one = **found;
    if (one.value->GetDescriptor() != default_instance.GetDescriptor()) {
      const std::string what =
          fmt::format("state \"{}\" was a {}, and is declared as a {}", name,
                      one.value->GetTypeName(), default_instance.GetTypeName());
      if (core_.is_redeclaring) {
        throw std::logic_error(what);
      }
      add_error("is declared twice, with two types");
    } else if (!core_.is_redeclaring) {
      add_error("is declared twice");
    } else {
      static_cast<void>(
          declare_publisher(core_, one.publisher->topic.name, default_instance, nullptr, false));
      one.save = std::move(save);
    }
    return *one.value;
  }
  if (!is_name(name)) {
    add_error("is no name: expected 1 to 64 of a-z, 0-9 and _");
  }
  PublisherCore& publisher =
      declare_publisher(core_, state_topic(core_.name, name), default_instance, nullptr, false);
  all_.push_back(std::make_unique<One>(One{
      .name = std::string(name),
      .value = std::unique_ptr<google::protobuf::Message>(default_instance.New()),
      .publisher = &publisher,
      .save = std::move(save),
  }));
  return *all_.back()->value;
}

std::string DeclaredStates::why_none() const {
  if (!core_.clients.empty() || !core_.servers.empty()) {
    return "it calls or offers services";
  }
  if (!core_.declared.synchronizers.empty()) {
    return "it has synchronizers";
  }
  if (core_.random) {
    return "it uses random()";
  }
  return {};
}

/// Whether a key frame is to be written now: after a period, and once nothing is in progress that
/// the state does not contain.
bool DeclaredStates::is_due() {
  if (core_.publishing.replayed != nullptr) {
    return core_.publishing.replayed->has(ReadKind::kFrameNumber);
  }
  const std::int64_t now_ns = base::to_ns(core_.publishing.now);
  if (core_.publishing.reads == nullptr || now_ns < next_ns_ ||
      core_.state != ComponentCore::State::kActive) {
    return false;
  }
  const auto& callbacks = core_.subscriptions.callbacks();
  const bool has_late_subscription = std::ranges::any_of(callbacks, [&](const auto* its) {
    return !its->is_ended && std::ranges::find(core_.declared.subscriptions, its) ==
                                 core_.declared.subscriptions.end();
  });
  if (has_late_subscription || core_.jobs_made != core_.jobs_ended ||
      core_.params_asked != core_.params_answered || !why_none().empty()) {
    return false;
  }
  const std::int64_t period_ns = core_.application.description().state_period.count();
  if (period_ns == 0) {
    return false;
  }
  next_ns_ = now_ns - now_ns % period_ns + period_ns;
  return true;
}

void DeclaredStates::end_activation() {
  if (is_due()) {
    write();
  }
}

/// Has the object write its state down; if that fails, the message stays what it was.
void DeclaredStates::save(One& one) {
  if (!one.save) {
    return;
  }
  const std::unique_ptr<google::protobuf::Message> now(one.value->New());
  one.save(*now);
  one.value->GetReflection()->Swap(one.value.get(), now.get());
}

void DeclaredStates::end_object() noexcept {
  for (const auto& one : all_) {
    try {
      save(*one);
    } catch (...) {  // It has failed anyway, and reported it.
    }
    one->save = nullptr;
  }
}

void DeclaredStates::write() {
  const PublishingComponent& publishing = core_.publishing;
  for (std::uint32_t place = 0; place < all_.size(); ++place) {
    One& one = *all_[place];
    save(one);
    Envelope* const envelope = one.publisher->loan(false);
    envelope->own->CopyFrom(*one.value);
    one.publisher->publish(envelope, {});
    publishing.learned(ReadKind::kKeyFrame, one.publisher->id, one.publisher->published(), place);
  }
  for (const PublisherCore* publisher : core_.declared.publishers) {
    if (!publisher->options.is_external) {
      publishing.learned(ReadKind::kSequence, publisher->id, publisher->published());
    }
  }
  const auto& views = core_.subscriptions.views();
  for (std::uint32_t place = 0; place < views.size(); ++place) {
    for (const Envelope* envelope : views[place]->held) {
      publishing.learned(ReadKind::kHeld, envelope->info.publisher, envelope->info.sequence, place);
    }
  }
  const auto add = [&](FrameNumber place, std::uint64_t value) {
    publishing.learned(ReadKind::kFrameNumber, 0, value, place);
  };
  add(kTimersBegan,
      static_cast<std::uint64_t>(core_.timers_began ? base::to_ns(*core_.timers_began) : 0));
  add(kRestarts, core_.restarts);
  add(kFirstRestart, static_cast<std::uint64_t>(core_.first_restart_ns));
  add(kObjects, core_.restart_count);
  add(kJobs, core_.jobs_made);
  add(kParamsAsked, core_.params_asked);
  if (params_ != nullptr) {
    add(kTransaction, transaction_);
    publishing.learned(ReadKind::kFrameParams, params_->dump());
  }
}

void DeclaredStates::change_params(std::uint64_t transaction, std::string_view text) {
  transaction_ = transaction;
  nlohmann::ordered_json changed = nlohmann::ordered_json::parse(text, nullptr, false);
  if (!changed.is_object()) {
    return;
  }
  if (params_ == nullptr) {
    params_ = std::make_unique<nlohmann::ordered_json>(std::move(changed));
  } else {
    params_->update(changed);
  }
}

}  // namespace fastcycle::detail
