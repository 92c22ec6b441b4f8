#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::config {

/// What the command line says about the configuration.
struct LoadOptions {
  std::filesystem::path file;
  std::vector<std::filesystem::path> overlays{};  ///< Merged in this order.
  std::vector<std::string> sets{};                ///< `component.param=value`, nested by more dots.
  std::vector<std::string> variables{};           ///< `name=value`.
  std::filesystem::path schema_file{};            ///< Empty: the schema that was built in.
};

}  // namespace fastcycle::config
