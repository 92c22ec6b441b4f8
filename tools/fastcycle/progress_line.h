#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "host/application.h"

namespace fastcycle::tool {

/// One line of standard error that shows how the run goes, redrawn twice a second. Where standard
/// error is no terminal nothing is ever written.
///
/// @threads  `print` is Safe; all else is confined to its owner.
class ProgressLine {
 public:
  explicit ProgressLine(bool is_wanted);
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ~ProgressLine();

  /// What else the line shows at its end; on a thread of its own. Set before `start`.
  std::function<std::string()> state = [] { return std::string(); };

  /// Shows `application` from now on, until `stop`.
  void start(const host::Application& application);
  /// Clears the line for good.
  void stop();

  /// Prints a line of text to standard error, in the place of the progress.
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
