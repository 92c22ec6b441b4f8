#include "inspect/task_thread.h"

#include <utility>
#include <vector>

namespace fastcycle::inspect {

bool TaskThread::post(std::function<void()> task) {
  const std::lock_guard lock(mutex_);
  if (is_stopping_ || tasks_.size() >= kMostWaiting) {
    return false;
  }
  if (!is_started_) {
    std::vector<base::Refusal> none;  // It has no priority and no CPUs of its own.
    thread_ = base::Thread({.name = name_, .cpus = {}}, [this] { execute(); }, none);
    is_started_ = true;
  }
  tasks_.push_back(std::move(task));
  changed_.notify_one();
  return true;
}

void TaskThread::stop() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    tasks_.clear();
    if (!std::exchange(is_started_, false)) {
      return;
    }
    changed_.notify_one();
  }
  thread_.join();
}

void TaskThread::execute() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return is_stopping_ || !tasks_.empty(); });
    if (is_stopping_) {
      return;
    }
    const std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
    lock.lock();
  }
}

}  // namespace fastcycle::inspect
