#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "config/problem.h"

namespace fastcycle::host {

class Application;

/// Brings servers and clients together, once all components were constructed and before topics are
/// connected. Returns the names of all services by their ids.
///
/// @errors  Two servers of one service, an action that is called as a service: mistakes. A client
///          without a server: a warning; its calls are answered `kAbsent`.
std::map<std::uint64_t, std::string> connect_services(Application& application,
                                                      config::Problems& problems);

}  // namespace fastcycle::host
