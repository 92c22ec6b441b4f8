#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace fastcycle::host {

/// The publishers and subscribers of an application, as its components declared them: plain values,
/// which a trial reports and from which the lanes between processes are planned.
struct ApplicationWiring {
  struct Publisher {
    std::string topic;
    std::string type;       ///< Of its messages, the full name.
    std::string component;  ///< The order of several on one topic is significant.
    std::size_t latched = 0;
    std::size_t credits = 0;   ///< Its window; 0: it uses none.
    bool is_external = false;  ///< A thread of the component publishes, not its callbacks.
  };
  struct Subscription {
    std::string topic;
    std::string type;
    std::string component;
    bool is_called = true;  ///< Its messages cause activations.
    bool drops_newest = false;
    std::size_t depth = 0;
    std::size_t keep = 0;
  };

  std::vector<Publisher> publishers;
  std::vector<Subscription> subscriptions;
  std::vector<std::string> services;   ///< Served by components.
  std::vector<std::string> recorders;  ///< Components that record all topics.
};

/// A wiring as one line of JSON, and back.
///
/// @errors  std::runtime_error if it has not the format of `to_text`.
[[nodiscard]] std::string to_text(const ApplicationWiring& wiring);
[[nodiscard]] ApplicationWiring wiring_from_text(const std::string& text);

}  // namespace fastcycle::host
