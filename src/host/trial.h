#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "config/load.h"
#include "config/problem.h"
#include "host/application.h"

namespace fastcycle::host {

/// What is tried, as the command line gave it.
struct TrialOptions {
  config::LoadOptions load;
  std::vector<std::filesystem::path> library_path;
  ConstructorFault on_throw = ConstructorFault::kFault;
  /// How long one library may load, or one component construct.
  std::chrono::milliseconds limit{10'000};
};

/// Loads all libraries and constructs all components in a child process, and adds to `problems`
/// what went wrong there, also what ended or hung the child: a library that aborts, exits or never
/// returns is a named mistake of the application, not the end of the host.
///
/// After a library ended the child, another child goes on without it, so that every mistake shows.
/// Processes that a library started in the child end with it, unless they left its process group.
///
/// @threads  Safe; the calling process may have other threads.
/// @errors   Everything goes to `problems`.
void try_application(const TrialOptions& options, config::Problems& problems);

/// The child's part: the body of the helper program `fastcycle-trial`.
int run_trial_child(int argument_count, char** arguments);

}  // namespace fastcycle::host
