#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "host/application.h"

namespace fastcycle::tool {

/// One line of standard error that shows the progress of the run, redrawn twice a second. Writes
/// nothing if standard error is not a terminal.
///
/// @threads  `print` is Safe; all else is confined to its owner.
class ProgressLine {
 public:
  explicit ProgressLine(bool is_wanted);
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ~ProgressLine();

  /// Additional text at the end of the line; called on the redrawing thread. Set before `start`.
  std::function<std::string()> state = [] { return std::string(); };

  /// Shows `application` from now on, until `stop`.
  void start(const host::Application& application);
  /// Removes the line and stops redrawing.
  void stop();

  /// Prints a line of text to standard error in place of the progress.
  void print(const std::string& text);

 private:
  void redraw_until_stopped(const host::Application& application);

  const bool is_shown_;

  std::mutex mutex_;  ///< Guards all below, and standard error.
  std::condition_variable stopped_;
  bool is_stopped_ = false;
  std::thread thread_;
};

}  // namespace fastcycle::tool
