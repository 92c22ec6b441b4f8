#include "replay/read_ahead.h"

#include <utility>

namespace fastcycle::host {

ReadAhead::ReadAhead(record::RecordingReader& reader)
    : reader_(reader), thread_([this] { read(); }) {}

ReadAhead::~ReadAhead() {
  {
    const std::lock_guard lock(mutex_);
    is_stopped_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::optional<record::RecordedMessage> ReadAhead::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !messages_.empty() || is_over_; });
  if (messages_.empty()) {
    if (error_ != nullptr) {
      std::rethrow_exception(error_);
    }
    return std::nullopt;
  }
  record::RecordedMessage message = std::move(messages_.front());
  messages_.pop_front();
  bytes_ -= message.data.size();
  changed_.notify_all();
  return message;
}

bool ReadAhead::put(record::RecordedMessage message) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return is_stopped_ || messages_.empty() || bytes_ + message.data.size() <= kBytes;
  });
  bytes_ += message.data.size();
  messages_.push_back(std::move(message));
  changed_.notify_all();
  return !is_stopped_;
}

void ReadAhead::read() {
  std::exception_ptr error;
  try {
    bool is_wanted = true;
    for (auto moment = reader_.next(); is_wanted && !moment.empty(); moment = reader_.next()) {
      for (record::RecordedMessage& message : moment) {
        is_wanted = is_wanted && put(std::move(message));
      }
    }
  } catch (...) {
    error = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  error_ = error;
  is_over_ = true;
  changed_.notify_all();
}

}  // namespace fastcycle::host
