#include "archive/output_file.h"

#include <cerrno>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "mcap/error.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, std::string expected, std::string found) {
  throw mcap::Error({.place = {.file = path.string()},
                     .record = {},
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

fs::path checked(fs::path path, const OutputFile::Options& options) {
  std::error_code ignored;
  for (const fs::path& input : options.inputs) {
    if (fs::equivalent(input, path, ignored)) {
      refuse(path, "another file than those that are read", "one of them");
    }
  }
  if (fs::is_directory(path, ignored)) {
    refuse(path, "the name of a file", "a folder");
  }
  if (const fs::path folder = path.parent_path();
      !folder.empty() && !fs::is_directory(folder, ignored)) {
    refuse(path, "a name in a folder that is there", "no folder " + folder.string());
  }
  if (!options.may_replace && fs::exists(fs::symlink_status(path, ignored))) {
    refuse(path, "a name that is free", "a file (--force replaces it)");
  }
  return path;
}

fs::path beside(const fs::path& path) {
  fs::path name = path;
  name += "." + std::to_string(::getpid()) + ".tmp";
  return name;
}

/// 0, or the error. Where the file system cannot refuse a name that is taken, it was looked for
/// before.
int rename_to_free(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
    return 0;
  }
  if (errno != EINVAL && errno != ENOSYS) {
    return errno;
  }
  return std::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

OutputFile::OutputFile(fs::path path, const Options& options)
    : path_(checked(std::move(path), options)),
      may_replace_(options.may_replace),
      unfinished_(beside(path_)),
      sink_(std::make_unique<mcap::FileSink>(unfinished_)) {}

OutputFile::~OutputFile() {
  if (!is_committed_) {
    std::error_code ignored;
    fs::remove(unfinished_, ignored);
  }
}

void OutputFile::commit() {
  sink_->sync();
  const int error = may_replace_
                        ? (std::rename(unfinished_.c_str(), path_.c_str()) == 0 ? 0 : errno)
                        : rename_to_free(unfinished_, path_);
  if (error != 0) {
    refuse(path_, "a name that it can get", std::system_category().message(error));
  }
  is_committed_ = true;
  // So that the name, too, outlives a power cut.
  const fs::path folder = path_.parent_path();
  const int file =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file >= 0) {
    ::fsync(file);
    ::close(file);
  }
}

}  // namespace fastcycle::archive
