#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "config/description.h"

namespace fastcycle::tool {

/// The options of the flight recorder.
struct FlightOptions {
  std::filesystem::path file;
  std::optional<double> size_mb;

  /// An error message; empty if the options are valid.
  [[nodiscard]] std::string find_wrong(const config::ApplicationDescription& application) const;
  /// The application's settings, overridden by the options. None: there is no flight recorder.
  [[nodiscard]] std::optional<config::FlightRecorderDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
