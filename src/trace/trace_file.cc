#include "trace/trace_file.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <utility>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

namespace fastcycle::trace {

TraceFile::TraceFile(std::filesystem::path file, std::uint64_t buffer_bytes,
                     std::vector<std::filesystem::path> inputs)
    : file_(std::move(file)), buffer_bytes_(buffer_bytes), inputs_(std::move(inputs)) {}

TraceFile::~TraceFile() {
  close();
}

void TraceFile::open() {
  output_.emplace(file_, inputs_);
  output_->commit();  // So that the trace of a crashed run is found, too.
}

void TraceFile::start(std::vector<base::Refusal>& refusals) {
  writing_ =
      base::Thread({.name = "trace-write", .cpus = {}}, [this] { write_chunks(); }, refusals);
  is_started_ = true;
}

bool TraceFile::append(std::string_view bytes, bool waits) {
  std::unique_lock lock(mutex_);
  const auto fits = [&] { return waiting_ + bytes.size() <= buffer_bytes_ || waiting_ == 0; };
  if (waits) {
    has_room_.wait(lock, [&] { return fits() || !problem_.empty(); });
  }
  if (!problem_.empty() || !fits()) {
    return false;
  }
  if (chunks_.empty() || chunks_.back().size() + bytes.size() > kChunk) {
    chunks_.emplace_back().reserve(kChunk);
    changed_.notify_one();
  }
  chunks_.back().append(bytes);
  waiting_ += bytes.size();
  return true;
}

bool TraceFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t size = ::write(output_->descriptor(), bytes.data(), bytes.size());
    if (size < 0 && errno == EINTR) {
      continue;
    }
    if (size < 0) {
      return false;
    }
    bytes.remove_prefix(static_cast<std::size_t>(size));
    written_ += static_cast<std::uint64_t>(size);
  }
  return true;
}

void TraceFile::write_chunks() {
  using namespace std::chrono_literals;
  // On Linux this affects only the calling thread.
  static_cast<void>(setpriority(PRIO_PROCESS, 0, 19));
  std::unique_lock lock(mutex_);
  while (!is_closing_ || !chunks_.empty()) {
    // A chunk that is still being filled is written a little later.
    changed_.wait_for(lock, 100ms, [this] { return is_closing_ || chunks_.size() > 1; });
    if (chunks_.empty()) {
      continue;
    }
    const std::string chunk = std::move(chunks_.front());
    chunks_.pop_front();
    lock.unlock();
    const bool is_written = write(chunk);
    const int error = errno;
    lock.lock();
    waiting_ -= chunk.size();
    if (!is_written) {
      problem_ = file_.string() + ": " + std::strerror(error);
      chunks_.clear();
      waiting_ = 0;
    }
    has_room_.notify_all();
  }
}

/// Whether its name leads to it, and it is no stream. While it is open.
bool TraceFile::has_own_name() const {
  struct stat own{};
  struct stat named{};
  return ::fstat(output_->descriptor(), &own) == 0 && ::lstat(file_.c_str(), &named) == 0 &&
         S_ISREG(own.st_mode) && own.st_dev == named.st_dev && own.st_ino == named.st_ino;
}

void TraceFile::close() {
  {
    const std::lock_guard lock(mutex_);
    is_closing_ = true;
    changed_.notify_all();
  }
  if (std::exchange(is_started_, false)) {
    writing_.join();
  }
  if (!output_ || output_->descriptor() < 0) {
    return;
  }
  const bool may_be_removed = has_own_name();
  try {
    output_->close();
  } catch (const std::runtime_error& error) {
    problem_ = problem_.empty() ? error.what() : problem_;
  }
  if (!problem_.empty() && may_be_removed && ::unlink(file_.c_str()) == 0) {
    problem_ += "; it was removed";
    written_ = 0;
  }
}

}  // namespace fastcycle::trace
