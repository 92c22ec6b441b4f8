#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "config/load.h"
#include "config/problem.h"
#include "host/application.h"
#include "loading/component_library.h"
#include "loading/trial.h"

namespace fastcycle::tool {

/// What every command that reads an application accepts.
struct Configuration {
  config::LoadOptions load;
  std::vector<std::filesystem::path> library_path;
  std::string load_timeout = "10s";
  bool is_verbose = false;  ///< Say which file each library is loaded from.

  void add_to(CLI::App& line);

  /// Whether the warnings of the trial are to be heard. A replay has publishers that a trial has
  /// not, and says itself what is published by nobody.
  enum class TrialWarnings { kHeard, kLeftOut };

  /// Reads the application and tries its libraries and components in a child process; `tried`, if
  /// it is given, is told what that found.
  [[nodiscard]] config::ApplicationDescription read(host::ConstructorFault on_throw,
                                                    config::Problems& problems,
                                                    TrialWarnings warnings = TrialWarnings::kHeard,
                                                    host::TrialResult* tried = nullptr) const;

  /// The application with its components made and connected, for commands that look at it: nothing
  /// of it is started. Null, and all mistakes printed, if it cannot be made.
  [[nodiscard]] std::unique_ptr<host::Application> make_unstarted() const;
};

/// Prints all mistakes and warnings to standard error, one a line.
void print(const config::Problems& problems);

/// "app.json: 3 errors, 1 warning"
[[nodiscard]] std::string summary(const config::Problems& problems, const std::string& file);

/// Prints all there is to say; whether the application may start. With mistakes, that nothing was
/// started is the last line.
[[nodiscard]] bool may_start(const config::Problems& problems, const std::string& file);

}  // namespace fastcycle::tool
