#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host/application.h"
#include "host/status.h"
#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// A declared service; constant once the application is built.
struct KnownService {
  std::string name;
  std::string component;
  const google::protobuf::Message* request = nullptr;
  const google::protobuf::Message* reply = nullptr;
  const google::protobuf::Message* feedback = nullptr;  ///< Null if it is no action.
  std::vector<std::string> clients;
};

/// The services of a built application. Control thread.
[[nodiscard]] std::vector<KnownService> find_services(const host::Application& application);

void fill_application(const host::Application& application, protocol::Overview& overview);
void fill_executors(const host::Application& application, protocol::Overview& overview);
/// `news` is the last report of each component. `with_buckets` adds the buckets of histograms.
void fill_components(const host::Application& application,
                     const std::vector<host::ComponentNews>& news, bool with_buckets,
                     protocol::Overview& overview);

/// A snapshot of a topic: its pointers are valid as long as the application exists.
struct SeenTopic {
  const detail::Topic* topic = nullptr;
  std::string type;
  std::vector<const detail::PublisherCore*> publishers;
  std::vector<const detail::Subscription*> subscriptions;
};

/// The current topics; holds the application's lock only for this.
[[nodiscard]] std::vector<SeenTopic> see_topics(const host::Application& application);
/// Includes subscribers in other processes, from `news`.
void fill_topic(const host::Application& application, const SeenTopic& seen,
                const std::vector<host::ComponentNews>& news, bool with_buckets,
                protocol::Topic& topic);
void fill_service(const KnownService& service, bool with_schemas, protocol::Service& said);

}  // namespace fastcycle::inspect
