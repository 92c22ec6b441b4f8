#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace fastcycle::base {

/// An output file of a command: a report, a trace, a table.
///
///     OutputFile file(path, inputs);
///     write(file.descriptor(), …);
///     file.commit();
///
/// It is created in the same folder under another name, readable by its owner only, and renamed by
/// `commit`, which replaces a regular file of that name. So the named file is never incomplete,
/// links are not followed, and FIFOs do not block. An uncommitted file is removed.
///
/// Streams that the kernel offers as files, `/dev/stdout`, `/dev/fd/3`, `/dev/null`, are written
/// directly.
///
/// @threads  Confined.
class OutputFile {
 public:
  using Inputs = std::span<const std::filesystem::path>;

  /// Why `path` cannot be written, such as "it is a folder"; empty if no reason is found. `inputs`
  /// are the files that the command reads. Without side effects.
  [[nodiscard]] static std::string find_obstacle(const std::filesystem::path& path,
                                                 Inputs inputs = {});

  /// @errors  `std::runtime_error`, with the path and the result of `find_obstacle`.
  explicit OutputFile(std::filesystem::path path, Inputs inputs = {});
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  [[nodiscard]] int descriptor() const { return descriptor_; }

  /// Renames it; more may be written to it afterwards.
  ///
  /// @errors  `std::runtime_error`
  void commit();

  /// Closes it, which may be when a full disk is reported.
  ///
  /// @errors  `std::runtime_error`
  void close();

 private:
  [[noreturn]] void fail(int error) const;

  const std::filesystem::path path_;
  std::string unfinished_;  ///< Empty: a stream, or committed.
  int descriptor_ = -1;
};

}  // namespace fastcycle::base
