#pragma once

#include <filesystem>
#include <string>

namespace fastcycle::tool {

/// A file that appears complete or not at all: written beside its place and renamed.
///
/// @threads  Confined to its owner.
class ReportFile {
 public:
  /// An empty `path` is no file: writing it does nothing.
  explicit ReportFile(std::filesystem::path path) : path_(std::move(path)) {}

  /// Finds out whether it can be written, without changing it. Returns why not, or nothing.
  [[nodiscard]] std::string find_obstacle() const;

  /// Writes `text`. Returns why that failed, or nothing.
  [[nodiscard]] std::string write(const std::string& text) const;

 private:
  const std::filesystem::path path_;
};

}  // namespace fastcycle::tool
