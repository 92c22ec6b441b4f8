#include "terminal_keys.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

namespace fastcycle::tool {
namespace {

// A signal handler sees nothing but this. There is one terminal.
termios before;                            // As others left the terminal.
volatile std::sig_atomic_t is_ours = 0;    // Its modes are ours now.
volatile std::sig_atomic_t is_wanted = 0;  // There is a `TerminalKeys`.

bool is_in_foreground() noexcept {
  return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

/// Keys come at once, and are not shown.
void take() noexcept {
  termios modes = before;
  modes.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  modes.c_cc[VMIN] = 1;
  modes.c_cc[VTIME] = 0;
  is_ours = tcsetattr(STDIN_FILENO, TCSANOW, &modes) == 0 ? 1 : 0;
}

/// The signal's own action follows once the terminal is as it was.
void end_by(int signal) {
  const int error = errno;
  TerminalKeys::give_back();
  errno = error;
  raise(signal);  // The handler is gone: see SA_RESETHAND.
}

void stop_by(int) {
  const int error = errno;
  TerminalKeys::give_back();
  raise(SIGSTOP);
  errno = error;
}

void go_on(int) {
  const int error = errno;
  if (is_wanted != 0 && is_ours == 0 && is_in_foreground()) {
    take();
  }
  errno = error;
}

constexpr std::array kEndings{SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGQUIT, SIGSEGV};

void handle(int signal, void (*handler)(int), int flags) {
  struct sigaction action{};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigaction(signal, &action, nullptr);
}

}  // namespace

bool TerminalKeys::are_there() {
  return isatty(STDIN_FILENO) != 0 && is_in_foreground();
}

void TerminalKeys::give_back() noexcept {
  if (is_ours != 0) {
    is_ours = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &before);
  }
}

TerminalKeys::TerminalKeys(std::function<void(char)> on_key) : on_key_(std::move(on_key)) {
  if (tcgetattr(STDIN_FILENO, &before) != 0 || pipe2(end_, O_CLOEXEC) != 0) {
    return;
  }
  for (const int signal : kEndings) {
    handle(signal, end_by, static_cast<int>(SA_RESETHAND | SA_NODEFER));
  }
  handle(SIGTSTP, stop_by, SA_RESTART);
  handle(SIGCONT, go_on, SA_RESTART);
  is_wanted = 1;
  take();
  thread_ = std::thread([this] { read(); });
}

TerminalKeys::~TerminalKeys() {
  is_wanted = 0;
  if (thread_.joinable()) {
    const ssize_t written = write(end_[1], "", 1);
    static_cast<void>(written);  // An empty pipe takes a byte.
    thread_.join();
    for (const int signal : kEndings) {
      handle(signal, SIG_DFL, 0);
    }
    handle(SIGTSTP, SIG_DFL, 0);
    handle(SIGCONT, SIG_DFL, 0);
  }
  give_back();
  for (const int file : end_) {
    if (file >= 0) {
      close(file);
    }
  }
}

void TerminalKeys::read() {
  std::array<pollfd, 2> files{{{STDIN_FILENO, POLLIN, 0}, {end_[0], POLLIN, 0}}};
  for (;;) {
    const int ready = poll(files.data(), files.size(), -1);
    if (ready < 0 && errno == EINTR) {
      continue;
    }
    if (ready < 0 || files[1].revents != 0) {
      return;
    }
    if (!is_in_foreground()) {
      files[0].fd = -1;  // To read now would stop the process: there are no keys any more.
      continue;
    }
    char key = 0;
    if (::read(STDIN_FILENO, &key, 1) != 1) {
      files[0].fd = -1;  // The terminal is gone.
      continue;
    }
    on_key_(key);
  }
}

}  // namespace fastcycle::tool
