#include "base/files.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::base {
namespace {

namespace fs = std::filesystem;

bool is_same(const struct stat& one, const struct stat& other) {
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

/// The present name of an open file; empty if the kernel does not report it.
std::string present_name(int descriptor) {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/fd/" + std::to_string(descriptor), ignored).string();
}

}  // namespace

FileState look_at(int descriptor, const fs::path& name, std::uint64_t size) {
  struct stat open{};
  if (::fstat(descriptor, &open) != 0) {
    return {FileState::Kind::kLost,
            "it cannot be looked at: " + std::system_category().message(errno)};
  }
  if (open.st_nlink == 0) {
    return {FileState::Kind::kLost, "it was deleted"};
  }
  if (static_cast<std::uint64_t>(open.st_size) < size) {
    return {FileState::Kind::kLost, "another program cut it off: it has " +
                                        std::to_string(open.st_size) + " of " +
                                        std::to_string(size) + " bytes"};
  }
  struct stat named{};
  if (::stat(name.c_str(), &named) == 0 && is_same(open, named)) {
    return {};
  }
  const int error = errno;
  struct stat link{};
  const bool is_taken = ::lstat(name.c_str(), &link) == 0;
  if (!is_taken && error != ENOENT && error != ENOTDIR) {
    return {FileState::Kind::kElsewhere,
            "its name cannot be followed: " + std::system_category().message(error)};
  }
  std::string words = "it was moved";
  if (const std::string now = present_name(descriptor); !now.empty()) {
    words += " to " + now;
  }
  return {FileState::Kind::kElsewhere, words + (is_taken ? ", and another file has its name" : "")};
}

int rename_to_free(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
    return 0;
  }
  return errno == EINVAL || errno == ENOSYS ? link_to_free(from, to) : errno;
}

int link_to_free(const fs::path& from, const fs::path& to) {
  if (::link(from.c_str(), to.c_str()) != 0 || ::unlink(from.c_str()) != 0) {
    return errno;
  }
  return 0;
}

fs::path rename_to_next_free(const fs::path& from, const fs::path& wanted) {
  fs::path name = wanted;
  int error = rename_to_free(from, name);
  for (unsigned number = 2; error == EEXIST; ++number) {
    name = numbered(wanted, number);
    error = rename_to_free(from, name);
  }
  if (error != 0) {
    throw fs::filesystem_error("cannot rename", from, name, {error, std::system_category()});
  }
  return name;
}

fs::path numbered(const fs::path& path, unsigned number) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "_%04u", number);
  fs::path name = path;
  name.replace_filename(path.stem().string() + digits.data() + path.extension().string());
  return name;
}

void sync_folder(const fs::path& folder) noexcept {
  const int file =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file >= 0) {
    static_cast<void>(::fsync(file));
    ::close(file);
  }
}

}  // namespace fastcycle::base
