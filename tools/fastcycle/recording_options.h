#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"

namespace fastcycle::tool {

/// How an application is recorded, as far as the command line says it.
struct RecordingOptions {
  bool is_asked = false;  ///< The command is one that records, also without a file's name.
  std::filesystem::path file;
  std::vector<std::string> topics;
  std::vector<std::string> except;
  std::string compression;
  std::optional<double> split_mb;
  std::optional<double> split_s;

  /// Whether more is said than that something is recorded.
  [[nodiscard]] bool say_how() const;
  /// What is wrong with them, as a sentence; empty if nothing is.
  [[nodiscard]] std::string find_wrong() const;
  /// What is recorded: as the application says, with what the options say laid upon it. None:
  /// nothing.
  [[nodiscard]] std::optional<config::RecordDescription> describe(
      const config::ApplicationDescription& application) const;
};

/// `NAME_DATE_TIME.mcap`: a name that no run at another second has.
[[nodiscard]] std::filesystem::path name_by_time(const std::string& application);

}  // namespace fastcycle::tool
