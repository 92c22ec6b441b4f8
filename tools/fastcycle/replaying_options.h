#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "replay/replay_plan.h"

namespace fastcycle::tool {

/// The options for replaying a recording.
struct ReplayingOptions {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> into;
  std::vector<std::string> topics;
  std::vector<std::string> except;
  std::vector<std::string> remap;
  std::optional<double> start_s;
  std::optional<double> end_s;
  bool is_looped = false;

  /// Adds the options that select the target components.
  void add_target_to(CLI::App& line);
  /// Adds the options that select a part of the recording, and rename its topics.
  void add_selection_to(CLI::App& line);

  /// An error message; empty if the options are valid.
  [[nodiscard]] std::string find_wrong() const;
  [[nodiscard]] host::ReplayOptions describe() const;
};

}  // namespace fastcycle::tool
