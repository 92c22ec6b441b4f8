#include "sandbox/files.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace fastcycle::sandbox {
namespace {

// From linux/landlock.h, which is outdated on old systems, and without wrappers in the C library.
constexpr long kCreateRuleset = 444;  ///< The same number everywhere.
constexpr long kAddRule = 445;
constexpr long kRestrictSelf = 446;
constexpr unsigned kAskVersion = 1;
constexpr int kPathBeneath = 1;

struct Ruleset {
  std::uint64_t files;
  std::uint64_t ports;   ///< Since version 4.
  std::uint64_t scoped;  ///< Since version 6.
};

struct __attribute__((packed)) PathBeneath {
  std::uint64_t allowed;
  std::int32_t parent;
};

using Rights = std::uint64_t;
constexpr Rights kExecute = 1U << 0;
constexpr Rights kWriteFile = 1U << 1;
constexpr Rights kReadFile = 1U << 2;
constexpr Rights kReadFolder = 1U << 3;
constexpr Rights kRemoveFolder = 1U << 4;
constexpr Rights kRemoveFile = 1U << 5;
constexpr Rights kMakeFolder = 1U << 7;
constexpr Rights kMakeFile = 1U << 8;
constexpr Rights kAllOfVersion1 = (1U << 13) - 1;
constexpr Rights kRefer = 1U << 13;      ///< To other folders. Since version 2.
constexpr Rights kTruncate = 1U << 14;   ///< Since version 3.
constexpr Rights kDevice = 1U << 15;     ///< Requests to devices. Since version 5.
constexpr std::uint64_t kAllPorts = 3;   ///< To bind, to connect.
constexpr std::uint64_t kAllScopes = 3;  ///< Abstract sockets, signals.

constexpr Rights kOfFiles = kExecute | kWriteFile | kReadFile | kTruncate | kDevice;
constexpr Rights kToRead = kReadFile | kReadFolder;
constexpr Rights kToWrite = kToRead | kWriteFile | kTruncate | kRemoveFolder | kRemoveFile |
                            kMakeFolder | kMakeFile | kRefer;

/// Read by the C library and C++ at run time. Missing files are skipped. Nothing of the process may
/// be written: /proc/self/mem would allow writing code.
constexpr const char* kReadByAll[] = {"/proc/self",
                                      "/proc/cpuinfo",
                                      "/proc/meminfo",
                                      "/proc/stat",
                                      "/proc/sys/vm",
                                      "/sys/devices/system/cpu",
                                      "/sys/devices/system/node",
                                      "/dev/zero",
                                      "/dev/urandom",
                                      "/dev/random",
                                      "/etc/localtime",
                                      "/usr/share/zoneinfo"};
/// Folders from which libraries may be loaded.
constexpr const char* kReadByLoader[] = {"/lib",       "/lib64",         "/usr/lib",
                                         "/usr/lib64", "/usr/local/lib", "/etc/ld.so.cache"};

base::Refusal without_landlock(const std::string& what) {
  return {
      "the sandbox: " + what,
      "run a kernel of version 5.13 or later that is built with CONFIG_SECURITY_LANDLOCK and has "
      "`landlock` in /sys/kernel/security/lsm; or give the process no sandbox"};
}

}  // namespace

FileRules::~FileRules() {
  if (rules_ >= 0) {
    close(rules_);
  }
}

bool FileRules::add(const std::filesystem::path& path, std::uint64_t rights) {
  const int file = open(path.c_str(), O_PATH | O_CLOEXEC);
  if (file < 0) {
    return false;
  }
  struct stat about{};
  bool is_added = fstat(file, &about) == 0;
  if (is_added) {
    const std::uint64_t meaningful = S_ISDIR(about.st_mode) ? rights : rights & kOfFiles;
    const PathBeneath rule{.allowed = meaningful & handled_, .parent = file};
    is_added = syscall(kAddRule, rules_, kPathBeneath, &rule, 0) == 0;
  }
  const int error = errno;
  close(file);
  errno = error;
  return is_added;
}

std::optional<base::Refusal> FileRules::add_named(const std::filesystem::path& path,
                                                  std::uint64_t rights) {
  if (add(path, rights)) {
    return std::nullopt;
  }
  return base::Refusal{"the sandbox: " + path.string() + ": " + std::strerror(errno),
                       "name files and folders that are there when the process starts"};
}

std::optional<base::Refusal> FileRules::prepare(const SandboxOptions& options) {
  const long version = syscall(kCreateRuleset, nullptr, 0, kAskVersion);
  if (version < 1) {
    return without_landlock(std::string("there is no Landlock here to restrict files: ") +
                            std::strerror(errno));
  }
  handled_ = kAllOfVersion1 | (version >= 2 ? kRefer : Rights{0}) |
             (version >= 3 ? kTruncate : Rights{0}) | (version >= 5 ? kDevice : Rights{0});
  const Ruleset ruleset{.files = handled_,
                        .ports = version >= 4 ? kAllPorts : 0,
                        .scoped = version >= 6 ? kAllScopes : 0};
  const std::size_t known = version >= 6 ? 24 : version >= 4 ? 16 : 8;
  rules_ = static_cast<int>(syscall(kCreateRuleset, &ruleset, known, 0));
  if (rules_ < 0) {
    return without_landlock(std::string("Landlock makes no rules: ") + std::strerror(errno));
  }
  for (const char* path : kReadByAll) {
    static_cast<void>(add(path, kToRead));
  }
  static_cast<void>(add("/dev/null", kReadFile | kWriteFile));
  if (options.may_load_code) {
    for (const char* path : kReadByLoader) {
      static_cast<void>(add(path, kToRead));
    }
  }
  for (const auto& path : options.read) {
    if (auto refusal = add_named(path, kToRead)) {
      return refusal;
    }
  }
  for (const auto& path : options.write) {
    if (auto refusal = add_named(path, kToWrite)) {
      return refusal;
    }
  }
  return std::nullopt;
}

std::optional<base::Refusal> FileRules::enforce() {
  if (syscall(kRestrictSelf, rules_, 0) != 0) {
    return without_landlock(std::string("Landlock does not restrict this process: ") +
                            std::strerror(errno));
  }
  return std::nullopt;
}

}  // namespace fastcycle::sandbox
