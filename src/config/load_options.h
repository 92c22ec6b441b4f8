#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::config {

/// What the command line says about the configuration.
struct LoadOptions {
  std::filesystem::path file;
  /// What the file says, in place of its contents: it is not opened, and only names the place where
  /// relative paths begin.
  std::optional<std::string> text = {};
  std::vector<std::filesystem::path> overlays{};  ///< Merged in this order.
  std::vector<std::string> sets{};                ///< `component.param=value`, nested by more dots.
  std::vector<std::string> variables{};           ///< `name=value`.
  /// Components that get a process of their own, unless they name one: full names, patterns of them
  /// (`base::matches`), or `all`.
  std::vector<std::string> isolated{};
  std::filesystem::path schema_file{};  ///< Empty: the schema that was built in.
};

}  // namespace fastcycle::config
