#pragma once

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::sandbox {

/// A sanitizer has threads and calls of its own.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

/// Output of a child process, and how it ended.
struct Ended {
  std::string said;
  int status = 0;
};

/// Runs `action` in a child process; its result is the child's output. A child that takes longer
/// than 20 s is killed.
inline Ended in_child(const std::function<std::string()>& action) {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) {
    return {"no pipe", -1};
  }
  const pid_t child = fork();
  if (child == 0) {
    close(pipe_ends[0]);
    alarm(20);
    const std::string said = action();
    const ssize_t written = write(pipe_ends[1], said.data(), said.size());
    _exit(written == static_cast<ssize_t>(said.size()) ? 0 : 1);
  }
  close(pipe_ends[1]);
  Ended ended;
  if (child < 0) {
    ended = {"no child", -1};
  } else {
    char part[4096];
    for (ssize_t count; (count = read(pipe_ends[0], part, sizeof(part))) > 0;) {
      ended.said.append(part, static_cast<std::size_t>(count));
    }
    waitpid(child, &ended.status, 0);
  }
  close(pipe_ends[0]);
  return ended;
}

/// A temporary folder for each test.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "sandbox_test_XXXXXX").string();
    path = mkdtemp(name.data()) != nullptr ? name : "";
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }

  std::filesystem::path path;
};

}  // namespace fastcycle::sandbox
