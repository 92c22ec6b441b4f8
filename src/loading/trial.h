#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"
#include "config/load.h"
#include "config/problem.h"
#include "loading/component_classes.h"
#include "loading/component_library.h"

namespace fastcycle::host {

/// A library whose class is to replace that of a running component.
struct TriedLibrary {
  std::string name;  ///< Its name in messages.
  std::filesystem::path file;
  std::vector<std::string> others;  ///< The libraries that the application has loaded.
};

/// Input of a trial, from the command line.
struct TrialOptions {
  config::LoadOptions load;
  std::vector<std::filesystem::path> library_path;
  ConstructorFault on_throw = ConstructorFault::kFault;
  /// Time limit for loading one library or constructing one component.
  std::chrono::milliseconds limit{10'000};
  /// The class of all components is in this library, and the application as a whole is not checked.
  std::optional<TriedLibrary> library = {};
  /// Called once for each step that takes longer than `kNotice`, with a sentence about it.
  std::function<void(const std::string& sentence)> on_slow = [](const std::string&) {};
  static constexpr std::chrono::milliseconds kNotice{900};
};

/// Result of a trial.
struct TrialResult {
  LibraryFiles files;  ///< Identity of the library files, for `LibraryLoader::expect`.
  std::string wiring;  ///< `ApplicationWiring` as text; empty if it could not be built.
  std::string sha256;  ///< Of `TrialOptions::library`.
};

/// Loads all libraries and constructs all components in a child process, and adds the errors to
/// `problems`, also those that end or hang the child: a library that aborts, exits or never returns
/// is reported as an error of the application and does not end the host.
///
/// If a library ends the child, another child continues without it, so that every error is found.
/// Processes that a library started in the child end with it, unless they left its process group.
///
/// @threads  Safe; the calling process may have other threads.
/// @errors   Everything goes to `problems`.
TrialResult try_application(const TrialOptions& options, config::Problems& problems);

/// Constructs the one component of the application of `options`, of the class that it names in
/// `options.library`, in a child process.
///
/// @threads  As `try_application`.
/// @errors   Everything goes to `problems`.
TrialResult try_library(const TrialOptions& options, config::Problems& problems);

/// An application constructed in a trial: `kept` keeps its components, whose destructors are not
/// called there.
struct BuiltForTrial {
  std::shared_ptr<void> kept;
  std::string wiring = {};  ///< For `TrialResult`.
};

/// Constructs all components of an application, as a run does, but starts none. Calls
/// `before_construct` with each name before its constructor. `is_part`: does not check the
/// application as a whole.
using BuildForTrial = std::function<BuiltForTrial(
    config::ApplicationDescription description, ComponentClasses& classes,
    ConstructorFault on_throw, bool is_part,
    const std::function<void(const std::string& component)>& before_construct,
    config::Problems& problems)>;

/// The body of the helper program `fastcycle-trial`, the child. It protects its memory as a run
/// does (`loading/protection.h`) before it loads anything; if the parent is protected, it refuses
/// to continue while traced.
int run_trial_child(const BuildForTrial& build);

}  // namespace fastcycle::host
