#include "base/output_file.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

namespace fs = std::filesystem;

std::string because(int error) {
  return std::system_category().message(error);
}

/// Whether it is a stream that the kernel offers under a name: `/dev/stdout`, `/proc/self/fd/1`.
bool is_stream(const fs::path& path) {
  const fs::path folder = path.parent_path();
  if (folder == "/dev/fd" || folder == "/proc/self/fd" || path == "/dev/stdout" ||
      path == "/dev/stderr") {
    return true;
  }
  struct stat status{};
  return folder == "/dev" && ::stat(path.c_str(), &status) == 0 && S_ISCHR(status.st_mode);
}

/// Opens it without waiting for a reader: -1 with ENXIO if it wants one.
int open_stream(const fs::path& path) {
  const int file = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
  if (file >= 0) {
    ::fcntl(file, F_SETFL, ::fcntl(file, F_GETFL) & ~O_NONBLOCK);
  }
  return file;
}

/// A new file beside `path`, readable by its owner alone, and its name; or -1, with errno.
int open_beside(const fs::path& path, std::string& name) {
  name = path.string() + ".XXXXXX";
  return ::mkostemp(name.data(), O_CLOEXEC);
}

/// Why the present `path` cannot be used.
std::string find_wrong(const fs::path& path, OutputFile::Inputs inputs) {
  struct stat status{};
  if (::lstat(path.c_str(), &status) != 0) {
    return {};  // It is free, or creating it reports the error.
  }
  switch (status.st_mode & S_IFMT) {
    case S_IFDIR:
      return "it is a folder";
    case S_IFLNK:
      return "it is a symbolic link, which is not followed; name the file that it leads to";
    case S_IFREG:
      break;
    default:
      return "it is no regular file; name a new file, or /dev/stdout";
  }
  for (const fs::path& input : inputs) {
    struct stat other{};
    if (::stat(input.c_str(), &other) == 0 && other.st_dev == status.st_dev &&
        other.st_ino == status.st_ino) {
      return "it is read by this command; name another file";
    }
  }
  return {};
}

}  // namespace

std::string OutputFile::find_obstacle(const fs::path& path, Inputs inputs) {
  try {
    const OutputFile file(path, inputs);
    return {};
  } catch (const std::runtime_error& error) {
    // Without the path, which the caller has.
    return std::string(error.what()).substr(path.string().size() + 2);
  }
}

OutputFile::OutputFile(fs::path path, Inputs inputs) : path_(std::move(path)) {
  const bool is_stream = base::is_stream(path_);
  if (std::string wrong = is_stream ? std::string() : find_wrong(path_, inputs); !wrong.empty()) {
    throw std::runtime_error(path_.string() + ": " + wrong);
  }
  descriptor_ = is_stream ? open_stream(path_) : open_beside(path_, unfinished_);
  if (descriptor_ < 0) {
    unfinished_.clear();
    fail(errno);
  }
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
  if (!unfinished_.empty()) {
    ::unlink(unfinished_.c_str());
  }
}

void OutputFile::commit() {
  if (unfinished_.empty()) {
    return;
  }
  // A new object at this path must not be replaced, unless it is a file as before.
  if (const std::string wrong = find_wrong(path_, {}); !wrong.empty()) {
    throw std::runtime_error(path_.string() + ": " + wrong);
  }
  if (std::rename(unfinished_.c_str(), path_.c_str()) != 0) {
    fail(errno);
  }
  unfinished_.clear();
}

void OutputFile::close() {
  if (descriptor_ >= 0 && ::close(std::exchange(descriptor_, -1)) != 0) {
    fail(errno);
  }
}

void OutputFile::fail(int error) const {
  throw std::runtime_error(path_.string() + ": " + because(error));
}

}  // namespace fastcycle::base
