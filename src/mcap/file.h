#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/files.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

/// The destination of a `Writer`.
///
/// @threads  Confined to the writer's thread.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  /// Appends the concatenation of `parts`.
  ///
  /// @errors  `Error` with the cause; how much was appended is unspecified then.
  virtual void append(std::span<const Bytes> parts) = 0;

  /// Its name in errors.
  [[nodiscard]] virtual const std::string& name() const = 0;
};

/// The input of a reader. It must not change meanwhile.
///
/// @threads  Safe: several readers may share a source.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;

  [[nodiscard]] virtual std::uint64_t size() const = 0;

  /// Fills all of `into` from `offset` on.
  ///
  /// @pre     `offset + into.size() <= size()`
  /// @errors  `Error` with the cause.
  virtual void read(std::uint64_t offset, std::span<std::byte> into) const = 0;

  /// Its name in errors.
  [[nodiscard]] virtual const std::string& name() const = 0;
};

/// A new file, written unbuffered and always at its end.
class FileSink final : public Sink {
 public:
  /// @errors  `Error` if the file exists already, or cannot be created.
  explicit FileSink(const std::filesystem::path& path);
  /// Null if the name is taken, also by a dangling link.
  ///
  /// @errors  `Error` if it cannot be created.
  [[nodiscard]] static std::unique_ptr<FileSink> make_if_free(const std::filesystem::path& path);
  ~FileSink() override;

  void append(std::span<const Bytes> parts) override;
  [[nodiscard]] const std::string& name() const override { return name_; }

  /// Returns when appended data is on disk. Needed for a file that has to survive a power failure.
  ///
  /// @threads  Safe, also while another thread appends.
  void sync();

  /// Checks whether the file under its name still has what was appended.
  ///
  /// @threads  Safe, also while another thread appends.
  [[nodiscard]] base::FileState look() const { return base::look_at(file_, name_, size_); }

 private:
  FileSink(const std::filesystem::path& path, int file) : name_(path.string()), file_(file) {}

  [[noreturn]] void fail(std::uint64_t offset, const char* expected) const;

  const std::string name_;
  int file_ = -1;
  std::atomic<std::uint64_t> size_{0};
};

/// A regular file. Its size is fixed at opening: data appended later is not read.
class FileSource final : public Source {
 public:
  /// @errors  `Error` if it cannot be opened or is no regular file.
  explicit FileSource(const std::filesystem::path& path);
  ~FileSource() override;

  [[nodiscard]] std::uint64_t size() const override { return size_; }
  void read(std::uint64_t offset, std::span<std::byte> into) const override;
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  [[noreturn]] void fail(std::uint64_t offset, const char* expected,
                         const std::string& found) const;

  const std::string name_;
  int file_ = -1;
  std::uint64_t size_ = 0;
};

/// Keeps everything in memory.
class MemorySink final : public Sink {
 public:
  explicit MemorySink(std::string name = "memory") : name_(std::move(name)) {}

  void append(std::span<const Bytes> parts) override;
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] Bytes bytes() const { return bytes_; }

 private:
  const std::string name_;
  std::vector<std::byte> bytes_;
};

/// Bytes in memory, borrowed.
class MemorySource final : public Source {
 public:
  explicit MemorySource(Bytes bytes, std::string name = "memory")
      : name_(std::move(name)), bytes_(bytes) {}

  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> into) const override;
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  const std::string name_;
  const Bytes bytes_;
};

}  // namespace fastcycle::mcap
