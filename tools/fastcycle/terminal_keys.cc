#include "terminal_keys.h"

#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

namespace fastcycle::tool {

TerminalKeys::TerminalKeys(std::function<void(char)> on_key) : on_key_(std::move(on_key)) {
  if (modes_ && pipe2(end_, O_CLOEXEC) == 0) {
    thread_ = std::thread([this] { read(); });
  }
}

TerminalKeys::~TerminalKeys() {
  if (thread_.joinable()) {
    const ssize_t written = ::write(end_[1], "", 1);
    static_cast<void>(written);  // An empty pipe takes a byte.
    thread_.join();
  }
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
    if (!TerminalModes::are_in_foreground()) {
      files[0].fd = -1;  // To read now would stop the process: there are no keys any more.
      continue;
    }
    char key = 0;
    if (::read(STDIN_FILENO, &key, 1) != 1) {
      files[0].fd = -1;  // The terminal was closed.
      continue;
    }
    on_key_(key);
  }
}

}  // namespace fastcycle::tool
