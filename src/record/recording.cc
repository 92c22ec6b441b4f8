#include "record/recording.h"

#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "mcap/error.h"

namespace fastcycle::record {
namespace {

constexpr std::chrono::seconds kRetry{1};

/// Makes the name of a file in `folder` outlive a power cut.
void sync_folder(const std::filesystem::path& folder) noexcept {
  const int file =
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file >= 0) {
    fsync(file);
    ::close(file);
  }
}

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
  file.sink = std::make_unique<mcap::FileSink>(file.active);
  number_ = number;
  file.writer = std::make_unique<mcap::Writer>(
      *file.sink, mcap::WriterOptions{.profile = "fastcycle", .library = "fastcycle"});
  preamble_(*file.writer);
  return file;
}

bool Recording::open() {
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

bool Recording::finish(File& file) {
  if (file.writer == nullptr) {
    return false;
  }
  const auto writer = std::exchange(file.writer, nullptr);
  bytes_before_ += writer->size();
  try {
    closing_(*writer);
    writer->close();
    file.sink->sync();
    std::filesystem::rename(file.active, file.whole);
    sync_folder(file.whole.parent_path());
    for (auto& name : files_) {
      name = name == file.active ? file.whole : name;
    }
    return true;
  } catch (const std::exception& error) {  // Also those of the file system.
    problem_ = error.what();
    return false;
  }
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
    file_.sink->sync();
    synced_ = std::chrono::steady_clock::now();
  }
}

bool Recording::write(mcap::ChunkBuilder& chunk) {
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
    bytes_before_ += file_.writer->size();
    file_.writer = nullptr;
    tried_ = now;
    return false;
  }
}

bool Recording::close() {
  return finish(file_);
}

std::uint64_t Recording::bytes() const {
  return bytes_before_ + (file_.writer != nullptr ? file_.writer->size() : 0);
}

}  // namespace fastcycle::record
