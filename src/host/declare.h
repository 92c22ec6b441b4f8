#pragma once

// What the host itself declares for a component: topics by their full names, whatever the file says
// of names in the component's code.

#include <string>

#include "executor/actor.h"
#include "host/component_core.h"

namespace fastcycle::detail {

PublisherCore& declare_publisher(ComponentCore& core, const std::string& topic,
                                 const google::protobuf::Message& default_instance,
                                 const google::protobuf::Message* prototype, bool is_external);
CallbackSubscription& declare_subscription(ComponentCore& core, const std::string& topic,
                                           const google::protobuf::Message& default_instance,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback callback);

}  // namespace fastcycle::detail
