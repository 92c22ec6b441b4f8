#include "record/syncer.h"

#include <algorithm>
#include <exception>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace fastcycle::record {
namespace {

/// Makes the name of a file in `folder` outlive a power cut.
void sync_folder(const std::filesystem::path& folder) noexcept {
  const int file =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file >= 0) {
    fsync(file);
    ::close(file);
  }
}

/// Says what went wrong; empty if nothing did.
std::string carry_out(const Syncer::File& file) {
  try {
    file.sink->sync();
    if (!file.whole.empty()) {
      std::filesystem::rename(file.active, file.whole);
      sync_folder(file.whole.parent_path());
    }
    return {};
  } catch (const std::exception& error) {  // Also those of the file system.
    return error.what();
  }
}

}  // namespace

Syncer::Syncer() : thread_({.name = "record-sync", .cpus = {}}, [this] { run(); }, refusals_) {}

Syncer::~Syncer() {
  {
    const std::lock_guard lock(mutex_);
    stops_ = true;
  }
  came_.notify_one();
  thread_.join();
}

void Syncer::sync(File file) {
  std::unique_lock lock(mutex_);
  const auto is_same = [&](const File& other) { return other.sink == file.sink; };
  if (file.whole.empty() && std::ranges::any_of(files_, is_same)) {
    return;
  }
  went_.wait(lock, [this] { return files_.size() < kMostFiles; });
  files_.push_back(std::move(file));
  came_.notify_one();
}

std::vector<Syncer::Outcome> Syncer::outcomes() {
  const std::lock_guard lock(mutex_);
  return std::exchange(outcomes_, {});
}

std::vector<Syncer::Outcome> Syncer::wait() {
  std::unique_lock lock(mutex_);
  went_.wait(lock, [this] { return files_.empty(); });
  return std::exchange(outcomes_, {});
}

void Syncer::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    came_.wait(lock, [this] { return !files_.empty() || stops_; });
    if (files_.empty()) {
      return;
    }
    // Only this thread takes it away, and a deque that grows leaves it where it is.
    const File& file = files_.front();
    lock.unlock();
    std::string problem = carry_out(file);
    lock.lock();
    if (!problem.empty() || !file.whole.empty()) {
      outcomes_.push_back({file.active, file.whole, std::move(problem)});
    }
    files_.pop_front();
    went_.notify_all();
  }
}

}  // namespace fastcycle::record
