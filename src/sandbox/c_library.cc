// Replacements of C library functions that would fail in a sandbox: those block SIGSYS, so that a
// refused call would end the process instead of being reported, or identify the calling thread by a
// number, which the filter cannot distinguish from another process. Libraries of components find
// these before those of the C library.
//
// Without a sandbox they behave as those of the C library.

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include <dlfcn.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "sandbox/refusals.h"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
namespace fastcycle::sandbox {
namespace {

/// Sets the mask of the calling thread. Returns 0 or the error.
int set_mask(int how, const sigset_t* signals, sigset_t* before) noexcept {
  constexpr std::size_t kBytes = 8;  // Of the kernel's set.
  sigset_t mask;
  if (signals != nullptr && how != SIG_UNBLOCK) {
    mask = *signals;
    // Reserved by the C library, and unknown to sigdelset.
    constexpr unsigned long kOfTheLibrary = 3UL << 31;
    mask.__val[0] &= ~kOfTheLibrary;
    if (is_refusal_handler_installed()) {
      sigdelset(&mask, SIGSYS);
    }
    signals = &mask;
  }
  const int error = errno;
  const long result = syscall(SYS_rt_sigprocmask, how, signals, before, kBytes);
  const int failure = result == 0 ? 0 : errno;
  errno = error;
  return failure;
}

/// Whether `call`, which would create a process, is refused here; then it is counted. Deeper in the
/// C library all signals are blocked while it creates the process.
bool refuses(Rule rule, int call) noexcept {
  if (!is_refusal_handler_installed()) {
    return false;
  }
  note_refusal(rule, call);
  errno = EPERM;
  return true;
}

bool refuses_programs() noexcept {
  return refuses(Rule::kSpawn, SYS_execve);
}

bool refuses_processes() noexcept {
  return refuses(Rule::kFork, SYS_clone);
}

/// Whether a call for `thread` concerns the calling thread, and must be made as such.
bool is_for_itself(pthread_t thread) noexcept {
  return is_refusal_handler_installed() && pthread_equal(thread, pthread_self()) != 0;
}

/// The function of the C library.
template <typename Function>
Function* next(const char* name) noexcept {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace
}  // namespace fastcycle::sandbox

extern "C" {

/// `fork` of the C library under its other name: needs no search by `dlsym` in a process that may
/// hold locks.
pid_t __fork(void);

__attribute__((visibility("default"))) pid_t fork() noexcept {
  return fastcycle::sandbox::refuses_processes() ? -1 : __fork();
}

__attribute__((visibility("default"))) pid_t _Fork() noexcept {
  if (fastcycle::sandbox::refuses_processes()) {
    return -1;
  }
  static const auto next = fastcycle::sandbox::next<decltype(_Fork)>("_Fork");
  return next();
}

__attribute__((visibility("default"))) int pthread_sigmask(int how, const sigset_t* signals,
                                                           sigset_t* before) noexcept {
  return fastcycle::sandbox::set_mask(how, signals, before);
}

__attribute__((visibility("default"))) int sigprocmask(int how, const sigset_t* signals,
                                                       sigset_t* before) noexcept {
  const int error = fastcycle::sandbox::set_mask(how, signals, before);
  if (error != 0) {
    errno = error;
  }
  return error == 0 ? 0 : -1;
}

__attribute__((visibility("default"))) int pthread_setaffinity_np(pthread_t thread, size_t size,
                                                                  const cpu_set_t* cpus) noexcept {
  if (fastcycle::sandbox::is_for_itself(thread)) {
    return sched_setaffinity(0, size, cpus) == 0 ? 0 : errno;
  }
  static const auto next =
      fastcycle::sandbox::next<decltype(pthread_setaffinity_np)>("pthread_setaffinity_np");
  return next(thread, size, cpus);
}

__attribute__((visibility("default"))) int pthread_setschedparam(
    pthread_t thread, int policy, const sched_param* parameter) noexcept {
  if (fastcycle::sandbox::is_for_itself(thread)) {
    return sched_setscheduler(0, policy, parameter) == 0 ? 0 : errno;
  }
  static const auto next =
      fastcycle::sandbox::next<decltype(pthread_setschedparam)>("pthread_setschedparam");
  return next(thread, policy, parameter);
}

__attribute__((visibility("default"))) int posix_spawn(pid_t* process, const char* path,
                                                       const posix_spawn_file_actions_t* actions,
                                                       const posix_spawnattr_t* attributes,
                                                       char* const arguments[],
                                                       char* const environment[]) {
  if (fastcycle::sandbox::refuses_programs()) {
    return EPERM;
  }
  static const auto next = fastcycle::sandbox::next<decltype(posix_spawn)>("posix_spawn");
  return next(process, path, actions, attributes, arguments, environment);
}

__attribute__((visibility("default"))) int posix_spawnp(pid_t* process, const char* name,
                                                        const posix_spawn_file_actions_t* actions,
                                                        const posix_spawnattr_t* attributes,
                                                        char* const arguments[],
                                                        char* const environment[]) {
  if (fastcycle::sandbox::refuses_programs()) {
    return EPERM;
  }
  static const auto next = fastcycle::sandbox::next<decltype(posix_spawnp)>("posix_spawnp");
  return next(process, name, actions, attributes, arguments, environment);
}

__attribute__((visibility("default"))) int system(const char* command) {
  if (fastcycle::sandbox::refuses_programs()) {
    return command == nullptr ? 0 : -1;  // There is no shell.
  }
  static const auto next = fastcycle::sandbox::next<decltype(system)>("system");
  return next(command);
}

__attribute__((visibility("default"))) FILE* popen(const char* command, const char* mode) {
  if (fastcycle::sandbox::refuses_programs()) {
    return nullptr;
  }
  static const auto next = fastcycle::sandbox::next<decltype(popen)>("popen");
  return next(command, mode);
}
}
#endif
