#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/description.h"

namespace fastcycle::tool {

/// What the command line says of who may look at a run.
struct InspectOptions {
  bool is_asked = false;
  std::vector<std::string> allow;

  void add_to(CLI::App& line);
  /// What is wrong with them, as a sentence; empty if nothing is.
  [[nodiscard]] std::string find_wrong(const config::ApplicationDescription& application) const;
  /// What may be done: as the application says, and what the options allow beyond that. None:
  /// nobody may look.
  [[nodiscard]] std::optional<config::InspectDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
