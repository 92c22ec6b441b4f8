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
  std::string name;  ///< As people call it.
  std::filesystem::path file;
  std::vector<std::string> others;  ///< The libraries that the application has loaded.
};

/// What is tried, as the command line gave it.
struct TrialOptions {
  config::LoadOptions load;
  std::vector<std::filesystem::path> library_path;
  ConstructorFault on_throw = ConstructorFault::kFault;
  /// How long one library may load, or one component construct.
  std::chrono::milliseconds limit{10'000};
  /// The class of all components is of this library, and nobody looks at what they make as a whole.
  std::optional<TriedLibrary> library = {};
  /// Called, once for each, with the sentence for what takes longer than `kNotice`.
  std::function<void(const std::string& sentence)> on_slow = [](const std::string&) {};
  static constexpr std::chrono::milliseconds kNotice{900};
};

/// What a trial found out.
struct TrialResult {
  LibraryFiles files;  ///< Which files the libraries were, for `LibraryLoader::expect`.
  std::string wiring;  ///< `ApplicationWiring` as text; empty if it could not be built.
  std::string sha256;  ///< Of `TrialOptions::library`.
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
TrialResult try_application(const TrialOptions& options, config::Problems& problems);

/// Constructs the one component of the application of `options`, of the class that it names in
/// `options.library`, in a child process.
///
/// @threads  As `try_application`.
/// @errors   Everything goes to `problems`.
TrialResult try_library(const TrialOptions& options, config::Problems& problems);

/// An application that was constructed, in a trial: `kept` keeps its components, whose destructors
/// are not called there.
struct BuiltForTrial {
  std::shared_ptr<void> kept;
  std::string wiring = {};  ///< For `TrialResult`.
};

/// Constructs all components of an application, as a run does, and starts none. Calls
/// `before_construct` with the name of each before its constructor. `is_part`: what they make as a
/// whole is not looked at.
using BuildForTrial = std::function<BuiltForTrial(
    config::ApplicationDescription description, ComponentClasses& classes,
    ConstructorFault on_throw, bool is_part,
    const std::function<void(const std::string& component)>& before_construct,
    config::Problems& problems)>;

/// The child's part: the body of the helper program `fastcycle-trial`. Its memory is protected as
/// that of a run is (`loading/protection.h`) before it loads anything; where the parent is
/// protected, it does not go on if it is traced.
int run_trial_child(const BuildForTrial& build);

}  // namespace fastcycle::host
