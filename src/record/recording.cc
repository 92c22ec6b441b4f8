#include "record/recording.h"

#include <algorithm>
#include <utility>

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
  std::string digits = std::to_string(number);
  digits.insert(0, digits.size() < 4 ? 4 - digits.size() : 0, '0');
  std::filesystem::path name = options_.file;
  name.replace_filename(options_.file.stem().string() + "_" + digits +
                        options_.file.extension().string());
  return name;
}

Recording::File Recording::make() {
  File file;
  unsigned number = number_;
  do {
    file.whole = name_of(++number);
    file.active = file.whole;
    file.active += ".active";
  } while (std::filesystem::exists(file.whole) || std::filesystem::exists(file.active));
  file.sink = std::make_shared<mcap::FileSink>(file.active);
  try {
    file.writer = std::make_unique<mcap::Writer>(
        *file.sink, mcap::WriterOptions{.profile = "fastcycle", .library = "fastcycle"});
    preamble_(*file.writer);
  } catch (...) {
    // There is no message in it; and on a full disk the next one is begun in a second.
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

/// Ends a file, and has it synced and renamed.
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
    return false;
  }
}

/// Leaves the file as it is.
void Recording::give_up() {
  bytes_before_ += file_.writer->size();
  file_.writer = nullptr;
  tried_ = std::chrono::steady_clock::now();
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
      problem_ = outcome.problem;
      if (file_.writer != nullptr && file_.active == outcome.active) {
        give_up();
      }
      continue;
    }
    for (auto& name : files_) {
      name = name == outcome.active ? outcome.whole : name;
    }
  }
}

bool Recording::write(mcap::ChunkBuilder& chunk) {
  take(syncer_->outcomes());
  const auto now = std::chrono::steady_clock::now();
  if (file_.writer == nullptr) {
    // The last file could not be written. What it has stays; perhaps there is room again.
    if (now - tried_ < kRetry) {
      return false;
    }
    tried_ = now;
    if (!start_next()) {
      return false;
    }
  } else if (is_full(chunk)) {
    // A file that cannot be begun is no reason to lose what fits into this one.
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
