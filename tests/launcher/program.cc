#include "program.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <stdexcept>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fastcycle::launcher {
namespace {

constexpr std::chrono::seconds kLimit{60};

}  // namespace

Program::Program(const std::vector<std::string>& arguments) {
  int output[2];
  int errors[2];
  if (pipe2(output, O_CLOEXEC) != 0 || pipe2(errors, O_CLOEXEC) != 0) {
    throw std::runtime_error("no pipe could be made");
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, output[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors[1], STDERR_FILENO);
  std::vector<std::string> words{FASTCYCLE_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& word : words) {
    pointers.push_back(word.data());
  }
  pointers.push_back(nullptr);
  const int error =
      posix_spawn(&pid_, FASTCYCLE_PROGRAM, &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(output[1]);
  close(errors[1]);
  if (error != 0) {
    throw std::runtime_error(FASTCYCLE_PROGRAM " could not be started");
  }
  output_reader_ = std::thread([this, output] { read(output[0], output_); });
  errors_reader_ = std::thread([this, errors] { read(errors[0], errors_); });
}

Program::~Program() {
  if (!is_reaped_) {
    send(SIGKILL);
    wait();
  }
}

void Program::read(int descriptor, std::string& text) {
  char buffer[4096];
  for (;;) {
    const ssize_t count = ::read(descriptor, buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) {
      continue;
    }
    const std::lock_guard lock(mutex_);
    if (count > 0) {
      text.append(buffer, static_cast<std::size_t>(count));
    } else {
      --open_;
    }
    changed_.notify_all();
    if (count <= 0) {
      break;
    }
  }
  close(descriptor);
}

bool Program::wait_for_error_text(const std::string& text) {
  std::unique_lock lock(mutex_);
  const auto has_come = [&] { return errors_.find(text) != std::string::npos; };
  changed_.wait_for(lock, kLimit, [&] { return has_come() || open_ == 0; });
  return has_come();
}

void Program::send(int signal) const {
  kill(pid_, signal);
}

int Program::wait() {
  if (is_reaped_) {
    return exit_code_;
  }
  {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kLimit, [this] { return open_ == 0; })) {
      send(SIGKILL);
    }
  }
  output_reader_.join();
  errors_reader_.join();
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  is_reaped_ = true;
  exit_code_ = WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
  return exit_code_;
}

std::string Program::output() const {
  const std::lock_guard lock(mutex_);
  return output_;
}

std::string Program::errors() const {
  const std::lock_guard lock(mutex_);
  return errors_;
}

}  // namespace fastcycle::launcher
