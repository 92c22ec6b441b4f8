#include "host/prepare_replay.h"

#include <utility>
#include <vector>

#include "host/application.h"
#include "replay/replay_plan.h"

namespace fastcycle::host {
namespace {

std::vector<Connection> find_connections(const config::ApplicationDescription& application,
                                         ComponentClasses& classes, config::Problems& problems) {
  Application whole(application, {.is_simulated = true, .workers = 1});
  whole.build(classes, problems, ConstructorFault::kFault);
  return connections_of(whole.components());
}

}  // namespace

std::unique_ptr<Replay> prepare_replay(ReplayOptions options,
                                       const config::ApplicationDescription& application,
                                       ComponentClasses& classes, config::Problems& problems) {
  return Replay::prepare(std::move(options), application, classes, find_connections, problems);
}

}  // namespace fastcycle::host
