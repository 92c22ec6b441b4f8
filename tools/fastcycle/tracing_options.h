#pragma once

#include <filesystem>
#include <optional>

#include "config/description.h"

namespace fastcycle::tool {

/// The options for tracing.
struct TracingOptions {
  std::filesystem::path file;

  /// The application's settings, overridden by the option. None: nothing is traced.
  [[nodiscard]] std::optional<config::TraceDescription> describe(
      const config::ApplicationDescription& application) const;
};

}  // namespace fastcycle::tool
