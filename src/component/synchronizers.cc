// Implements `Context::create_synchronizer`.

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "broker/activation_check.h"
#include "component/component_core.h"
#include "component/component_host.h"
#include "component/wiring.h"
#include "executor/synchronizer.h"
#include "fastcycle/synchronizer.h"

namespace fastcycle::detail {
namespace {

/// Reports errors of a synchronizer with its component's place, and corrects them, so that further
/// errors are found too.
SynchronizerOptions checked(ComponentCore& core, const std::vector<std::string>& names,
                            SynchronizerOptions options) {
  std::string head = "component \"" + core.name + "\": its synchronizer of";
  for (const std::string& name : names) {
    head += (&name == &names.front() ? " \"" : ", \"") + name + "\"";
  }
  const auto complain = [&](const std::string& what, const std::string& hint = {}) {
    core.problems->add(config::make_error(core.description.place, head + " " + what, hint));
  };
  if (std::set<std::string>(names.begin(), names.end()).size() < names.size()) {
    complain("names one topic twice");
  }
  if (options.depth == 0) {
    complain("has depth 0", "at least one message of each topic must be held");
    options.depth = 1;
  }
  const bool is_approximate = options.policy == SyncPolicy::kApproximate;
  if (is_approximate && options.max_difference <= Duration(0)) {
    complain("has no max_difference above zero",
             "SyncPolicy::kExact is for messages of equal times");
    options.max_difference = Duration(1);
  }
  if (!is_approximate && options.max_difference != Duration(0)) {
    complain("has a max_difference, which only SyncPolicy::kApproximate looks at");
  }
  return options;
}

void redeclare(ComponentCore& core, const std::vector<std::string>& names,
               std::span<const SynchronizedTopic> topics, EnvelopeSetCallback callback) {
  const auto complain = [&] {
    throw std::logic_error("a restarted component declares other synchronizers than before: \"" +
                           names.front() + "\"");
  };
  auto& again = core.redeclared.synchronizers;
  if (again.size() >= core.declared.synchronizers.size()) {
    complain();
  }
  Synchronizer& synchronizer = *core.declared.synchronizers[again.size()];
  if (synchronizer.input_count() != names.size()) {
    complain();
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto input = std::ranges::find(core.declared.subscriptions, &synchronizer.input(i));
    if (input == core.declared.subscriptions.end() ||
        synchronizer.input(i).topic.name != names[i] ||
        synchronizer.input(i).topic.type != topics[i].default_instance->GetTypeName()) {
      complain();
    }
    core.redeclared.subscriptions.push_back(*input);
  }
  again.push_back(&synchronizer);
  synchronizer.set_callback(std::move(callback));
}

}  // namespace

void create_synchronizer(ComponentCore& core, std::span<const SynchronizedTopic> topics,
                         const SynchronizerOptions& options, EnvelopeSetCallback callback) {
  if (!core.is_constructing) {
    broke_contract(core.publishing,
                   "create_synchronizer() for \"" + std::string(topics.front().name) +
                       "\" outside of its constructor",
                   "declare it there");
  }
  std::vector<std::string> names;
  for (const SynchronizedTopic& topic : topics) {
    names.push_back(core.declare_topic(topic.name));
  }
  if (core.is_redeclaring) {
    redeclare(core, names, topics, std::move(callback));
    return;
  }
  const SynchronizerOptions wanted = checked(core, names, options);
  std::vector<Topic*> known;
  std::vector<SubscriberOptions> queues;
  for (std::size_t i = 0; i < topics.size(); ++i) {
    known.push_back(
        &core.application.wiring().topics().get(names[i], core.name, *topics[i].default_instance));
    queues.push_back(
        core.subscriber_options(topics[i].name, {.depth = wanted.depth, .keep = wanted.depth}));
  }
  Synchronizer& synchronizer = core.synchronize(known, queues, wanted, std::move(callback));
  core.declared.synchronizers.push_back(&synchronizer);
  core.declared.subscriptions.insert(
      core.declared.subscriptions.end(),
      core.subscriptions.callbacks().end() - static_cast<std::ptrdiff_t>(topics.size()),
      core.subscriptions.callbacks().end());
}

}  // namespace fastcycle::detail
