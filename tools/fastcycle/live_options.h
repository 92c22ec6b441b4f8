#pragma once

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "config/description.h"

namespace fastcycle::tool {

/// The options of the server for browsers and Foxglove.
struct LiveOptions {
  bool is_asked = false;
  std::string at;  ///< ADDRESS:PORT, or a part of it; empty: the application's setting.

  void add_to(CLI::App& line);
  /// An error message; empty if the options are valid.
  [[nodiscard]] std::string find_wrong() const;
  /// The application's settings, overridden by the options. None: there is no server.
  [[nodiscard]] std::optional<config::LiveDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
