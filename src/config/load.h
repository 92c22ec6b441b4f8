#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"

namespace fastcycle::config {

/// What the command line says about the configuration.
struct LoadOptions {
  std::filesystem::path file;
  std::vector<std::filesystem::path> overlays{};  ///< Merged in this order.
  std::vector<std::string> sets{};                ///< `component.param=value`, nested by more dots.
  std::vector<std::string> variables{};           ///< `name=value`.
  std::filesystem::path schema_file{};            ///< Empty: the schema that was built in.
};

/// Reads an application and all files it names, and checks everything that can be checked without
/// opening a library.
///
///     Problems problems;
///     const ApplicationDescription application = load({.file = "app.json"}, problems);
///     if (problems.has_errors()) { … }
///
/// Reports every mistake at once. With mistakes the description is as complete as it can be, which
/// is good for further checks, and must not be started.
///
/// @threads  Safe.
/// @errors   Everything goes to `problems`; nothing is thrown but `std::bad_alloc`.
[[nodiscard]] ApplicationDescription load(const LoadOptions& options, Problems& problems);

}  // namespace fastcycle::config
