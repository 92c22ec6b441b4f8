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
  /// What is wrong with them, as a sentence; empty if nothing is. `is_live`: browsers may look.
  [[nodiscard]] std::string find_wrong(const config::ApplicationDescription& application,
                                       bool is_live) const;
  /// Whether tools may look.
  [[nodiscard]] bool is_wanted(const config::ApplicationDescription& application) const {
    return is_asked || application.inspect.has_value();
  }
  /// What may be done by those who may look: as the application says, and what the options allow
  /// beyond that.
  [[nodiscard]] config::InspectDescription describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
