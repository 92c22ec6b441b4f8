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

/// The options of every command that reads an application.
struct Configuration {
  config::LoadOptions load;
  std::vector<std::filesystem::path> library_path;
  std::string load_timeout = "10s";
  bool is_verbose = false;  ///< Print the file from which each library is loaded.

  void add_to(CLI::App& line);

  /// Whether the warnings of the trial are reported. A replay has publishers that a trial has not,
  /// and itself reports topics without a publisher.
  enum class TrialWarnings { kReported, kLeftOut };

  /// Reads the application and tries its libraries and components in a child process, which sets
  /// `tried` if it is given.
  [[nodiscard]] config::ApplicationDescription read(
      host::ConstructorFault on_throw, config::Problems& problems,
      TrialWarnings warnings = TrialWarnings::kReported, host::TrialResult* tried = nullptr) const;

  /// The application with its components constructed and connected but not started, for commands
  /// that inspect it. Null, with all errors printed, if it cannot be built.
  [[nodiscard]] std::unique_ptr<host::Application> make_unstarted() const;
};

/// Prints all errors and warnings to standard error, one a line.
void print(const config::Problems& problems);

/// "app.json: 3 errors, 1 warning"
[[nodiscard]] std::string summary(const config::Problems& problems, const std::string& file);

/// Prints all problems and returns whether the application may start. After errors the last line
/// states that nothing was started.
[[nodiscard]] bool may_start(const config::Problems& problems, const std::string& file);

}  // namespace fastcycle::tool
