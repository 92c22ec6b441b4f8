#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace fastcycle::tool {

/// A text that a command writes into a file on request: see `base::OutputFile`.
///
/// @threads  Confined to its owner.
class ReportFile {
 public:
  /// With an empty `path`, writing does nothing. `inputs` are never replaced.
  explicit ReportFile(std::filesystem::path path, std::vector<std::filesystem::path> inputs = {})
      : path_(std::move(path)), inputs_(std::move(inputs)) {}

  /// Checks whether the file can be written, without changing it. Returns why not, or nothing.
  [[nodiscard]] std::string find_obstacle() const;

  /// Writes `text`. Returns why that failed, or nothing.
  [[nodiscard]] std::string write(const std::string& text) const;

 private:
  const std::filesystem::path path_;
  const std::vector<std::filesystem::path> inputs_;
};

}  // namespace fastcycle::tool
