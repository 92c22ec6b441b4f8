#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "replay/replay_plan.h"

namespace fastcycle::tool {

/// What is replayed, as far as the command line says it.
struct ReplayingOptions {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> into;
  std::vector<std::string> topics;
  std::vector<std::string> except;
  std::vector<std::string> remap;
  std::optional<double> start_s;
  std::optional<double> end_s;
  bool is_looped = false;

  /// Who runs.
  void add_target_to(CLI::App& line);
  /// Which part of the recording, and how it is called.
  void add_selection_to(CLI::App& line);

  /// What is wrong with them, as a sentence; empty if nothing is.
  [[nodiscard]] std::string find_wrong() const;
  [[nodiscard]] host::ReplayOptions describe() const;
};

}  // namespace fastcycle::tool
