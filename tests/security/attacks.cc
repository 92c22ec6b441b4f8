#include "attacks.h"

#include <cerrno>
#include <sstream>
#include <vector>

#include <dirent.h>
#include <fcntl.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::test {
namespace {

/// What a call that failed has to say.
Result failure() {
  switch (errno) {
    case EPERM:
    case EACCES:
      return Result::kRefused;
    case ENOENT:
    case ENOSYS:
      return Result::kMissing;
    default:
      return Result::kFailed;
  }
}

Result outcome(bool has_succeeded) {
  return has_succeeded ? Result::kSucceeded : failure();
}

class Attacker {
 public:
  Attacker(pid_t victim, std::uintptr_t address, const std::string& secret)
      : victim_(victim), address_(address), secret_(secret) {}

  Result read_memory() const {
    std::string text(secret_.size(), '\0');
    const iovec here{text.data(), text.size()};
    const iovec there{reinterpret_cast<void*>(address_), text.size()};
    const ssize_t count = process_vm_readv(victim_, &here, 1, &there, 1, 0);
    return count < 0 ? failure() : text == secret_ ? Result::kSucceeded : Result::kFailed;
  }

  Result write_memory() const {
    std::string text = secret_;
    const iovec here{text.data(), text.size()};
    const iovec there{reinterpret_cast<void*>(address_), text.size()};
    return outcome(process_vm_writev(victim_, &here, 1, &there, 1, 0) > 0);
  }

  Result read_memory_file(const std::string& name) const {
    const int file = open(path(name).c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) {
      return failure();
    }
    std::string text(secret_.size(), '\0');
    const ssize_t count = pread(file, text.data(), text.size(), static_cast<off_t>(address_));
    const Result result = count < 0         ? failure()
                          : text == secret_ ? Result::kSucceeded
                                            : Result::kFailed;
    close(file);
    return result;
  }

  Result write_memory_file() const {
    const int file = open(path("mem").c_str(), O_RDWR | O_CLOEXEC);
    if (file < 0) {
      return failure();
    }
    const auto offset = static_cast<off_t>(address_);
    const Result result = outcome(pwrite(file, secret_.data(), secret_.size(), offset) > 0);
    close(file);
    return result;
  }

  Result attach() const {
    if (ptrace(PTRACE_ATTACH, victim_, nullptr, nullptr) != 0) {
      return failure();
    }
    return read_while_stopped();
  }

  Result seize() const {
    if (ptrace(PTRACE_SEIZE, victim_, nullptr, nullptr) != 0) {
      return failure();
    }
    ptrace(PTRACE_INTERRUPT, victim_, nullptr, nullptr);
    return read_while_stopped();
  }

  Result take_file() const {
    const int process = static_cast<int>(syscall(SYS_pidfd_open, victim_, 0));
    if (process < 0) {
      return Result::kMissing;
    }
    Result result = Result::kFailed;
    for (int number = 0; number < 64 && result != Result::kSucceeded; ++number) {
      const int taken = static_cast<int>(syscall(SYS_pidfd_getfd, process, number, 0));
      if (taken >= 0) {
        close(taken);
        result = Result::kSucceeded;
      } else if (errno != EBADF) {
        result = failure();
      }
    }
    close(process);
    return result;
  }

  Result read_file(const std::string& name) const {
    const int file = open(path(name).c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) {
      return failure();
    }
    char byte = 0;
    const Result result = outcome(read(file, &byte, 1) >= 0);
    close(file);
    return result;
  }

  Result list_folder(const std::string& name) const {
    DIR* const folder = opendir(path(name).c_str());
    if (folder == nullptr) {
      return failure();
    }
    errno = 0;
    const Result result = outcome(readdir(folder) != nullptr);
    closedir(folder);
    return result;
  }

  Result read_link(const std::string& name) const {
    char target[4096];
    return outcome(readlink(path(name).c_str(), target, sizeof(target)) >= 0);
  }

 private:
  [[nodiscard]] std::string path(const std::string& name) const {
    return "/proc/" + std::to_string(victim_) + "/" + name;
  }

  Result read_while_stopped() const {
    int status = 0;
    while (waitpid(victim_, &status, __WALL) < 0 && errno == EINTR) {
    }
    errno = 0;
    const long word = ptrace(PTRACE_PEEKDATA, victim_, address_, nullptr);
    const bool is_secret =
        errno == 0 && secret_.starts_with(std::string(reinterpret_cast<const char*>(&word), 8));
    const Result result = errno != 0 ? failure() : is_secret ? Result::kSucceeded : Result::kFailed;
    ptrace(PTRACE_DETACH, victim_, nullptr, nullptr);
    return result;
  }

  const pid_t victim_;
  const std::uintptr_t address_;
  const std::string secret_;
};

}  // namespace

std::map<std::string, Result> attack(pid_t victim, std::uintptr_t address,
                                     const std::string& secret) {
  const Attacker attacker(victim, address, secret);
  std::map<std::string, Result> results;
  results["process_vm_readv"] = attacker.read_memory();
  results["process_vm_writev"] = attacker.write_memory();
  results["mem for reading"] = attacker.read_memory_file("mem");
  results["mem for writing"] = attacker.write_memory_file();
  results["mem of a task"] = attacker.read_memory_file("task/" + std::to_string(victim) + "/mem");
  results["ptrace seize"] = attacker.seize();
  results["ptrace attach"] = attacker.attach();
  results["pidfd_getfd"] = attacker.take_file();
  for (const char* name : {"maps", "smaps", "smaps_rollup", "numa_maps", "environ", "auxv",
                           "syscall", "io", "pagemap", "personality", "mountstats"}) {
    results[name] = attacker.read_file(name);
  }
  for (const char* name : {"fd", "fdinfo", "map_files", "ns"}) {
    results[name] = attacker.list_folder(name);
  }
  for (const char* name : {"exe", "cwd", "root"}) {
    results[name] = attacker.read_link(name);
  }
  return results;
}

std::string to_text(const std::map<std::string, Result>& results) {
  std::string text;
  for (const auto& [name, result] : results) {
    text += static_cast<char>(result) + name + "\n";
  }
  return text;
}

std::map<std::string, Result> from_text(const std::string& text) {
  std::map<std::string, Result> results;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line) && !line.empty();) {
    results[line.substr(1)] = static_cast<Result>(line[0]);
  }
  return results;
}

}  // namespace fastcycle::test
