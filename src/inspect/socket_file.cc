#include "inspect/socket_file.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "inspect/address.h"

namespace fastcycle::inspect {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSuffix = ".sock";
constexpr int kMaxNames = 100;  // Applications of one name at once.
constexpr int kBacklog = 16;

/// Converted to a valid part of a file name.
std::string plain(std::string_view application) {
  std::string name(application);
  for (char& c : name) {
    const bool is_plain =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.';
    c = is_plain ? c : '_';
  }
  return name.empty() || name.front() == '.' ? "_" + name : name;
}

std::string reason() {
  return std::strerror(errno);
}

/// Creates the folder if it does not exist, and checks whether it may be used.
void prepare(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw std::runtime_error(
        fmt::format("the folder {} cannot be made: {}", folder.string(), reason()));
  }
  if (const std::string wrong = find_wrong(folder); !wrong.empty()) {
    throw std::runtime_error(wrong);
  }
}

/// A file that is locked while this process has it open; -1 if another process holds the lock.
int try_lock(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (descriptor < 0) {
    throw std::runtime_error(fmt::format("{} cannot be made: {}", file.string(), reason()));
  }
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    ::close(descriptor);
    return -1;
  }
  return descriptor;
}

int listen_at(const fs::path& file) {
  const sockaddr_un address = address_of(file);
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) {
    throw std::runtime_error("no socket can be made: " + reason());
  }
  ::unlink(file.c_str());      // Left by a crashed run: its lock is free.
  ::fchmod(descriptor, 0600);  // The file that `bind` creates has the socket's mode.
  if (::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      ::chmod(file.c_str(), 0600) != 0 || ::listen(descriptor, kBacklog) != 0) {
    const std::string why = reason();
    ::close(descriptor);
    throw std::runtime_error(fmt::format("nobody can listen at {}: {}", file.string(), why));
  }
  return descriptor;
}

/// The process that listens at `file`; 0 if none does.
pid_t listener_of(const fs::path& file) {
  sockaddr_un address{};
  try {
    address = address_of(file);
  } catch (const std::runtime_error&) {
    return 0;
  }
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) {
    return 0;
  }
  ucred peer{};
  socklen_t size = sizeof(peer);
  const bool is_there =
      ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
      ::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
      peer.uid == ::geteuid();
  ::close(descriptor);
  return is_there ? peer.pid : 0;
}

}  // namespace

sockaddr_un address_of(const fs::path& file) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = file.string();
  if (name.size() >= sizeof(address.sun_path)) {
    throw std::runtime_error(
        fmt::format("{} is too long for a socket: {} characters, at most {} may be; set "
                    "XDG_RUNTIME_DIR to a shorter folder, or give the application a shorter name",
                    name, name.size(), sizeof(address.sun_path) - 1));
  }
  std::copy(name.begin(), name.end(), std::begin(address.sun_path));
  return address;
}

fs::path socket_folder() {
  struct stat info{};
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  // After `su` it may belong to another user.
  if (runtime != nullptr && runtime[0] == '/' && ::stat(runtime, &info) == 0 &&
      S_ISDIR(info.st_mode) && info.st_uid == ::geteuid()) {
    return fs::path(runtime) / "fastcycle";
  }
  std::error_code error;
  fs::path temporary = fs::temp_directory_path(error);
  if (error) {
    temporary = "/tmp";
  }
  return temporary / fmt::format("fastcycle-{}", ::geteuid());
}

std::string find_wrong(const fs::path& folder) {
  struct stat info{};
  if (::lstat(folder.c_str(), &info) != 0) {
    return errno == ENOENT
               ? std::string()
               : fmt::format("the folder {} cannot be looked at: {}", folder.string(), reason());
  }
  if (!S_ISDIR(info.st_mode)) {
    return fmt::format("{} must be a folder, and is none", folder.string());
  }
  if (info.st_uid != ::geteuid()) {
    return fmt::format("the folder {} must belong to user {}, and belongs to user {}",
                       folder.string(), ::geteuid(), info.st_uid);
  }
  if ((info.st_mode & 0777U) != 0700) {
    return fmt::format("the folder {} must have the mode 0700, and has {:04o}: chmod 700 {}",
                       folder.string(), info.st_mode & 07777U, folder.string());
  }
  return {};
}

std::vector<FoundSocket> find_sockets(const fs::path& folder) {
  std::vector<FoundSocket> found;
  if (!find_wrong(folder).empty()) {
    return found;
  }
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() != kSuffix) {
      continue;
    }
    if (const pid_t pid = listener_of(entry.path()); pid != 0) {
      found.push_back({entry.path().stem().string(), entry.path(), pid});
    }
  }
  std::ranges::sort(found, {}, &FoundSocket::name);
  return found;
}

SocketFile::SocketFile(const fs::path& folder, std::string_view application) {
  prepare(folder);
  const std::string plain_name = plain(application);
  for (int number = 1; number <= kMaxNames; ++number) {
    name_ = number == 1 ? plain_name : fmt::format("{}-{}", plain_name, number);
    file_ = folder / (name_ + kSuffix);
    lock_ = try_lock(folder / (name_ + ".lock"));
    if (lock_ >= 0) {
      break;
    }
  }
  if (lock_ < 0) {
    throw std::runtime_error(fmt::format("{} applications are called \"{}\" already", kMaxNames,
                                         std::string(application)));
  }
  try {
    descriptor_ = listen_at(file_);
  } catch (...) {
    ::close(lock_);
    throw;
  }
}

SocketFile::~SocketFile() {
  ::close(descriptor_);
  ::unlink(file_.c_str());
  ::close(
      lock_);  // The file stays: to unlink it could remove it from a process that just locked it.
}

}  // namespace fastcycle::inspect
