#include "processes/notices.h"

#include <climits>
#include <cstring>
#include <mutex>
#include <span>

namespace fastcycle::processes {

using segment::NoticeWords;
using segment::ProcessIndex;
using segment::SnapshotWords;

namespace {

constexpr std::size_t kWordBytes = sizeof(std::uint64_t);

std::size_t words_of(std::size_t bytes) {
  return (bytes + kWordBytes - 1) / kWordBytes;
}

/// Calls `put(i, word)` with each word of `text`; the last one is filled up with zeros.
template <typename Put>
void put_words(std::string_view text, const Put& put) {
  for (std::size_t i = 0; i < words_of(text.size()); ++i) {
    const std::string_view part = text.substr(i * kWordBytes, kWordBytes);
    std::uint64_t word = 0;
    std::memcpy(&word, part.data(), part.size());
    put(i, word);
  }
}

/// The inverse.
template <typename Get>
std::string get_words(std::size_t bytes, const Get& get) {
  std::string text(words_of(bytes) * kWordBytes, '\0');
  for (std::size_t i = 0; i < words_of(bytes); ++i) {
    const std::uint64_t word = get(i);
    std::memcpy(text.data() + i * kWordBytes, &word, kWordBytes);
  }
  text.resize(bytes);
  return text;
}

}  // namespace

Notices::Notices(const segment::Wire& wire, ProcessIndex process, std::uint32_t incarnation)
    : wire_(wire),
      own_(wire.notices(process, incarnation)),
      own_snapshot_(wire.snapshot(process, incarnation)),
      readers_(wire.plan().processes) {}

bool Notices::send(std::string_view record) {
  if (record.size() > kMaxRecord) {
    return false;
  }
  {
    const std::lock_guard lock(mutex_);
    const std::uint64_t begin = own_.end.load(std::memory_order_relaxed);
    const std::uint64_t end = begin + 1 + words_of(record.size());
    const auto at = [this](std::uint64_t place) -> std::atomic<std::uint64_t>& {
      return own_.ring[place % NoticeWords::kWords];
    };
    own_.begun.store(end, std::memory_order_seq_cst);
    at(begin).store(record.size(), std::memory_order_relaxed);
    put_words(record, [&](std::size_t i, std::uint64_t word) {
      at(begin + 1 + i).store(word, std::memory_order_relaxed);
    });
    own_.end.store(end, std::memory_order_seq_cst);
    own_.count.fetch_add(1, std::memory_order_seq_cst);
  }
  segment::wake(own_.count, INT_MAX);
  return true;
}

std::uint64_t Notices::sent() const noexcept {
  return own_.end.load(std::memory_order_seq_cst);
}

void Notices::follow(ProcessIndex process, std::uint32_t incarnation, std::uint64_t position) {
  readers_[process] = {.incarnation = incarnation, .position = position};
}

std::optional<std::string> Notices::next(ProcessIndex process, std::uint64_t end) {
  Reader& reader = readers_[process];
  if (reader.incarnation == 0) {
    return std::nullopt;
  }
  const NoticeWords& its = wire_.notices(process, reader.incarnation);
  if (reader.position >= end || reader.position >= its.end.load(std::memory_order_seq_cst)) {
    return std::nullopt;
  }
  const auto at = [&](std::uint64_t place) {
    return its.ring[place % NoticeWords::kWords].load(std::memory_order_relaxed);
  };
  const std::uint64_t bytes = at(reader.position);
  std::string record;
  if (bytes <= kMaxRecord) {
    record = get_words(bytes, [&](std::size_t i) { return at(reader.position + 1 + i); });
  }
  std::atomic_thread_fence(std::memory_order_seq_cst);
  if (bytes > kMaxRecord ||
      its.begun.load(std::memory_order_seq_cst) - reader.position > NoticeWords::kWords) {
    has_lost_ = true;
    reader.position = its.end.load(std::memory_order_seq_cst);
    return std::nullopt;
  }
  reader.position += 1 + words_of(bytes);
  return record;
}

base::WatchedWord Notices::word_of(ProcessIndex process) const noexcept {
  const auto& word = wire_.notices(process, readers_[process].incarnation).count;
  return {.word = &word, .seen = word.load(std::memory_order_seq_cst)};
}

bool Notices::put_snapshot(std::string_view text) {
  if (words_of(text.size()) > SnapshotWords::kWords) {
    return false;
  }
  const std::lock_guard lock(mutex_);
  own_snapshot_.version.fetch_add(1, std::memory_order_seq_cst);
  own_snapshot_.bytes.store(text.size(), std::memory_order_relaxed);
  put_words(text, [this](std::size_t i, std::uint64_t word) {
    own_snapshot_.words[i].store(word, std::memory_order_relaxed);
  });
  own_snapshot_.version.fetch_add(1, std::memory_order_seq_cst);
  return true;
}

std::optional<std::string> Notices::snapshot_of(ProcessIndex process) const {
  constexpr int kTries = 1000;  // Its writer may have ended in the middle.
  const std::uint32_t incarnation = wire_.incarnation(process).load(std::memory_order_seq_cst);
  if (incarnation == 0) {
    return std::nullopt;
  }
  const SnapshotWords& its = wire_.snapshot(process, incarnation);
  for (int i = 0; i < kTries; ++i) {
    const std::uint64_t version = its.version.load(std::memory_order_seq_cst);
    if (version == 0) {
      return std::nullopt;
    }
    const std::uint64_t bytes = its.bytes.load(std::memory_order_relaxed);
    if (version % 2 == 0 && words_of(bytes) <= SnapshotWords::kWords) {
      std::string text = get_words(
          bytes, [&](std::size_t word) { return its.words[word].load(std::memory_order_relaxed); });
      std::atomic_thread_fence(std::memory_order_seq_cst);
      if (its.version.load(std::memory_order_seq_cst) == version) {
        return text;
      }
    }
  }
  return std::nullopt;
}

}  // namespace fastcycle::processes
