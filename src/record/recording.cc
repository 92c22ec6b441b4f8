#include "record/recording.h"

#include <algorithm>
#include <utility>

#include "base/files.h"
#include "mcap/error.h"

namespace fastcycle::record {
namespace {

constexpr std::chrono::seconds kRetry{1};

}  // namespace

Recording::Recording(Options options, Preamble preamble, Closing closing)
    : options_(std::move(options)), preamble_(std::move(preamble)), closing_(std::move(closing)) {}

Recording::~Recording() = default;

std::filesystem::path Recording::name_of(unsigned number) const {
  if (!options_.splitting.is_on() && number == 1) {
    return options_.file;
  }
  return base::numbered(options_.file, number);
}

/// Null if one of its names is taken. The name of the file while it is written decides between
/// recordings that start at the same time: creation fails for all but one. The final name is
/// checked again after that, since a recording that ends renames its file to it.
std::unique_ptr<mcap::FileSink> Recording::make_sink(const File& file) {
  const auto is_taken = [&] {
    return std::filesystem::exists(std::filesystem::symlink_status(file.whole));
  };
  auto sink = is_taken() ? nullptr : mcap::FileSink::make_if_free(file.active);
  if (sink != nullptr && is_taken()) {
    std::error_code ignored;
    std::filesystem::remove(file.active, ignored);
    return nullptr;
  }
  return sink;
}

Recording::File Recording::make() {
  File file;
  unsigned number = number_;
  do {
    file.whole = name_of(++number);
    file.active = file.whole;
    file.active += ".active";
    file.sink = make_sink(file);
  } while (file.sink == nullptr);
  try {
    file.writer = std::make_unique<mcap::Writer>(
        *file.sink, mcap::WriterOptions{.profile = "fastcycle", .library = "fastcycle"});
    preamble_(*file.writer);
  } catch (...) {
    // It has no messages; and on a full disk the next one is started in a second.
    std::error_code ignored;
    std::filesystem::remove(file.active, ignored);
    throw;
  }
  number_ = number;
  return file;
}

bool Recording::open() {
  syncer_.emplace();
  synced_ = tried_ = std::chrono::steady_clock::now();
  return start_next();
}

bool Recording::is_full(const mcap::ChunkBuilder& next) const {
  if (file_.writer->statistics().message_count == 0) {
    return false;
  }
  const Splitting& limit = options_.splitting;
  if (limit.bytes > 0 &&
      file_.writer->size() + file_.writer->index_bytes() + next.compressed_size() > limit.bytes) {
    return true;
  }
  return limit.time.count() > 0 && file_.first_ns &&
         next.head().message_end_time_ns >=
             *file_.first_ns + static_cast<std::uint64_t>(limit.time.count());
}

/// Closes a file, and has it synced and renamed.
bool Recording::finish(File& file) {
  if (file.writer == nullptr) {
    return false;
  }
  const auto writer = std::exchange(file.writer, nullptr);
  bytes_before_ += writer->size();
  try {
    closing_(*writer);
    writer->close();
    syncer_->sync({.sink = file.sink, .active = file.active, .whole = file.whole});
    return true;
  } catch (const std::exception& error) {
    problem_ = error.what();
    news_.push_back({.active = file.active, .text = problem_});
    return false;
  }
}

/// Leaves the file as it is.
void Recording::give_up() {
  bytes_before_ += file_.writer->size();
  file_.writer = nullptr;
  tried_ = std::chrono::steady_clock::now();
  news_.push_back({.active = file_.active});
}

bool Recording::start_next() {
  try {
    File next = make();
    files_.push_back(next.active);
    if (file_.writer != nullptr) {
      finish(file_);
    }
    file_ = std::move(next);
    return true;
  } catch (const std::exception& error) {
    problem_ = error.what();
    return false;
  }
}

void Recording::sync_if_due() {
  const auto now = std::chrono::steady_clock::now();
  if (options_.sync_interval.count() > 0 && now - synced_ >= options_.sync_interval) {
    syncer_->sync({.sink = file_.sink, .active = file_.active});
    synced_ = now;
  }
}

void Recording::take(const std::vector<Syncer::Outcome>& outcomes) {
  for (const Syncer::Outcome& outcome : outcomes) {
    if (!outcome.problem.empty()) {
      take_problem(outcome);
      continue;
    }
    std::ranges::replace(files_, outcome.active, outcome.whole);
    News news{.active = outcome.active, .is_trouble = false};
    if (outcome.whole != outcome.asked) {
      news.text = outcome.asked.string() +
                  " is another file by now, which is left alone: this log is " +
                  outcome.whole.string();
    }
    news_.push_back(std::move(news));
  }
}

void Recording::take_problem(const Syncer::Outcome& outcome) {
  using Kind = base::FileState::Kind;
  if (outcome.state == Kind::kLost && std::exchange(lost_, outcome.active) == outcome.active) {
    return;  // It was pending again.
  }
  problem_ = outcome.problem;
  const bool is_written = file_.writer != nullptr && file_.active == outcome.active;
  if (outcome.state == Kind::kElsewhere && is_written) {
    // It is complete: perhaps the user moved it there on purpose.
    if (std::exchange(file_.reported, outcome.problem) != outcome.problem) {
      news_.push_back({.active = outcome.active,
                       .text = outcome.problem + "; it is written to its end there",
                       .is_over = false});
    }
    return;
  }
  if (outcome.state == Kind::kLost) {
    std::error_code ignored;
    if (!std::filesystem::exists(outcome.active, ignored)) {
      std::erase(files_, outcome.active);
    }
  }
  if (outcome.state == Kind::kLost || !is_written) {
    const bool is_reported = file_.active == outcome.active && file_.reported == outcome.problem;
    news_.push_back({.active = outcome.active,
                     .text = is_reported ? std::string() : outcome.problem,
                     .is_lost = outcome.state == Kind::kLost});
  }
  if (is_written) {
    give_up();
    // Unlike a full disk, a file lost to others does not delay a new one.
    tried_ -= outcome.state == Kind::kLost ? kRetry : std::chrono::seconds(0);
  }
}

bool Recording::write(mcap::ChunkBuilder& chunk) {
  take(syncer_->outcomes());
  const auto now = std::chrono::steady_clock::now();
  if (file_.writer == nullptr) {
    // The last file could not be written. What it has stays; perhaps there is space again.
    if (now - tried_ < kRetry) {
      return false;
    }
    tried_ = now;
    if (!start_next()) {
      return false;
    }
  } else if (is_full(chunk)) {
    // Failure to create a file is no reason to lose what fits into this one.
    if (now - tried_ >= kRetry || problem_.empty()) {
      tried_ = now;
      start_next();
    }
  }
  try {
    if (!file_.first_ns && chunk.message_count() > 0) {
      file_.first_ns = chunk.head().message_start_time_ns;
    }
    file_.writer->write(chunk);
    sync_if_due();
    return true;
  } catch (const std::exception& error) {
    problem_ = error.what();
    give_up();
    return false;
  }
}

bool Recording::close() {
  bool is_written = finish(file_);
  if (syncer_) {
    const std::vector<Syncer::Outcome> outcomes = syncer_->wait();
    take(outcomes);
    is_written = is_written && std::ranges::all_of(outcomes, [&](const Syncer::Outcome& outcome) {
                   return outcome.active != file_.active || outcome.problem.empty();
                 });
  }
  return is_written;
}

std::uint64_t Recording::bytes() const {
  return bytes_before_ + (file_.writer != nullptr ? file_.writer->size() : 0);
}

}  // namespace fastcycle::record
