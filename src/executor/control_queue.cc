#include "executor/control_queue.h"

#include <algorithm>
#include <mutex>
#include <utility>

namespace fastcycle::detail {

void ControlQueue::post(Control control) {
  const std::lock_guard lock(mutex_);
  posted_.push_back(std::move(control));
  count_.store(posted_.size(), std::memory_order_seq_cst);
}

bool ControlQueue::post_own(Control control) {
  if (own_.size() == kMaxOwn) {
    return false;
  }
  own_.push_back(std::move(control));
  return true;
}

bool ControlQueue::take_posted(Control& control) {
  if (!has_posted()) {
    return false;  // As most of the time: without the lock.
  }
  const std::lock_guard lock(mutex_);
  if (posted_.empty()) {
    return false;
  }
  control = std::move(posted_.front());
  posted_.pop_front();
  count_.store(posted_.size(), std::memory_order_seq_cst);
  return true;
}

std::deque<Control>::iterator ControlQueue::find(Cause cause, std::uint64_t key) {
  return std::ranges::find_if(
      posted_, [&](const Control& posted) { return posted.cause == cause && posted.key == key; });
}

bool ControlQueue::has_posted(Cause cause, std::uint64_t key) {
  const std::lock_guard lock(mutex_);
  return find(cause, key) != posted_.end();
}

bool ControlQueue::take_posted(Cause cause, std::uint64_t key, Control& control) {
  const std::lock_guard lock(mutex_);
  const auto found = find(cause, key);
  if (found == posted_.end()) {
    return false;
  }
  control = std::move(*found);
  posted_.erase(found);
  count_.store(posted_.size(), std::memory_order_seq_cst);
  return true;
}

Control ControlQueue::take_own() {
  Control control = std::move(own_.front());
  own_.pop_front();
  return control;
}

}  // namespace fastcycle::detail
