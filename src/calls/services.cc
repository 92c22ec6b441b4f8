#include "calls/services.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "calls/call_head.h"
#include "calls/client_core.h"
#include "calls/server_core.h"
#include "component/component_core.h"
#include "component/service_topics.h"
#include "config/nearest.h"

namespace fastcycle::host {
namespace {

using detail::ClientCore;
using detail::ComponentCore;
using detail::ServerCore;

class Connector {
 public:
  Connector(const Components& components, detail::Topics& topics,
            const std::set<std::string>* replayed, config::Problems& problems)
      : components_(components), topics_(topics), replayed_(replayed), problems_(problems) {}

  std::map<std::uint64_t, std::string> connect() {
    for (const auto& component : components_) {
      for (const auto& server : component->servers) {
        add(ServerCore::of(*server));
      }
    }
    if (replayed_ != nullptr) {
      for (const std::string& service : *replayed_) {
        names_[detail::service_id(service)] = service;
      }
    }
    for (const auto& component : components_) {
      for (const auto& client : component->clients) {
        check(*component, ClientCore::of(*client));
      }
    }
    for (const auto& [service, server] : servers_) {
      connect(*server);
    }
    return std::move(names_);
  }

 private:
  void add(ServerCore& server) {
    const auto [first, is_new] = servers_.emplace(server.service, &server);
    names_[server.id] = server.service;
    if (is_new) {
      return;
    }
    config::Problem problem;
    problem.place = server.core.description.place;
    problem.expected = "one server";
    problem.found = "\"" + first->second->core.name + "\" and \"" + server.core.name + "\"";
    problem.message = "service \"" + server.service + "\" has two servers, \"" +
                      first->second->core.name + "\" and \"" + server.core.name + "\"";
    problems_.add(std::move(problem));
  }

  void check(const ComponentCore& component, ClientCore& client) {
    // In a replay, another component of its name may stand where the server was.
    client.has_server = names_.contains(client.id);
    const auto server = servers_.find(client.service);
    if (server != servers_.end()) {
      check_kind(component, client, *server->second);
    }
    if (client.has_server) {
      return;
    }
    std::vector<std::string> known;
    for (const auto& [id, name] : names_) {
      known.push_back(name);
    }
    config::Problem problem =
        config::make_error(component.description.place,
                           "service \"" + client.service + "\", which component \"" +
                               component.name + "\" calls, is served by nobody",
                           config::did_you_mean(config::nearest(client.service, known)));
    problem.warning = true;
    problems_.add(std::move(problem));
  }

  void check_kind(const ComponentCore& component, const ClientCore& client,
                  const ServerCore& server) {
    const bool is_action = server.feedback_instance != nullptr;
    if (client.is_goal_client == is_action) {
      return;
    }
    const auto kind = [](bool action) { return action ? "an action" : "a service"; };
    config::Problem problem;
    problem.place = component.description.place;
    problem.expected = kind(is_action);
    problem.found = kind(client.is_goal_client);
    problem.message = "component \"" + component.name + "\" calls \"" + client.service + "\" as " +
                      problem.found + ", but component \"" + server.core.name + "\" serves it as " +
                      problem.expected;
    problems_.add(std::move(problem));
  }

  void connect(ServerCore& server) {
    server.listen(depth_for(server.service));
    // In a replay some of them stand in for those that called: they have no client of their own.
    for (const auto& requests : topics_.find(detail::request_topic(server.service))->publishers) {
      const std::string& caller = requests->owner.name;
      const auto publish = [&](const std::string& topic,
                               const google::protobuf::Message& type) -> detail::PublisherCore& {
        topics_.set_options(topic, detail::kReplyTopicOptions);
        detail::PublisherCore& publisher =
            topics_.add_publisher(topic, server.core.publishing, type, nullptr, false);
        server.core.service_publishers.push_back(&publisher);
        return publisher;
      };
      detail::PublisherCore& replies =
          publish(detail::reply_topic(server.service, caller), *server.reply_instance);
      detail::PublisherCore* feedback =
          server.feedback_instance == nullptr
              ? nullptr
              : &publish(detail::feedback_topic(server.service, caller), *server.feedback_instance);
      server.add_client(requests->id, replies, feedback);
    }
  }

  [[nodiscard]] std::size_t depth_for(const std::string& service) const {
    constexpr std::size_t kForStandIns = 256;  // Their requests are bounded by the recorded ones.
    std::size_t depth = replayed_ != nullptr ? kForStandIns : 1;
    for (const auto& component : components_) {
      for (const auto& client : component->clients) {
        if (client->service == service) {
          depth = std::max(depth, ClientCore::of(*client).lane_depth());
        }
      }
    }
    return depth;
  }

  const Components& components_;
  detail::Topics& topics_;
  const std::set<std::string>* const replayed_;
  config::Problems& problems_;
  std::map<std::string, ServerCore*> servers_;
  std::map<std::uint64_t, std::string> names_;
};

}  // namespace

std::map<std::uint64_t, std::string> connect_services(const Components& components,
                                                      detail::Topics& topics,
                                                      const std::set<std::string>* replayed,
                                                      config::Problems& problems) {
  return Connector(components, topics, replayed, problems).connect();
}

}  // namespace fastcycle::host
