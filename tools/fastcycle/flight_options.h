#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "config/description.h"

namespace fastcycle::tool {

/// What the command line says of the flight recorder.
struct FlightOptions {
  std::filesystem::path file;
  std::optional<double> size_mb;

  /// What is wrong with them, as a sentence; empty if nothing is.
  [[nodiscard]] std::string find_wrong(const config::ApplicationDescription& application) const;
  /// What is kept: as the application says, with what the options say laid upon it. None: there is
  /// no flight recorder.
  [[nodiscard]] std::optional<config::FlightRecorderDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
