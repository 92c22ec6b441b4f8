#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "mcap/file.h"

namespace fastcycle::archive {

/// A file that appears under its name only when it is complete.
///
///     OutputFile file("drive.mcap", {.inputs = inputs});
///     mcap::Writer writer(file.sink());
///     ...
///     file.commit();
///
/// It is written in the same folder under another name, and removed if it is not committed.
///
/// @threads  Confined.
class OutputFile {
 public:
  struct Options {
    bool may_replace = false;  ///< An existing file of this name.
    /// Files being read, which must not be replaced.
    std::span<const std::filesystem::path> inputs = {};
  };

  /// @errors  `mcap::Error` if there is such a file and it may not be replaced, if it is one of the
  ///          inputs, or if it cannot be created.
  OutputFile(std::filesystem::path path, const Options& options);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  [[nodiscard]] mcap::Sink& sink() { return *sink_; }
  /// The path of the content until it is committed.
  [[nodiscard]] const std::filesystem::path& unfinished() const { return unfinished_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// Waits until the content is on disk, and renames the file.
  ///
  /// @errors  `mcap::Error`; also if a file of this name appeared meanwhile.
  void commit();

 private:
  const std::filesystem::path path_;
  const bool may_replace_;
  std::filesystem::path unfinished_;
  std::unique_ptr<mcap::FileSink> sink_;
  bool is_committed_ = false;
};

}  // namespace fastcycle::archive
