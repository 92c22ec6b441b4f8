#include "progress_line.h"

#include <chrono>
#include <cstdio>

#include <unistd.h>

#include "print.h"
#include "redrawn_line.h"
#include "report/report.h"

namespace fastcycle::tool {
namespace {

/// "1:02:03.4"
std::string clock_text(Duration time) {
  const auto tenths = std::chrono::duration_cast<std::chrono::milliseconds>(time).count() / 100;
  char text[48];
  std::snprintf(text, sizeof(text), "%lld:%02lld:%02lld.%lld",
                static_cast<long long>(tenths / 36000), static_cast<long long>(tenths / 600 % 60),
                static_cast<long long>(tenths / 10 % 60), static_cast<long long>(tenths % 10));
  return text;
}

}  // namespace

ProgressLine::ProgressLine(bool is_wanted) : is_shown_(is_wanted && isatty(STDERR_FILENO) != 0) {}

ProgressLine::~ProgressLine() {
  stop();
}

void ProgressLine::start(const host::Application& application) {
  if (is_shown_) {
    thread_ = std::thread([this, &application] { redraw_until_stopped(application); });
  }
}

void ProgressLine::stop() {
  if (!thread_.joinable()) {
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    is_stopped_ = true;
    stopped_.notify_all();
  }
  thread_.join();
  std::fputs(kClearLine, stderr);
}

void ProgressLine::print(const std::string& text) {
  const std::lock_guard lock(mutex_);
  std::fputs(is_shown_ ? kClearLine : "", stderr);
  tool::print_to(stderr, "{}\n", text);
}

void ProgressLine::redraw_until_stopped(const host::Application& application) {
  using Clock = std::chrono::steady_clock;
  host::Progress before = host::progress_of(application);
  auto drawn = Clock::now();
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, kRedrawPeriod, [this] { return is_stopped_; })) {
    const host::Progress now = host::progress_of(application);
    const double seconds = std::chrono::duration<double>(Clock::now() - drawn).count();
    const std::string length = now.length ? " of " + clock_text(*now.length) : "";
    std::fputs(kClearLine, stderr);
    tool::print_to(stderr, "{}{}   {:.0f} messages/s   {} dropped   {} faults{}",
                   clock_text(now.time), length,
                   static_cast<double>(now.published - before.published) / seconds, now.dropped,
                   now.faults, state());
    std::fflush(stderr);
    before = now;
    drawn = Clock::now();
  }
}

}  // namespace fastcycle::tool
