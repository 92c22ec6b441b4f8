#include "mcap/file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include "fastcycle/assert.h"
#include "mcap/error.h"

namespace fastcycle::mcap {
namespace {

std::string last_error() {
  return std::system_category().message(errno);
}

/// -1, with errno, if the name exists. With O_APPEND, a file that another program truncated stays
/// too short, without a hole: `look` detects it.
int open_new(const std::filesystem::path& path) {
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0600);
}

}  // namespace

FileSink::FileSink(const std::filesystem::path& path) : FileSink(path, open_new(path)) {
  if (file_ < 0) {
    fail(Place::kWholeFile, "a file that can be made");
  }
}

std::unique_ptr<FileSink> FileSink::make_if_free(const std::filesystem::path& path) {
  const int file = open_new(path);
  if (file < 0 && errno == EEXIST) {
    return nullptr;
  }
  const int error = errno;
  std::unique_ptr<FileSink> sink(new FileSink(path, file));
  if (file < 0) {
    errno = error;
    sink->fail(Place::kWholeFile, "a file that can be made");
  }
  return sink;
}

FileSink::~FileSink() {
  ::close(file_);
}

void FileSink::append(std::span<const Bytes> parts) {
  constexpr std::size_t kMost = 64;  // Parts per call; IOV_MAX is 1024.
  std::size_t done = 0;              // Of the first part.
  while (!parts.empty()) {
    std::array<iovec, kMost> vectors{};
    const std::size_t count = std::min(parts.size(), kMost);
    for (std::size_t i = 0; i < count; ++i) {
      const Bytes rest = i == 0 ? parts[0].subspan(done) : parts[i];
      vectors[i] = {.iov_base = const_cast<std::byte*>(rest.data()), .iov_len = rest.size()};
    }
    const ssize_t written = ::writev(file_, vectors.data(), static_cast<int>(count));
    if (written < 0 && errno != EINTR) {
      fail(size_, "to append to it");
    }
    done += written < 0 ? 0 : static_cast<std::size_t>(written);
    size_ += written < 0 ? 0 : static_cast<std::uint64_t>(written);
    while (!parts.empty() && done >= parts[0].size()) {
      done -= parts[0].size();
      parts = parts.subspan(1);
    }
  }
}

void FileSink::sync() {
  if (::fdatasync(file_) != 0) {
    fail(Place::kWholeFile, "to get it onto the disk");
  }
}

void FileSink::fail(std::uint64_t offset, const char* expected) const {
  throw Error({.place = {.file = name_, .offset = offset},
               .record = {},
               .expected = expected,
               .found = last_error()});
}

FileSource::FileSource(const std::filesystem::path& path)
    : name_(path.string()),
      // O_NONBLOCK: a FIFO without a writer would block. It has no effect on regular files.
      file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (file_ < 0) {
    fail(Place::kWholeFile, "a file that can be read", last_error());
  }
  struct stat status{};
  if (::fstat(file_, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(file_);
    fail(Place::kWholeFile, "a regular file",
         S_ISDIR(status.st_mode) ? "a folder" : "something else");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

FileSource::~FileSource() {
  ::close(file_);
}

void FileSource::read(std::uint64_t offset, std::span<std::byte> into) const {
  while (!into.empty()) {
    const ssize_t got = ::pread(file_, into.data(), into.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got < 0) {
      fail(offset, "to read it", last_error());
    }
    if (got == 0) {
      fail(offset, "more bytes, as when it was opened", "its end");
    }
    into = into.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
}

void FileSource::fail(std::uint64_t offset, const char* expected, const std::string& found) const {
  throw Error({.place = {.file = name_, .offset = offset},
               .record = {},
               .expected = expected,
               .found = found});
}

void MemorySink::append(std::span<const Bytes> parts) {
  for (const Bytes part : parts) {
    bytes_.insert(bytes_.end(), part.begin(), part.end());
  }
}

void MemorySource::read(std::uint64_t offset, std::span<std::byte> into) const {
  FASTCYCLE_ASSERT(offset <= bytes_.size() && into.size() <= bytes_.size() - offset,
                   "a source is read within its size");
  std::ranges::copy(bytes_.subspan(offset, into.size()), into.begin());
}

}  // namespace fastcycle::mcap
