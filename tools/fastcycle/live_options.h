#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "config/description.h"

namespace fastcycle::tool {

/// What the command line says of the server for browsers and Foxglove.
struct LiveOptions {
  bool is_asked = false;
  std::string at;  ///< ADDRESS:PORT, or a part of it; empty: as the application says.

  void add_to(CLI::App& line);
  /// What is wrong with them, as a sentence; empty if nothing is.
  [[nodiscard]] std::string find_wrong() const;
  /// As the application says, with what the options say laid upon it. None: there is no server.
  [[nodiscard]] std::optional<config::LiveDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
