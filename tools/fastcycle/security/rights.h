#pragma once

#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "dds_security/documents.h"

namespace fastcycle::tool {

/// What somebody may do in DDS, by the names of ROS 2.
struct RosRights {
  std::vector<std::string> publish;
  std::vector<std::string> subscribe;
  std::vector<std::string> serve;  ///< Services that it answers.
  std::vector<std::string> call;   ///< Services that it asks.
  std::vector<std::string> nodes;  ///< What each node of ROS 2 has: its log, params, clock.
};

/// What is wrong with the names; empty if nothing is.
[[nodiscard]] std::string mistake_of(const RosRights& rights);

/// Adds them, and what every participant that is a node of ROS 2 needs.
///
/// @pre  nothing is wrong with the names
void add(const RosRights& more, dds_security::Rights& rights);

/// What the gateway needs that `component` is: the topics and services that its params list, each
/// in its direction, in its domain.
[[nodiscard]] dds_security::Rights rights_of(const config::ComponentDescription& component,
                                             config::Problems& problems);

}  // namespace fastcycle::tool
