#include "record/syncer.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace fastcycle::record {
namespace {

Syncer::Outcome carry_out(const Syncer::File& file) {
  Syncer::Outcome outcome{.active = file.active, .asked = file.whole, .whole = {}, .problem = {}};
  try {
    const base::FileState state = file.sink->look();
    outcome.state = state.kind;
    if (state.kind != base::FileState::Kind::kThere) {
      outcome.problem = file.active.string() + ": " + state.words;
    }
    // Also a file that was moved: it has the recorded data.
    file.sink->sync();
    // Its present name may belong to another file.
    if (!file.whole.empty() && state.kind == base::FileState::Kind::kThere) {
      outcome.whole = base::rename_to_next_free(file.active, file.whole);
      base::sync_folder(outcome.whole.parent_path());
    }
  } catch (const std::exception& error) {  // Includes file system errors.
    outcome.problem += (outcome.problem.empty() ? "" : "; ") + std::string(error.what());
  }
  return outcome;
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
    // Only this thread removes it, and a deque does not move its elements when it grows.
    const File& file = files_.front();
    lock.unlock();
    Outcome outcome = carry_out(file);
    lock.lock();
    if (!outcome.problem.empty() || !file.whole.empty()) {
      outcomes_.push_back(std::move(outcome));
    }
    files_.pop_front();
    went_.notify_all();
  }
}

}  // namespace fastcycle::record
