#pragma once

#include <memory>
#include <string>

#include "host/application.h"

namespace fastcycle::host {

/// The application of a bench: what `application` says, as JSON, is built of `classes`, for
/// simulated time and one worker. It was not started.
///
/// @errors  std::runtime_error with every mistake, each on a line.
[[nodiscard]] std::unique_ptr<Application> build_for_bench(const std::string& application,
                                                           ComponentClasses& classes);

}  // namespace fastcycle::host
