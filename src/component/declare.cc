#include "component/declare.h"

#include <fmt/format.h>

#include "broker/activation_check.h"
#include "component/component_host.h"

namespace fastcycle::detail {

void assert_constructing(const ComponentCore& core, const char* call, std::string_view name) {
  if (!core.is_constructing) [[unlikely]] {
    broke_contract(core.publishing,
                   fmt::format("{} {}outside of its constructor", call,
                               name.empty() ? "" : fmt::format("\"{}\" ", name)),
                   "declare it there; only subscriptions may come later, in callbacks");
  }
}

PublisherCore& declare_publisher(ComponentCore& core, const std::string& topic,
                                 const google::protobuf::Message& default_instance,
                                 const google::protobuf::Message* prototype, bool is_external,
                                 std::optional<std::size_t> keep) {
  if (core.is_redeclaring) {
    return redeclare(core.declared.publishers, core.redeclared.publishers, topic, default_instance);
  }
  PublisherCore& publisher = core.application.wiring().topics().add_publisher(
      topic, core.publishing, default_instance, prototype, is_external, keep);
  core.declared.publishers.push_back(&publisher);
  return publisher;
}

CallbackSubscription& declare_subscription(ComponentCore& core, const std::string& topic,
                                           const google::protobuf::Message& default_instance,
                                           const SubscriberOptions& options,
                                           EnvelopeCallback callback) {
  if (core.is_redeclaring) {
    CallbackSubscription& subscription = redeclare(
        core.declared.subscriptions, core.redeclared.subscriptions, topic, default_instance,
        [](const auto& one) { return one.kind == Subscription::Kind::kCallback; });
    core.redeclare_subscription(subscription, options, std::move(callback));
    return subscription;
  }
  Topic& its_topic = core.application.wiring().topics().get(topic, core.name, default_instance);
  CallbackSubscription& subscription = core.subscribe(its_topic, options, std::move(callback));
  core.declared.subscriptions.push_back(&subscription);
  return subscription;
}

}  // namespace fastcycle::detail
