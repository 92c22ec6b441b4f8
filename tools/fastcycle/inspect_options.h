#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "config/description.h"

namespace fastcycle::tool {

/// The options for access to a run by tools.
struct InspectOptions {
  bool is_asked = false;
  std::vector<std::string> allow;

  void add_to(CLI::App& line);
  /// An error message; empty if the options are valid. `is_live`: browsers have access.
  [[nodiscard]] std::string find_wrong(const config::ApplicationDescription& application,
                                       bool is_live) const;
  /// Whether tools have access.
  [[nodiscard]] bool is_wanted(const config::ApplicationDescription& application) const {
    return is_asked || application.inspect.has_value();
  }
  /// The permissions of tools: those of the application, and those that the options add.
  [[nodiscard]] config::InspectDescription describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
