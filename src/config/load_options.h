#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::config {

/// The configuration options of the command line.
struct LoadOptions {
  std::filesystem::path file;
  /// Replaces the file's contents: it is not opened, and only its folder is used for relative
  /// paths.
  std::optional<std::string> text = {};
  std::vector<std::filesystem::path> overlays{};  ///< Merged in this order.
  std::vector<std::string> sets{};                ///< `component.param=value`, nested by more dots.
  std::vector<std::string> variables{};           ///< `name=value`.
  /// Components that run in a process of their own, unless they name one: full names, patterns of
  /// them (`base::matches`), or `all`.
  std::vector<std::string> isolated{};
  std::filesystem::path schema_file{};  ///< Empty: the schema that was built in.
};

}  // namespace fastcycle::config
