#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace fastcycle::base {

/// A file that a command was asked to write: a report, a trace, a table.
///
///     OutputFile file(path, inputs);
///     write(file.descriptor(), …);
///     file.commit();
///
/// It is made beside its place, readable by its owner alone, and gets its name by `commit`, which
/// replaces a regular file of that name. So what stands under the name is never half written, a
/// link is never followed, and a FIFO is never waited for. What was not committed is removed.
///
/// Streams that the kernel offers as files, `/dev/stdout`, `/dev/fd/3`, `/dev/null`, are written
/// as they are.
///
/// @threads  Confined.
class OutputFile {
 public:
  using Inputs = std::span<const std::filesystem::path>;

  /// Why `path` cannot be written, as "it is a folder"; empty if nothing is known against it.
  /// `inputs` are what the command reads. Leaves nothing behind.
  [[nodiscard]] static std::string find_obstacle(const std::filesystem::path& path,
                                                 Inputs inputs = {});

  /// @errors  `std::runtime_error`, with the path and what `find_obstacle` says.
  explicit OutputFile(std::filesystem::path path, Inputs inputs = {});
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  [[nodiscard]] int descriptor() const { return descriptor_; }

  /// Gives it its name; more may be written to it afterwards.
  ///
  /// @errors  `std::runtime_error`
  void commit();

  /// Closes it, which may be when the disk says that it is full.
  ///
  /// @errors  `std::runtime_error`
  void close();

 private:
  [[noreturn]] void fail(int error) const;

  const std::filesystem::path path_;
  std::string unfinished_;  ///< Empty: a stream, or it has its name.
  int descriptor_ = -1;
};

}  // namespace fastcycle::base
