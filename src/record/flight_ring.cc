#include "record/flight_ring.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "mcap/crc.h"
#include "mcap/error.h"

namespace fastcycle::record {
namespace {

constexpr std::array<char, 8> kMagic{'F', 'C', 'R', 'I', 'N', 'G', '\r', '\n'};
constexpr std::uint32_t kVersion = 1;
constexpr std::uint64_t kPage = 4096;
constexpr std::uint64_t kAlignment = 8;
constexpr std::uint64_t kBlock = std::uint64_t{1} << 20U;  // Minimum size of a read.
constexpr std::uint64_t kExplanationBytesMax = std::uint64_t{256} << 20U;
constexpr std::uint16_t kFiller = 0xFFFF;  // No further record fits before the end of the ring.

// Constant part of a header. Numbers are in host byte order.
struct Constant {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t pid = 0;
  std::uint64_t capacity = 0;
  std::uint64_t explanation_size = 0;
  std::int64_t start_ns = 0;
  std::uint32_t explanation_crc = 0;
  std::uint32_t unused = 0;
  std::array<char, 40> boot_id{};
};

// Variable part, as read from a file without a writer.
struct Changing {
  std::uint64_t tail = 0;
  std::uint64_t head = 0;
  std::uint64_t wakes = 0;
  std::uint64_t is_closed = 0;
};

constexpr std::size_t kChangingOffset = 128;
constexpr std::size_t kNoteOffset = 512;
static_assert(kNoteOffset + sizeof(diagnostics::CrashNote) <= kPage);

struct RecordHead {
  std::uint32_t size = 0;  // Of the data.
  std::uint16_t kind = 0;
  std::uint16_t unused = 0;
  std::uint64_t position = 0;  // Its position, so that no old data is mistaken for it.
  std::uint64_t number = 0;
  std::int64_t time_ns = 0;
  std::uint32_t data_crc = 0;
  std::uint32_t head_crc = 0;  // Of all before it.
};
static_assert(sizeof(RecordHead) == 40);
static_assert(sizeof(Constant) + sizeof(std::uint32_t) <= kChangingOffset);

template <typename T>
mcap::Bytes bytes_of(const T& value, std::size_t size = sizeof(T)) {
  return std::as_bytes(std::span(&value, 1)).first(size);
}

std::uint32_t crc_of(mcap::Bytes bytes) {
  mcap::Crc crc;
  crc.add(bytes);
  return crc.value();
}

std::uint32_t head_crc_of(const RecordHead& head) {
  return crc_of(bytes_of(head, offsetof(RecordHead, head_crc)));
}

constexpr std::uint64_t rounded_up(std::uint64_t size, std::uint64_t step) {
  return (size + step - 1) / step * step;
}

/// Size of a record in the ring.
constexpr std::uint64_t whole_size(std::uint64_t data_size) {
  return rounded_up(sizeof(RecordHead) + data_size, kAlignment);
}

std::string last_error(int error = errno) {
  return std::system_category().message(error);
}

[[noreturn]] void fail_at(const std::filesystem::path& file, std::string expected,
                          std::string found) {
  throw mcap::Error({.place = {.file = file.string()},
                     .record = {},
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

/// Opens the file itself, not the target of a link, and locks it against writers. -1 on failure.
int open_left_file(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0 && errno == ENOENT) {
    return -1;
  }
  if (descriptor < 0) {
    fail_at(file, "a file that can be read",
            errno == ELOOP ? "a symbolic link" : last_error(errno));
  }
  struct stat status{};
  const bool is_file = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
  const bool is_free = is_file && ::flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  if (!is_free) {
    ::close(descriptor);
    fail_at(file, is_file ? "a ring that nobody writes" : "a regular file",
            is_file ? "one that a process writes" : "something else");
  }
  return descriptor;
}

bool has_magic(int descriptor) {
  std::array<char, kMagic.size()> magic{};
  const ssize_t got = ::pread(descriptor, magic.data(), magic.size(), 0);
  return got == static_cast<ssize_t>(magic.size()) && magic == kMagic;
}

/// Removes the ring of a former run. A file that is no ring stays, and is an error.
void remove_left_file(const std::filesystem::path& file) {
  const int descriptor = open_left_file(file);
  if (descriptor < 0) {
    return;
  }
  const bool is_ring = has_magic(descriptor);
  const bool is_gone = is_ring && ::unlink(file.c_str()) == 0;
  const int error = errno;
  ::close(descriptor);
  if (!is_gone) {
    fail_at(file, is_ring ? "a file that can be replaced" : "the ring of a former run, or no file",
            is_ring ? last_error(error) : "a file that is no ring; it is left alone");
  }
}

std::array<char, 40> present_boot_id() {
  std::array<char, 40> id{};
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  file.read(id.data(), static_cast<std::streamsize>(id.size()) - 1);
  std::ranges::replace(id, '\n', '\0');
  return id;
}

}  // namespace

struct FlightRing::Header {
  Constant constant;
  std::uint32_t constant_crc;
  alignas(kChangingOffset) std::atomic<std::uint64_t> tail;
  std::atomic<std::uint64_t> head;
  std::atomic<std::uint64_t> wakes;
  std::atomic<std::uint64_t> is_closed;
};

FlightRing::FlightRing(const Options& options, mcap::Bytes explanation)
    : file_(options.file),
      capacity_(rounded_up(std::max(options.bytes, kPage), kPage)),
      ring_offset_(kPage + rounded_up(explanation.size(), kPage)),
      start_ns_(options.start_ns),
      explanation_(explanation.begin(), explanation.end()) {
  static_assert(sizeof(Header) <= kPage && std::atomic<std::uint64_t>::is_always_lock_free);
  static_assert(sizeof(std::atomic<std::uint64_t>) == sizeof(std::uint64_t));
  static_assert(offsetof(Header, tail) == kChangingOffset);
  if (explanation.size() > kExplanationBytesMax) {
    fail_at(file_, "at most 256 MiB of schemas", std::to_string(explanation.size()) + " bytes");
  }
  remove_left_file(file_);
  // Renamed when it is complete: a file of that name is always a ring.
  std::filesystem::path unfinished = file_;
  unfinished += ".new";
  ::unlink(unfinished.c_str());
  try {
    make_file(unfinished);
    fill(options, explanation);
    if (::rename(unfinished.c_str(), file_.c_str()) != 0) {
      fail_at(file_, "a name that can be given", last_error());
    }
  } catch (...) {
    ::unlink(unfinished.c_str());
    throw;
  }
}

FlightRing::~FlightRing() = default;

void FlightRing::make_file(const std::filesystem::path& file) {
  const std::uint64_t size = ring_offset_ + capacity_;
  const int descriptor =
      ::open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (descriptor < 0) {
    fail_at(file_, "a file that can be made", last_error());
  }
  map(descriptor, size);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    fail_at(file_, "a file that can be locked", last_error());
  }
  int error = EINTR;
  while (error == EINTR) {
    error = ::posix_fallocate(descriptor, 0, static_cast<off_t>(size));
  }
  if (error != 0) {
    fail_at(file_, "room for a ring of " + std::to_string(size) + " bytes", last_error(error));
  }
  ring_ = memory_ + ring_offset_;
  for (std::uint64_t page = 0; page < size; page += kPage) {
    *static_cast<volatile std::byte*>(memory_ + page) = std::byte{0};
  }
}

/// Takes over `descriptor`.
void FlightRing::map(int descriptor, std::uint64_t size) {
  try {
    mapped_.emplace(descriptor, size);
  } catch (const std::system_error& error) {
    fail_at(file_, "a file that can be mapped", error.code().message());
  }
  memory_ = mapped_->memory();
}

base::FileState FlightRing::look() const {
  return base::look_at(mapped_->descriptor(), file_, ring_offset_ + capacity_);
}

void FlightRing::forget() noexcept {
  tail_ = head_;
  header_->tail.store(tail_, std::memory_order_relaxed);
  header_->head.store(head_, std::memory_order_release);
}

void FlightRing::fill(const Options& options, mcap::Bytes explanation) {
  header_ = new (memory_) Header{};
  header_->constant = {.pid = static_cast<std::uint32_t>(::getpid()),
                       .capacity = capacity_,
                       .explanation_size = explanation.size(),
                       .start_ns = options.start_ns,
                       .explanation_crc = crc_of(explanation),
                       .boot_id = present_boot_id()};
  header_->constant_crc = crc_of(bytes_of(header_->constant));
  new (memory_ + kNoteOffset) diagnostics::CrashNote;
  std::ranges::copy(explanation, memory_ + kPage);
}

diagnostics::CrashNote& FlightRing::crash_note() const noexcept {
  return *reinterpret_cast<diagnostics::CrashNote*>(memory_ + kNoteOffset);
}

std::uint64_t FlightRing::size_at(std::uint64_t position) const noexcept {
  const std::uint64_t rest = capacity_ - position % capacity_;
  if (rest < sizeof(RecordHead)) {
    return rest;
  }
  RecordHead head;
  std::memcpy(&head, ring_ + position % capacity_, sizeof(head));
  const std::uint64_t size = whole_size(head.size);
  // If others overwrote the record in the file: skip everything.
  return head.position == position && size <= rest ? size : head_ - position;
}

void FlightRing::give_up(std::uint64_t until) noexcept {
  if (until - tail_ <= capacity_) {
    return;
  }
  while (tail_ < head_ && until - tail_ > capacity_) {
    tail_ += size_at(tail_);
  }
  header_->tail.store(tail_, std::memory_order_relaxed);
  // No later store may become visible before that.
  std::atomic_thread_fence(std::memory_order_release);
}

void FlightRing::write_head(std::uint64_t position, std::uint16_t kind, std::int64_t time_ns,
                            std::uint64_t size, std::uint32_t data_crc) noexcept {
  RecordHead head{.size = static_cast<std::uint32_t>(size),
                  .kind = kind,
                  .position = position,
                  .number = number_,
                  .time_ns = time_ns,
                  .data_crc = data_crc};
  head.head_crc = head_crc_of(head);
  std::memcpy(ring_ + position % capacity_, &head, sizeof(head));
}

bool FlightRing::append(std::uint16_t kind, std::int64_t time_ns,
                        std::span<const mcap::Bytes> parts) noexcept {
  std::uint64_t size = 0;
  for (const mcap::Bytes part : parts) {
    size += part.size();
  }
  const std::uint64_t whole = whole_size(size);
  if (size > kRecordBytesMax || whole > capacity_ / 2) {
    return false;
  }
  std::uint64_t position = head_;
  const std::uint64_t rest = capacity_ - position % capacity_;
  if (whole > rest) {
    give_up(position + rest);
    if (rest >= sizeof(RecordHead)) {
      write_head(position, kFiller, time_ns, rest - sizeof(RecordHead), 0);
    }
    position += rest;
  }
  give_up(position + whole);
  std::byte* to = ring_ + position % capacity_ + sizeof(RecordHead);
  mcap::Crc crc;
  for (mcap::Bytes part : parts) {
    while (!part.empty()) {
      constexpr std::size_t kAtOnce = std::size_t{64} << 10U;  // Still in the cache for the CRC.
      const mcap::Bytes some = part.first(std::min(part.size(), kAtOnce));
      std::memcpy(to, some.data(), some.size());
      crc.add(some);
      to += some.size();
      part = part.subspan(some.size());
    }
  }
  write_head(position, kind, time_ns, size, crc.value());
  ++number_;
  head_ = position + whole;
  header_->head.store(head_, std::memory_order_release);
  return true;
}

void FlightRing::count_wake() noexcept {
  header_->wakes.store(header_->wakes.load(std::memory_order_relaxed) + 1,
                       std::memory_order_release);
}

void FlightRing::close() noexcept {
  header_->is_closed.store(1, std::memory_order_release);
}

std::uint64_t FlightRing::oldest() const noexcept {
  return header_->tail.load(std::memory_order_acquire);
}
std::uint64_t FlightRing::newest() const noexcept {
  return header_->head.load(std::memory_order_acquire);
}
std::uint64_t FlightRing::wakes() const noexcept {
  return header_->wakes.load(std::memory_order_acquire);
}

// ---- Reading ----

FlightRingReader::FlightRingReader(const std::filesystem::path& file)
    : file_(file), descriptor_(open_left_file(file)) {
  if (descriptor_ < 0) {
    fail(mcap::Place::kWholeFile, "a file that can be read", last_error(ENOENT));
  }
  try {
    read_header();
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

FlightRingReader::FlightRingReader(const FlightRing& ring, const FlightMark& from)
    : file_(ring.file()),
      live_(&ring),
      descriptor_(ring.mapped_->descriptor()),
      capacity_(ring.capacity_),
      ring_offset_(ring.ring_offset_),
      explanation_(ring.explanation_),
      start_ns_(ring.start_ns_),
      pid_(static_cast<std::uint32_t>(::getpid())),
      boot_id_(present_boot_id().data()),
      wakes_(ring.wakes()),
      position_(from.position),
      end_(ring.head_),
      next_number_(from.number),
      end_number_(ring.number_) {}

FlightRingReader::~FlightRingReader() {
  if (live_ == nullptr) {
    ::close(descriptor_);
  }
}

void FlightRingReader::read_header() {
  struct stat status{};
  if (::fstat(descriptor_, &status) != 0) {
    fail(mcap::Place::kWholeFile, "a file that can be read", last_error());
  }
  const auto size = static_cast<std::uint64_t>(status.st_size);
  if (size < 2 * kPage) {
    damaged(mcap::Place::kWholeFile, "a ring of at least 8192 bytes",
            std::to_string(size) + " bytes");
  }
  Constant constant;
  std::uint32_t crc = 0;
  Changing changing;
  read(0, std::as_writable_bytes(std::span(&constant, 1)));
  read(sizeof(constant), std::as_writable_bytes(std::span(&crc, 1)));
  read(kChangingOffset, std::as_writable_bytes(std::span(&changing, 1)));
  if (constant.magic != kMagic) {
    damaged(0, "the beginning of a ring", "something else");
  }
  if (constant.version != kVersion) {
    damaged(0, "version " + std::to_string(kVersion), std::to_string(constant.version));
  }
  if (crc_of(bytes_of(constant)) != crc) {
    damaged(0, "a header with the right CRC", "another one");
  }
  capacity_ = constant.capacity;
  ring_offset_ = kPage + rounded_up(constant.explanation_size, kPage);
  const bool has_sizes = constant.explanation_size <= kExplanationBytesMax &&
                         capacity_ % kPage == 0 && capacity_ > 0 && capacity_ < size &&
                         ring_offset_ + capacity_ == size;
  if (!has_sizes) {
    damaged(0, "the size that its header says", std::to_string(size) + " bytes");
  }
  const bool has_ends = changing.tail <= changing.head &&
                        changing.head - changing.tail <= capacity_ &&
                        changing.tail % kAlignment == 0 && changing.head % kAlignment == 0;
  if (!has_ends) {
    damaged(kChangingOffset, "where its records begin and end", "numbers that cannot be");
  }
  start_ns_ = constant.start_ns;
  pid_ = constant.pid;
  constant.boot_id.back() = '\0';
  boot_id_ = constant.boot_id.data();
  is_closed_ = changing.is_closed != 0;
  wakes_ = changing.wakes;
  position_ = changing.tail;
  end_ = changing.head;
  read_explanation(constant.explanation_size, constant.explanation_crc);
  diagnostics::CrashNote note;
  read(kNoteOffset, std::as_writable_bytes(std::span(&note, 1)));
  if (note.magic == diagnostics::CrashNote::kMagic) {
    note.component.back() = note.summary.back() = '\0';
    note.text_size = std::min<std::uint32_t>(note.text_size, note.text.size());
    note_ = note;
  }
}

void FlightRingReader::read_explanation(std::uint64_t size, std::uint32_t crc) {
  explanation_.resize(size);
  read(kPage, explanation_);
  if (crc_of(explanation_) != crc) {
    damaged(kPage, "an explanation with the right CRC", "another one");
  }
}

void FlightRingReader::read(std::uint64_t offset, std::span<std::byte> into) const {
  if (live_ != nullptr && live_->is_cut()) {
    std::memcpy(into.data(), live_->memory_ + offset, into.size());
    return;
  }
  while (!into.empty()) {
    const ssize_t got = ::pread(descriptor_, into.data(), into.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got == 0 && live_ != nullptr) {
      // Truncated, and the writer has not noticed yet: there is no data.
      std::ranges::fill(into, std::byte{0});
      return;
    }
    if (got <= 0) {
      fail(offset, "to read it", got == 0 ? "its end" : last_error());
    }
    into = into.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
}

/// Whether `size` bytes from the present position on are now in `bytes_`. If not, they were
/// overwritten meanwhile, and the position was advanced.
///
/// @pre  They are before `end_`, and before the end of the ring's memory.
bool FlightRingReader::fetch(std::uint64_t size) {
  const std::uint64_t position = position_;
  if (position >= begin_ && position + size <= begin_ + bytes_.size()) {
    return true;
  }
  const std::uint64_t rest = capacity_ - position % capacity_;
  bytes_.resize(std::min({std::max(size, kBlock), rest, end_ - position}));
  begin_ = position;
  read(ring_offset_ + begin_ % capacity_, bytes_);
  if (live_ != nullptr) {
    // The writer releases old records before it stores anything else.
    std::atomic_thread_fence(std::memory_order_acquire);
    position_ = std::max(position, live_->oldest());
  }
  return position_ == position;
}

/// The fetched bytes.
mcap::Bytes FlightRingReader::fetched(std::uint64_t size) const {
  return mcap::Bytes(bytes_).subspan(position_ - begin_, size);
}

std::optional<FlightRecord> FlightRingReader::next() {
  while (position_ < end_) {
    const std::uint64_t rest = std::min(capacity_ - position_ % capacity_, end_ - position_);
    if (rest < sizeof(RecordHead)) {
      position_ += rest;
      continue;
    }
    if (!fetch(sizeof(RecordHead))) {
      continue;
    }
    RecordHead head;
    std::memcpy(&head, fetched(sizeof(head)).data(), sizeof(head));
    const std::uint64_t whole = whole_size(head.size);
    const bool is_head = head.head_crc == head_crc_of(head) && head.position == position_ &&
                         head.size <= FlightRing::kRecordBytesMax && whole <= rest &&
                         head.number >= next_number_.value_or(0);
    if (!is_head) {
      position_ += kAlignment;  // The next complete head gives the position.
      continue;
    }
    if (!fetch(whole)) {
      continue;
    }
    const mcap::Bytes data = fetched(whole).subspan(sizeof(RecordHead), head.size);
    position_ += whole;
    if (head.kind == kFiller || crc_of(data) != head.data_crc) {
      continue;
    }
    missing_ += head.number - next_number_.value_or(head.number);
    next_number_ = head.number + 1;
    return FlightRecord{
        .kind = head.kind, .number = head.number, .time_ns = head.time_ns, .data = data};
  }
  if (end_number_) {
    missing_ += *end_number_ - std::exchange(next_number_, end_number_).value_or(*end_number_);
  }
  return std::nullopt;
}

bool begins_as_ring(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    return false;
  }
  const bool is_ring = has_magic(descriptor);
  ::close(descriptor);
  return is_ring;
}

void FlightRingReader::fail(std::uint64_t offset, std::string expected, std::string found) const {
  throw mcap::Error({.place = {.file = file_.string(), .offset = offset},
                     .record = {},
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

void FlightRingReader::damaged(std::uint64_t offset, std::string expected,
                               std::string found) const {
  throw mcap::Damage({.place = {.file = file_.string(), .offset = offset},
                      .record = {},
                      .expected = std::move(expected),
                      .found = std::move(found)});
}

}  // namespace fastcycle::record
