#include "campaign/children.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/eventfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/child.h"

namespace fastcycle::tool {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// After it was asked to end, a child has this much time, as Ctrl-C gives a run.
constexpr std::chrono::seconds kEndLimit{10};

struct Child {
  std::size_t number;
  pid_t process;
  int descriptor;  ///< Readable at its end; −1 without pidfds.
  SteadyClock::time_point began;
  SteadyClock::time_point deadline;
  bool is_asked = false;
  bool is_late = false;
};

[[noreturn]] void fail(int error, const char* what) {
  throw std::system_error(error, std::generic_category(), what);
}

pid_t spawn(const ChildProgram& program) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, program.output.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  posix_spawn_file_actions_addchdir_np(&files, program.folder.c_str());
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
  std::vector<char*> arguments;
  for (const std::string& argument : program.arguments) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  pid_t process = -1;
  const int error =
      posix_spawn(&process, arguments.front(), &files, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) {
    fail(error, "a run cannot be started");
  }
  return process;
}

ChildEnd reap(const Child& child) {
  int status = 0;
  while (waitpid(child.process, &status, 0) < 0 && errno == EINTR) {
  }
  if (child.descriptor >= 0) {
    close(child.descriptor);
  }
  return {.is_late = child.is_late,
          .exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 0,
          .signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0,
          .wall_s = std::chrono::duration<double>(SteadyClock::now() - child.began).count()};
}

int milliseconds_until(SteadyClock::time_point time) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(time - SteadyClock::now()).count();
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, 1'000'000'000));
}

}  // namespace

Children::Children(unsigned at_once, std::chrono::nanoseconds limit)
    : at_once_(std::max(1U, at_once)), limit_(limit), stop_event_(eventfd(0, EFD_CLOEXEC)) {
  if (stop_event_ < 0) {
    fail(errno, "eventfd");
  }
}

Children::~Children() {
  close(stop_event_);
}

void Children::stop() noexcept {
  is_stopped_ = true;
  eventfd_write(stop_event_, 1);
}

void Children::run(std::size_t count, const std::function<ChildProgram(std::size_t)>& begin,
                   const std::function<void(std::size_t, const ChildEnd&)>& ended) {
  std::vector<Child> running;
  // Whatever ends this early, no child outlives it.
  const std::unique_ptr<std::vector<Child>, void (*)(std::vector<Child>*)> end_all(
      &running, [](std::vector<Child>* left) {
        for (const Child& child : *left) {
          kill(-child.process, SIGKILL);
          static_cast<void>(reap(child));
        }
      });
  std::size_t next = 0;
  for (;;) {
    while (!is_stopped_ && next < count && running.size() < at_once_) {
      const pid_t process = spawn(begin(next));
      const auto now = SteadyClock::now();
      running.push_back({.number = next++,
                         .process = process,
                         .descriptor = base::open_child(process),
                         .began = now,
                         .deadline = now + limit_});
    }
    if (running.empty()) {
      return;
    }
    std::vector<pollfd> polled;
    bool are_watched = true;
    auto deadline = running.front().deadline;
    for (Child& child : running) {
      if (is_stopped_ && !child.is_asked) {
        child.is_asked = true;
        child.deadline = std::min(child.deadline, SteadyClock::now() + kEndLimit);
        kill(child.process, SIGINT);
      }
      deadline = std::min(deadline, child.deadline);
      polled.push_back({.fd = child.descriptor, .events = POLLIN, .revents = 0});
      are_watched = are_watched && child.descriptor >= 0;
    }
    if (!is_stopped_) {
      polled.push_back({.fd = stop_event_, .events = POLLIN, .revents = 0});
    }
    const int left_ms = milliseconds_until(deadline);
    poll(polled.data(), polled.size(),
         are_watched ? left_ms : std::min(left_ms, base::kLookAgainMs));
    std::vector<Child> left;
    std::vector<std::pair<Child, ChildEnd>> gone;
    for (std::size_t i = 0; i < running.size(); ++i) {
      Child& child = running[i];
      if (polled[i].revents != 0 || (child.descriptor < 0 && base::has_ended(child.process))) {
        gone.emplace_back(child, reap(child));
        continue;
      }
      if (SteadyClock::now() >= child.deadline) {
        child.is_late = true;
        child.deadline = SteadyClock::time_point::max();
        kill(-child.process, SIGKILL);  // With all processes that it has.
      }
      left.push_back(child);
    }
    running = std::move(left);
    for (const auto& [child, end] : gone) {
      if (!child.is_asked) {
        ended(child.number, end);
      }
    }
  }
}

}  // namespace fastcycle::tool
