#pragma once

#include <memory>
#include <string>

#include "host/application.h"

namespace fastcycle::host {

/// The application of a bench: built from the JSON `application` and `classes`, for simulated time
/// and one worker. Not started.
///
/// @errors  std::runtime_error with all errors, each on a line.
[[nodiscard]] std::unique_ptr<Application> build_for_bench(const std::string& application,
                                                           ComponentClasses& classes);

}  // namespace fastcycle::host
