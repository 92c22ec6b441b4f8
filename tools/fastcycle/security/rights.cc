#include "security/rights.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "ros2/names.h"

namespace fastcycle::tool {
namespace {

using config::Value;
using dds_security::Rights;

std::string with_slash(const std::string& name) {
  return name.starts_with('/') ? name : "/" + name;
}

void add_server(const std::string& service, Rights& rights) {
  rights.subscribe.insert(ros2::dds_request_topic(service));
  rights.publish.insert(ros2::dds_reply_topic(service));
}

void add_client(const std::string& service, Rights& rights) {
  rights.publish.insert(ros2::dds_request_topic(service));
  rights.subscribe.insert(ros2::dds_reply_topic(service));
}

void add_param_services(const std::string& node, Rights& rights) {
  for (const char* const service :
       {"describe_parameters", "get_parameter_types", "get_parameters", "list_parameters",
        "set_parameters", "set_parameters_atomically"}) {
    add_server(with_slash(node) + "/" + service, rights);
  }
}

/// Whether it has no characters special in XML, or in name patterns.
bool is_plain(std::string_view name) {
  return name.find_first_of("<>&\"'*?[]\\ \t\r\n") == std::string_view::npos;
}

/// One entry of the list "topics" or "services".
class Entry {
 public:
  Entry(const Value& entry, config::Problems& problems) : entry_(entry), problems_(problems) {}

  [[nodiscard]] bool has(const char* key) const { return entry_.find(key) != nullptr; }

  /// Empty, with an error, if there is none.
  std::string text(const char* key) {
    const Value* const value = entry_.find(key);
    if (value == nullptr || !value->is_string() || value->as_string().empty()) {
      fail(key, "a text", value);
      return {};
    }
    if (!is_plain(value->as_string())) {
      fail(key, "a name without blanks and any of <>&\"'*?[]\\", value);
      return {};
    }
    return value->as_string();
  }
  std::string ros_name() {
    const std::string name = text("ros");
    if (!name.empty() && ros2::ros_name_error(name)) {
      fail("ros", "a name of ROS 2", entry_.find("ros"));
      return {};
    }
    return name.empty() ? name : with_slash(name);
  }
  /// None, with an error, if it is neither.
  std::optional<bool> is_in() {
    const std::string direction = text("direction");
    if (!direction.empty() && direction != "in" && direction != "out") {
      fail("direction", "in or out", entry_.find("direction"));
    }
    return direction == "in"    ? std::optional(true)
           : direction == "out" ? std::optional(false)
                                : std::nullopt;
  }

 private:
  void fail(const char* key, std::string expected, const Value* found) {
    problems_.add(
        found != nullptr
            ? config::unexpected(*found, std::move(expected))
            : config::unexpected(entry_, fmt::format("{} under \"{}\"", expected, key), "nothing"));
  }

  const Value& entry_;
  config::Problems& problems_;
};

/// The items of the list `key`; none, with an error, if it is not a list.
std::vector<const Value*> items_of(const Value& params, const char* key,
                                   config::Problems& problems) {
  std::vector<const Value*> items;
  const Value* const list = params.find(key);
  if (list == nullptr) {
    return items;
  }
  if (!list->is_array()) {
    problems.add(config::unexpected(*list, "a list"));
    return items;
  }
  for (const Value& item : list->items()) {
    items.push_back(&item);
  }
  return items;
}

}  // namespace

std::string error_of(const RosRights& rights) {
  for (const auto* const names :
       {&rights.publish, &rights.subscribe, &rights.serve, &rights.call, &rights.nodes}) {
    for (const std::string& name : *names) {
      if (const auto error = ros2::ros_name_error(name)) {
        return fmt::format("\"{}\" is not a valid ROS 2 name: {}", name, *error);
      }
    }
  }
  return {};
}

void add(const RosRights& more, Rights& rights) {
  rights.publish.insert("ros_discovery_info");
  rights.subscribe.insert("ros_discovery_info");
  for (const std::string& topic : more.publish) {
    rights.publish.insert(ros2::dds_topic(with_slash(topic)));
  }
  for (const std::string& topic : more.subscribe) {
    rights.subscribe.insert(ros2::dds_topic(with_slash(topic)));
  }
  for (const std::string& service : more.serve) {
    add_server(with_slash(service), rights);
  }
  for (const std::string& service : more.call) {
    add_client(with_slash(service), rights);
  }
  for (const std::string& node : more.nodes) {
    rights.publish.insert({"rt/rosout", "rt/parameter_events"});
    rights.subscribe.insert({"rt/parameter_events", "rt/clock"});
    add_param_services(node, rights);
    add_server(with_slash(node) + "/get_type_description", rights);
  }
}

Rights rights_of(const config::ComponentDescription& component, config::Problems& problems) {
  Rights rights;
  const Value& params = component.params;
  if (const Value* const domain = params.find("domain")) {
    if (domain->type() != Value::Type::kInt || domain->as_int64() < 0 ||
        domain->as_int64() > dds_security::kDomainMax) {
      problems.add(config::unexpected(
          *domain, fmt::format("a whole number from 0 to {}, as secured domains have",
                               dds_security::kDomainMax)));
    } else {
      rights.domain = static_cast<std::uint32_t>(domain->as_int64());
    }
  }
  for (const Value* const item : items_of(params, "topics", problems)) {
    Entry entry(*item, problems);
    const auto is_in = entry.is_in();
    std::string topic;
    if (entry.has("ros") || entry.has("type")) {
      const std::string name = entry.ros_name();
      topic = name.empty() ? "" : ros2::dds_topic(name);
    } else {
      const std::string name = entry.text("topic");
      topic = name.empty() ? "" : "fastcycle/" + name;
      rights.publish.insert("fastcycle_clocks");  // How far apart the clocks of both are.
      rights.subscribe.insert("fastcycle_clocks");
    }
    if (is_in && !topic.empty()) {
      (*is_in ? rights.subscribe : rights.publish).insert(topic);
    }
  }
  for (const Value* const item : items_of(params, "services", problems)) {
    Entry entry(*item, problems);
    const auto is_in = entry.is_in();
    const std::string service = entry.ros_name();
    if (is_in && !service.empty()) {
      *is_in ? add_server(service, rights) : add_client(service, rights);
    }
  }
  if (!items_of(params, "parameters", problems).empty()) {
    const Value* const node = params.find("node");
    const std::string name =
        node != nullptr && node->is_string() ? node->as_string() : "fastcycle_gateway";
    if (ros2::ros_name_error(name)) {
      problems.add(config::unexpected(*node, "a name of ROS 2"));
    } else {
      add_param_services(name, rights);
    }
  }
  const Value* const clock = params.find("clock_period_ms");
  if (clock != nullptr && clock->is_number() && clock->as_double() > 0.0) {
    rights.publish.insert("rt/clock");
  }
  add({}, rights);
  return rights;
}

}  // namespace fastcycle::tool
