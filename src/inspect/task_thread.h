#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "base/thread.h"

namespace fastcycle::inspect {

/// Executes tasks one after another, on a thread that the first one starts.
///
/// @threads  `post` is safe.
class TaskThread {
 public:
  /// The maximum number of tasks that wait.
  static constexpr std::size_t kMostWaiting = 64;

  explicit TaskThread(std::string name) : name_(std::move(name)) {}
  TaskThread(const TaskThread&) = delete;
  TaskThread& operator=(const TaskThread&) = delete;
  ~TaskThread() { stop(); }

  /// False if `kMostWaiting` tasks wait, or after `stop`.
  ///
  /// @errors  std::system_error if no thread could be created.
  [[nodiscard]] bool post(std::function<void()> task);

  /// Waits for the task that is executed; those after it are dropped. Also repeatedly.
  void stop();

 private:
  void execute();

  const std::string name_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  bool is_stopping_ = false;
  bool is_started_ = false;
  base::Thread thread_;
};

}  // namespace fastcycle::inspect
