#include "mcap/chunk_builder.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>

#include "fastcycle/assert.h"
#include "mcap/crc.h"
#include "mcap/encode.h"

namespace fastcycle::mcap {
namespace {

constexpr const char* kStillOpen = "a chunk is changed only while it is open";
constexpr const char* kClosed = "a chunk is appended after it was closed";
// So that the message index of a channel stays below 4 GiB.
constexpr std::size_t kMostMessagesOfChannel = (std::size_t{1} << 28U) - 1;

std::uint32_t crc_of(std::span<const Bytes> parts) {
  Crc crc;
  for (const Bytes part : parts) {
    crc.add(part);
  }
  return crc.value();
}

}  // namespace

void ChunkBuilder::add(const Schema& schema) {
  FASTCYCLE_ASSERT(!is_closed_, kStillOpen);
  definitions_.push_back({.record = schema, .offset = size_});
  const std::size_t before = own_.size();
  encode(schema, own_);
  grew(before);
}

void ChunkBuilder::add(const Channel& channel) {
  FASTCYCLE_ASSERT(!is_closed_, kStillOpen);
  definitions_.push_back({.record = channel, .offset = size_});
  const std::size_t before = own_.size();
  encode(channel, own_);
  grew(before);
}

void ChunkBuilder::add(const MessageHead& head, std::span<const Bytes> data) {
  add_head(head, size_of(data));
  const std::size_t before = own_.size();
  for (const Bytes part : data) {
    own_.insert(own_.end(), part.begin(), part.end());
  }
  grew(before);
}

void ChunkBuilder::borrow(const MessageHead& head, std::span<const Bytes> data) {
  add_head(head, size_of(data));
  for (const Bytes part : data) {
    runs_.push_back({.borrowed = part.data(), .offset = 0, .size = part.size()});
    size_ += part.size();
  }
}

void ChunkBuilder::add_head(const MessageHead& head, std::uint64_t data_size) {
  FASTCYCLE_ASSERT(!is_closed_, kStillOpen);
  const auto [place, is_new] = index_of_channel_.try_emplace(head.channel_id, indexes_.size());
  if (is_new) {
    indexes_.push_back({.channel_id = head.channel_id, .entries = {}});
  }
  std::vector<MessageIndex::Entry>& entries = indexes_[place->second].entries;
  if (entries.size() == kMostMessagesOfChannel) {
    throw std::length_error("too many messages of one channel for one chunk");
  }
  entries.push_back({.log_time_ns = head.log_time_ns, .offset = size_});
  head_.message_start_time_ns = message_count_ == 0
                                    ? head.log_time_ns
                                    : std::min(head_.message_start_time_ns, head.log_time_ns);
  head_.message_end_time_ns = std::max(head_.message_end_time_ns, head.log_time_ns);
  ++message_count_;

  const auto bytes = encode_head(head, data_size);
  const std::size_t before = own_.size();
  own_.insert(own_.end(), bytes.begin(), bytes.end());
  grew(before);
}

/// Data appended to `own_` continues the last run, or starts one after a borrowed run.
void ChunkBuilder::grew(std::size_t own_size_before) {
  const std::size_t more = own_.size() - own_size_before;
  if (runs_.empty() || runs_.back().borrowed != nullptr) {
    runs_.push_back({.borrowed = nullptr, .offset = own_size_before, .size = 0});
  }
  runs_.back().size += more;
  size_ += more;
}

void ChunkBuilder::gather() {
  for (const Run& run : runs_) {
    parts_.emplace_back(run.borrowed != nullptr ? run.borrowed : own_.data() + run.offset,
                        run.size);
  }
}

void ChunkBuilder::close() {
  if (is_closed_) {
    return;
  }
  gather();
  head_.uncompressed_size = size_;
  head_.compression = name_of(options_.compression);
  if (options_.crc) {
    head_.uncompressed_crc = crc_of(parts_);
    compressed_crc_ = head_.uncompressed_crc;
  }
  compressed_size_ = size_;
  if (options_.compression != Compression::kNone) {
    compressor_.compress(options_.compression, options_.level, parts_, compressed_);
    parts_.assign(1, compressed_);
    compressed_size_ = compressed_.size();
    if (options_.crc) {
      compressed_crc_ = crc_of(parts_);
    }
  }
  is_closed_ = true;
}

void ChunkBuilder::clear() {
  is_closed_ = false;
  size_ = 0;
  message_count_ = 0;
  own_.clear();
  runs_.clear();
  indexes_.clear();
  index_of_channel_.clear();
  definitions_.clear();
  head_ = {};
  parts_.clear();
  compressed_size_ = 0;
  compressed_crc_.reset();
}

const Chunk& ChunkBuilder::head() const {
  FASTCYCLE_ASSERT(is_closed_, kClosed);
  return head_;
}

std::span<const Bytes> ChunkBuilder::parts() const {
  FASTCYCLE_ASSERT(is_closed_, kClosed);
  return parts_;
}

std::uint64_t ChunkBuilder::compressed_size() const {
  FASTCYCLE_ASSERT(is_closed_, kClosed);
  return compressed_size_;
}

std::optional<std::uint32_t> ChunkBuilder::compressed_crc() const {
  FASTCYCLE_ASSERT(is_closed_, kClosed);
  return compressed_crc_;
}

}  // namespace fastcycle::mcap
