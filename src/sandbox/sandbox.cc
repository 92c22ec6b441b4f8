#include "sandbox/sandbox.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "sandbox/files.h"
#include "sandbox/filter.h"
#include "sandbox/refusals.h"

namespace fastcycle::sandbox {
namespace {

std::optional<base::Refusal> failed(const std::string& what) {
  return base::Refusal{
      "the sandbox: " + what + ": " + std::strerror(errno),
      "look whether a container or another sandbox around this process forbids it"};
}

/// Reports threads beside the calling one.
std::optional<base::Refusal> check_threads() {
  std::string others;
  std::error_code error;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", error)) {
    if (task.path().filename() != std::to_string(syscall(SYS_gettid))) {
      std::string name;
      std::getline(std::ifstream(task.path() / "comm"), name);
      others += (others.empty() ? "" : ", ") + (name.empty() ? "a thread without a name" : name);
    }
  }
  if (error) {
    errno = error.value();
    return failed("its threads cannot be counted");
  }
  if (others.empty()) {
    return std::nullopt;
  }
  return base::Refusal{
      "the sandbox: there are threads already, which it would not restrict: " + others,
      "keep libraries from making threads while they are loaded, such as by "
      "OPENBLAS_NUM_THREADS=1"};
}

/// Drops all capabilities of root and of file capabilities except real-time scheduling.
std::optional<base::Refusal> drop_capabilities() {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> sets{};
  if (syscall(SYS_capget, &header, sets.data()) != 0) {
    return failed("its capabilities cannot be read");
  }
  constexpr std::uint32_t kRealTime = 1U << CAP_SYS_NICE | 1U << CAP_IPC_LOCK;
  sets[0] = {.effective = sets[0].effective & kRealTime,
             .permitted = sets[0].permitted & kRealTime,
             .inheritable = 0};
  sets[1] = {};
  prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0);
  if (syscall(SYS_capset, &header, sets.data()) != 0) {
    return failed("its capabilities cannot be given up");
  }
  return std::nullopt;
}

}  // namespace

std::optional<base::Refusal> apply_sandbox(const SandboxOptions& options) {
  // First checks everything that may be missing, so that nothing is done partially then.
  if (auto refusal = check_threads()) {
    return refusal;
  }
  if (auto refusal = check_filter()) {
    return refusal;
  }
  FileRules files;
  if (auto refusal = files.prepare(options)) {
    return refusal;
  }
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
    return failed("new privileges cannot be given up");
  }
  if (!install_refusal_handler(options.who)) {
    return failed("SIGSYS cannot be handled");
  }
  if (auto refusal = drop_capabilities()) {
    return refusal;
  }
  if (auto refusal = files.enforce()) {
    return refusal;
  }
  return install_filter(options.may_load_code);
}

}  // namespace fastcycle::sandbox
