// The functions of `Context` for services and actions.

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calls/client_core.h"
#include "calls/server_core.h"
#include "component/component_core.h"
#include "component/declare.h"
#include "fastcycle/service.h"

namespace fastcycle::detail {
namespace {

/// Adds an error unless a service or an action may have messages of `type`.
void check_call_type(ComponentCore& core, const std::string& service,
                     const google::protobuf::Message* type) {
  if (type == nullptr) {
    return;
  }
  for (int number = kFirstHeadField; number <= kLastHeadField; ++number) {
    if (type->GetDescriptor()->FindFieldByNumber(number) != nullptr) {
      core.problems->add(config::make_error(
          core.description.place, "service \"" + service + "\" of component \"" + core.name +
                                      "\": the message " + type->GetTypeName() + " has a field " +
                                      std::to_string(number) + "; calls use the numbers " +
                                      std::to_string(kFirstHeadField) + " to " +
                                      std::to_string(kLastHeadField) + " themselves"));
      return;
    }
  }
}

/// That of `declared` whose name is `service`, or null.
template <typename Core>
Core* find_service(const std::vector<std::unique_ptr<ServiceEnd>>& declared,
                   const std::string& service) {
  const auto found =
      std::ranges::find_if(declared, [&](const auto& end) { return end->service == service; });
  return found == declared.end() ? nullptr : &Core::of(**found);
}

}  // namespace

ClientCore& create_client(ComponentCore& core, std::string_view name,
                          const google::protobuf::Message& request,
                          const google::protobuf::Message& reply,
                          const google::protobuf::Message* feedback, std::size_t max_open) {
  assert_constructing(core, "create_client() for", name);
  const std::string service = core.declare_topic(name);
  for (const auto* type : {&request, &reply, feedback}) {
    check_call_type(core, service, type);
  }
  ClientCore* client = find_service<ClientCore>(core.clients, service);
  if (client != nullptr && client->is_declared) {
    client->check_types(*core.problems, request, reply, feedback);
    return *client;
  }
  if (client == nullptr) {
    core.clients.push_back(std::make_unique<ClientCore>(core, service, max_open));
    client = &ClientCore::of(*core.clients.back());
  }
  client->declare(request, reply, feedback);
  return *client;
}

ServerCore& create_server(ComponentCore& core, std::string_view name, ServerSpec spec) {
  assert_constructing(core, "create_service() for", name);
  const std::string service = core.declare_topic(name);
  for (const auto* type : {&spec.request, &spec.reply, spec.feedback}) {
    check_call_type(core, service, type);
  }
  ServerCore* server = find_service<ServerCore>(core.servers, service);
  if (server == nullptr || server->is_declared) {
    if (core.is_redeclaring) {
      throw std::logic_error("a restarted component serves others than before: \"" + service +
                             "\"");
    }
    const std::size_t depth =
        core.subscriber_options(name, {.depth = spec.depth}).depth.value_or(spec.depth);
    core.servers.push_back(std::make_unique<ServerCore>(core, service, depth));
    server = &ServerCore::of(*core.servers.back());
  }
  server->declare(std::move(spec));
  return *server;
}

}  // namespace fastcycle::detail
