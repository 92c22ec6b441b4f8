#pragma once

// What the host itself declares for a component: topics by their full names, whatever the file says
// of names in the component's code.

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "component/component_core.h"
#include "executor/actor.h"

namespace fastcycle::detail {

/// Breaks the contract if the component is not being constructed: `call` declares `name`.
void assert_constructing(const ComponentCore& core, const char* call, std::string_view name = {});

PublisherCore& declare_publisher(ComponentCore& core, const std::string& topic,
                                 const google::protobuf::Message& default_instance,
                                 const google::protobuf::Message* prototype, bool is_external,
                                 std::optional<std::size_t> keep = {});
CallbackSubscription& declare_subscription(ComponentCore& core, const std::string& topic,
                                           const google::protobuf::Message& default_instance,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback callback);

/// The next of what a restarted component declares again; it must be what it was.
template <typename T>
T& redeclare(std::vector<T*>& first, std::vector<T*>& again, const std::string& topic) {
  if (again.size() >= first.size() || first[again.size()]->topic.name != topic) {
    throw std::logic_error("a restarted component declares other topics than before: \"" + topic +
                           "\"");
  }
  again.push_back(first[again.size()]);
  return *again.back();
}

}  // namespace fastcycle::detail
