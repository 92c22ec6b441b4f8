#pragma once

#include <filesystem>
#include <optional>

#include "config/description.h"

namespace fastcycle::tool {

/// What the command line says of a trace.
struct TracingOptions {
  std::filesystem::path file;

  /// Where the trace goes: as the application says, with what the option says laid upon it. None:
  /// nothing is traced.
  [[nodiscard]] std::optional<config::TraceDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
