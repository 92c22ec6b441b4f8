#include "top/terminal.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <string_view>

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

namespace fastcycle::tool::top {
namespace {

using std::chrono::milliseconds;

// The other screen, no cursor, no new line by itself at the right edge; and all of it back.
constexpr const char* kTake = "\x1b[?1049h\x1b[?25l\x1b[?7l";
constexpr const char* kGiveBack = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l";

/// Bytes that follow Escape within this time belong to its sequence; otherwise it is a key.
constexpr milliseconds kEscapeTime{50};

volatile std::sig_atomic_t has_ending = 0;  // A signal that requests the end was received.

void note_ending(int) {
  has_ending = 1;
}

void note_nothing(int) {}  // It only ends the wait.

constexpr std::array kEndings{SIGINT, SIGTERM, SIGHUP};

std::string_view variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? "" : value;
}

void handle(int signal, void (*handler)(int)) {
  struct sigaction action{};
  sigaction(signal, nullptr, &action);
  if (signal == SIGHUP && action.sa_handler == SIG_IGN) {
    return;  // nohup
  }
  action.sa_handler = handler;
  action.sa_flags = 0;
  sigaction(signal, &action, nullptr);
}

}  // namespace

TerminalSize terminal_size() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) {
    return {};
  }
  return {size.ws_col, size.ws_row};
}

Look look_of_environment() {
  std::string_view locale = variable("LC_ALL");
  locale = locale.empty() ? variable("LC_CTYPE") : locale;
  locale = locale.empty() ? variable("LANG") : locale;
  const auto has = [&](std::string_view word) {
    return locale.find(word) != std::string_view::npos;
  };
  return {.has_colours = variable("NO_COLOR").empty() && variable("TERM") != "dumb",
          .is_utf8 = has("UTF-8") || has("utf8") || has("UTF8") || has("utf-8")};
}

bool Terminal::is_there() {
  const std::string_view kind = variable("TERM");
  return TerminalModes::are_there() && isatty(STDOUT_FILENO) != 0 && !kind.empty() &&
         kind != "dumb";
}

Terminal::Terminal(const Look& look) : look_(look) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : kEndings) {
    sigaddset(&signals, signal);
    handle(signal, note_ending);
  }
  for (const int signal : {SIGWINCH, SIGTSTP, SIGCONT}) {
    sigaddset(&signals, signal);
  }
  handle(SIGWINCH, note_nothing);
  pthread_sigmask(SIG_BLOCK, &signals, &signals_before_);
  modes_.emplace(kTake, kGiveBack);
}

Terminal::~Terminal() {
  modes_.reset();
  for (const int signal : kEndings) {
    handle(signal, SIG_DFL);
  }
  handle(SIGWINCH, SIG_DFL);
  pthread_sigmask(SIG_SETMASK, &signals_before_, nullptr);
}

void Terminal::show(const Screen& screen) {
  if (!TerminalModes::are_taken()) {
    return;  // In the background: it belongs to somebody else.
  }
  const int taken = TerminalModes::times_taken();
  const bool is_new = !shown_ || taken != taken_;
  const std::string output = is_new ? whole(screen, look_) : difference(*shown_, screen, look_);
  taken_ = taken;
  shown_ = screen;
  std::string_view rest = output;
  while (!rest.empty()) {
    const ssize_t written = ::write(STDOUT_FILENO, rest.data(), rest.size());
    if (written < 0 && errno == EAGAIN) {
      pollfd file{STDOUT_FILENO, POLLOUT, 0};
      poll(&file, 1, -1);
    } else if (written < 0 && errno != EINTR) {
      is_gone_ = true;
      return;
    } else if (written > 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    }
  }
}

bool Terminal::has_input(milliseconds patience) const {
  pollfd file{STDIN_FILENO, POLLIN, 0};
  return poll(&file, 1, static_cast<int>(patience.count())) > 0;
}

void Terminal::read_keys(std::vector<Key>& keys) {
  do {
    std::array<char, 256> bytes{};
    const ssize_t size = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    if (size <= 0) {
      is_gone_ = is_gone_ || size == 0 || errno != EINTR;
      return;
    }
    reader_.add(std::string_view(bytes.data(), static_cast<std::size_t>(size)));
    while (auto key = reader_.next()) {
      keys.push_back(std::move(*key));
    }
  } while (reader_.is_within_key() && has_input(kEscapeTime));
  if (reader_.is_within_key()) {
    keys.push_back(reader_.finish());
  }
}

Terminal::Event Terminal::wait(int descriptor, milliseconds patience) {
  Event event;
  // A background process must not read: that would stop it.
  const bool can_read = TerminalModes::are_taken() && TerminalModes::are_in_foreground();
  std::array<pollfd, 2> files{{{can_read ? STDIN_FILENO : -1, POLLIN, 0}, {descriptor, POLLIN, 0}}};
  const timespec time{patience.count() / 1000, (patience.count() % 1000) * 1'000'000};
  const int ready = ppoll(files.data(), files.size(), &time, &signals_before_);
  if (ready > 0 && files[0].revents != 0) {
    read_keys(event.keys);
  }
  event.is_over = has_ending != 0 || is_gone_;
  return event;
}

}  // namespace fastcycle::tool::top
