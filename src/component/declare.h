#pragma once

// Declarations that the host makes for a component: topics by their full names, independent of the
// file's remaps.

#include <algorithm>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <google/protobuf/message.h>

#include "component/component_core.h"
#include "executor/actor.h"

namespace fastcycle::detail {

/// Ends the process unless the component is being constructed: `call` declares `name`.
void assert_constructing(const ComponentCore& core, const char* call, std::string_view name = {});

PublisherCore& declare_publisher(ComponentCore& core, const std::string& topic,
                                 const google::protobuf::Message& default_instance,
                                 const google::protobuf::Message* prototype, bool is_external,
                                 std::optional<std::size_t> keep = {});
CallbackSubscription& declare_subscription(ComponentCore& core, const std::string& topic,
                                           const google::protobuf::Message& default_instance,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback callback);

/// For a component that is reconstructed: the first of that topic which it has not declared again
/// yet, and for which `is_such` holds. It must be of the same type.
template <typename T, typename IsSuch>
T& redeclare(std::vector<T*>& first, std::vector<T*>& again, const std::string& topic,
             const google::protobuf::Message& default_instance, const IsSuch& is_such) {
  const auto found = std::ranges::find_if(first, [&](const T* one) {
    return one->topic.name == topic && is_such(*one) &&
           std::ranges::find(again, one) == again.end();
  });
  if (found == first.end()) {
    throw std::logic_error("a component that is made anew declares other topics than before: \"" +
                           topic + "\"");
  }
  const std::string type(default_instance.GetTypeName());
  if ((*found)->topic.type != type) {
    throw std::logic_error("a component that is made anew declares \"" + topic + "\" as a " + type +
                           ", which was a " + (*found)->topic.type);
  }
  again.push_back(*found);
  return *again.back();
}
template <typename T>
T& redeclare(std::vector<T*>& first, std::vector<T*>& again, const std::string& topic,
             const google::protobuf::Message& default_instance) {
  return redeclare(first, again, topic, default_instance, [](const T&) { return true; });
}

}  // namespace fastcycle::detail
