#pragma once

#include "config/problem.h"

namespace fastcycle::host {

class Application;

/// Finds subscriptions whose queues are smaller than the credits of their topics.
void check_credits(Application& application, config::Problems& problems);

}  // namespace fastcycle::host
