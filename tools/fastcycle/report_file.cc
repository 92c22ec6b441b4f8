#include "report_file.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

/// A new file beside `path`, readable by its owner alone, and its name; or -1, with errno.
int open_beside(const fs::path& path, std::string& name) {
  name = path.string() + ".XXXXXX";
  return mkostemp(name.data(), O_CLOEXEC);
}

bool write_all(int file, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = ::write(file, text.data() + done, text.size() - done);
    if (count < 0 && errno != EINTR) {
      return false;
    }
    done += count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  return true;
}

/// Something like /dev/stdout or a pipe: it is written to, and cannot be replaced.
bool is_device(const fs::path& path) {
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

std::string because(int error) {
  return std::strerror(error);
}

}  // namespace

std::string ReportFile::find_obstacle() const {
  std::error_code ignored;
  if (path_.empty()) {
    return {};
  }
  if (fs::is_directory(path_, ignored)) {
    return "it is a folder";
  }
  if (is_device(path_)) {
    return access(path_.c_str(), W_OK) == 0 ? std::string() : because(errno);
  }
  std::string name;
  const int file = open_beside(path_, name);
  if (file < 0) {
    return because(errno);
  }
  close(file);
  unlink(name.c_str());
  return {};
}

std::string ReportFile::write(const std::string& text) const {
  if (path_.empty()) {
    return {};
  }
  std::string name;
  const bool is_written_in_place = is_device(path_);
  const int file =
      is_written_in_place ? open(path_.c_str(), O_WRONLY | O_CLOEXEC) : open_beside(path_, name);
  if (file < 0) {
    return because(errno);
  }
  const bool is_written = write_all(file, text);
  int error = is_written ? 0 : errno;
  if (close(file) != 0 && error == 0) {
    error = errno;
  }
  if (is_written_in_place) {
    return error == 0 ? std::string() : because(error);
  }
  if (error == 0 && rename(name.c_str(), path_.c_str()) != 0) {
    error = errno;
  }
  if (error != 0) {
    unlink(name.c_str());
    return because(error);
  }
  return {};
}

}  // namespace fastcycle::tool
