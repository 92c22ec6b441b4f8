#include "loading/protection.h"

#include <cerrno>
#include <cstring>
#include <fstream>

#include <sys/prctl.h>
#include <sys/resource.h>

namespace fastcycle::host {
namespace {

/// The process that traces this one; 0 if none does.
int tracer() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word == "TracerPid:") {
      int pid = 0;
      status >> pid;
      return pid;
    }
  }
  return 0;
}

std::string traced_by(int pid) {
  return "process " + std::to_string(pid) +
         " traces it and could read every message; start it without a debugger, or with "
         "--debuggable if that is meant";
}

}  // namespace

bool is_protected() {
  return prctl(PR_GET_DUMPABLE) != 1;
}

std::optional<std::string> check_protection() {
  if (!is_protected()) {
    return "a component or a library has made its memory readable again (PR_SET_DUMPABLE); remove "
           "that call, or start it with --debuggable if that is meant";
  }
  if (const int pid = tracer(); pid != 0) {
    return traced_by(pid);
  }
  return std::nullopt;
}

void unprotect_process() {
  prctl(PR_SET_DUMPABLE, 1);
}

std::optional<std::string> protect_process() {
  // First deny new access, then check for an existing tracer.
  if (prctl(PR_SET_DUMPABLE, 0) != 0) {
    return std::string("its memory cannot be protected (PR_SET_DUMPABLE): ") + std::strerror(errno);
  }
  if (!is_protected()) {
    return "its memory cannot be protected: PR_SET_DUMPABLE does nothing here; is prctl() replaced "
           "by a library of LD_PRELOAD?";
  }
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  if (const int pid = tracer(); pid != 0) {
    return traced_by(pid);
  }
  return std::nullopt;
}

}  // namespace fastcycle::host
