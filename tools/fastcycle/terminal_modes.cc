#include "terminal_modes.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>

#include <termios.h>
#include <unistd.h>

namespace fastcycle::tool {
namespace {

// A signal handler sees nothing but this. There is one terminal.
termios before;           // As others left the terminal.
const char* taking = "";  // Written to standard output, see the constructor.
const char* giving_back = "";
volatile std::sig_atomic_t is_ours = 0;    // Its modes are ours now.
volatile std::sig_atomic_t is_wanted = 0;  // There is a `TerminalModes`.
volatile std::sig_atomic_t takes = 0;      // See `times_taken`.

void write_out(const char* text) noexcept {
  const std::size_t size = std::strlen(text);
  if (size > 0) {
    const ssize_t written = ::write(STDOUT_FILENO, text, size);
    static_cast<void>(written);  // Errors of a closed terminal do not matter.
  }
}

/// Keys come at once, and are not shown.
void take() noexcept {
  termios modes = before;
  modes.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  modes.c_cc[VMIN] = 1;
  modes.c_cc[VTIME] = 0;
  if (tcsetattr(STDIN_FILENO, TCSANOW, &modes) == 0) {
    is_ours = 1;
    takes = takes + 1;
    write_out(taking);
  }
}

/// The signal's own action follows once the terminal is as it was.
void end_by(int signal) {
  const int error = errno;
  TerminalModes::give_back();
  errno = error;
  raise(signal);  // The handler is no longer installed: see SA_RESETHAND.
}

void stop_by(int) {
  const int error = errno;
  TerminalModes::give_back();
  raise(SIGSTOP);
  errno = error;
}

void go_on(int) {
  const int error = errno;
  if (is_wanted != 0 && is_ours == 0 && TerminalModes::are_in_foreground()) {
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

bool TerminalModes::are_there() {
  return isatty(STDIN_FILENO) != 0 && are_in_foreground();
}

bool TerminalModes::are_in_foreground() noexcept {
  return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

void TerminalModes::give_back() noexcept {
  if (is_ours != 0) {
    is_ours = 0;
    write_out(giving_back);
    tcsetattr(STDIN_FILENO, TCSANOW, &before);
  }
}

int TerminalModes::times_taken() noexcept {
  return takes;
}

bool TerminalModes::are_taken() noexcept {
  return is_ours != 0;
}

TerminalModes::TerminalModes(const char* on_take, const char* on_give_back) {
  if (tcgetattr(STDIN_FILENO, &before) != 0) {
    return;
  }
  is_good_ = true;
  taking = on_take;
  giving_back = on_give_back;
  for (const int signal : kEndings) {
    handle(signal, end_by, static_cast<int>(SA_RESETHAND | SA_NODEFER));
  }
  handle(SIGTSTP, stop_by, SA_RESTART);
  handle(SIGCONT, go_on, SA_RESTART);
  is_wanted = 1;
  take();
}

TerminalModes::~TerminalModes() {
  is_wanted = 0;
  if (is_good_) {
    for (const int signal : kEndings) {
      handle(signal, SIG_DFL, 0);
    }
    handle(SIGTSTP, SIG_DFL, 0);
    handle(SIGCONT, SIG_DFL, 0);
  }
  give_back();
}

}  // namespace fastcycle::tool
