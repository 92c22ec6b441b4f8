#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"

namespace fastcycle::tool {

/// The options for recording an application.
struct RecordingOptions {
  bool is_asked = false;  ///< The command records, even without a file name.
  std::filesystem::path file;
  std::vector<std::string> topics;
  std::vector<std::string> except;
  std::string compression;
  std::optional<double> split_mb;
  std::optional<double> split_s;

  /// Whether an option other than the request to record was given.
  [[nodiscard]] bool has_settings() const;
  /// An error message; empty if the options are valid.
  [[nodiscard]] std::string find_wrong() const;
  /// The application's settings, overridden by the options. None: nothing is recorded.
  [[nodiscard]] std::optional<config::RecordDescription> describe(
      const config::ApplicationDescription& application) const;
};

/// `NAME_DATE_TIME.mcap`: unique among runs started at least a second apart.
[[nodiscard]] std::filesystem::path name_by_time(const std::string& application);

}  // namespace fastcycle::tool
