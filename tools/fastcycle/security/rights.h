#pragma once

#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "dds_security/documents.h"

namespace fastcycle::tool {

/// The rights of a participant in DDS, by the names of ROS 2.
struct RosRights {
  std::vector<std::string> publish;
  std::vector<std::string> subscribe;
  std::vector<std::string> serve;  ///< Services that it provides.
  std::vector<std::string> call;   ///< Services that it calls.
  std::vector<std::string> nodes;  ///< Nodes of ROS 2, each with its log, params and clock.
};

/// An error message; empty if the names are valid.
[[nodiscard]] std::string error_of(const RosRights& rights);

/// Adds them, and the rights that every participant that is a node of ROS 2 needs.
///
/// @pre  the names are valid
void add(const RosRights& more, dds_security::Rights& rights);

/// The rights that the gateway `component` needs: for the topics and services in its params, each
/// in its direction, in its domain.
[[nodiscard]] dds_security::Rights rights_of(const config::ComponentDescription& component,
                                             config::Problems& problems);

}  // namespace fastcycle::tool
