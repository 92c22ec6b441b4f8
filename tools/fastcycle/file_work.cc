#include "file_work.h"

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include <unistd.h>

#include "base/printable.h"
#include "command.h"
#include "print.h"
#include "quantity.h"
#include "redrawn_line.h"

namespace fastcycle::tool {

FileWork::FileWork(bool shows_progress)
    : is_shown_(shows_progress && isatty(STDERR_FILENO) != 0),
      signals_(block_stop_signals()),
      stop_signals_(signals_, [this] { is_stopped_ = true; }) {}

FileWork::~FileWork() {
  if (is_line_shown_) {
    std::fputs(kClearLine, stderr);
  }
}

archive::Progress FileWork::progress(std::string what, std::uint64_t total) {
  return [this, what = std::move(what), total](std::uint64_t done) { show(what, done, total); };
}

host::ExactReplay::Watcher FileWork::steps(std::string what, std::string unit) {
  return [this, what = std::move(what), unit = std::move(unit)](const auto& progress) {
    const auto now = std::chrono::steady_clock::now();
    if (is_shown_ && progress.total > 0 && now - drawn_ >= kRedrawPeriod) {
      drawn_ = now;
      is_line_shown_ = true;
      std::fputs(kClearLine, stderr);
      print_to(stderr, "{}   {:.0f} %   {} of {} {}", what,
               100.0 * static_cast<double>(progress.done) / static_cast<double>(progress.total),
               progress.done, progress.total, unit);
      std::fflush(stderr);
    }
    return !is_stopped_;
  };
}

void FileWork::show(const std::string& what, std::uint64_t done, std::uint64_t total) {
  if (is_stopped_) {
    throw Interrupted();
  }
  const auto now = std::chrono::steady_clock::now();
  if (!is_shown_ || total == 0 || now - drawn_ < kRedrawPeriod) {
    return;
  }
  drawn_ = now;
  is_line_shown_ = true;
  std::fputs(kClearLine, stderr);
  print_to(stderr, "{}   {:.0f} %   {} of {}", what,
           100.0 * static_cast<double>(done) / static_cast<double>(total), bytes_text(done),
           bytes_text(total));
  std::fflush(stderr);
}

Output::Output() {
  std::signal(SIGPIPE, SIG_IGN);
}

bool Output::write(std::string_view text) {
  return write_data(base::printable_lines(text));
}

bool Output::write_data(std::string_view data) {
  return has_taken(std::fwrite(data.data(), 1, data.size(), stdout) == data.size());
}

bool Output::flush() {
  return has_taken(std::fflush(stdout) == 0);
}

bool Output::has_taken(bool is_written) {
  if (is_written || errno == EPIPE) {
    return is_written;
  }
  throw std::runtime_error("standard output: " + std::system_category().message(errno));
}

int print_error(const std::string& command, const std::string& sentence) {
  print_to(stderr, "fastcycle {}: {}\n", command, sentence);
  return kWrong;
}

void print_problem(const std::string& command, const mcap::Problem& problem,
                   const std::string& consequence) {
  print_to(stderr, "fastcycle {}: {}; {}\n", command, to_string(problem), consequence);
}

}  // namespace fastcycle::tool
