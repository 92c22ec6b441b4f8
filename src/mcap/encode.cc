#include "mcap/encode.h"

#include <algorithm>
#include <concepts>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "mcap/fields.h"

namespace fastcycle::mcap {
namespace {

template <std::unsigned_integral Number>
std::byte* store(std::byte* to, Number value) {
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    *to++ = static_cast<std::byte>(value & 0xFFU);
    value = static_cast<Number>(static_cast<std::uint64_t>(value) >> 8U);
  }
  return to;
}

std::uint32_t checked_length(std::size_t length) {
  if (length > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error(
        fmt::format("a field of an MCAP record may have 4 GiB, this one has {} bytes", length));
  }
  return static_cast<std::uint32_t>(length);
}

/// Appends fields; its destructor writes the length of what it appended.
template <std::unsigned_integral Length>
class Counted {
 public:
  explicit Counted(std::vector<std::byte>& into) : into_(into), begin_(into.size()) {
    into_.resize(begin_ + sizeof(Length));
  }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  ~Counted() = default;

  void close(std::uint64_t more = 0) {
    const std::uint64_t length = into_.size() - begin_ - sizeof(Length) + more;
    if constexpr (sizeof(Length) == 4) {
      store(into_.data() + begin_, checked_length(length));
    } else {
      store(into_.data() + begin_, length);
    }
  }

 private:
  std::vector<std::byte>& into_;
  const std::size_t begin_;
};

/// Appends fields.
class FieldWriter {
 public:
  explicit FieldWriter(std::vector<std::byte>& into) : into_(into) {}

  template <std::unsigned_integral Number>
  void operator()(const char* /*name*/, Number value) {
    into_.resize(into_.size() + sizeof(Number));
    store(into_.data() + into_.size() - sizeof(Number), value);
  }
  void operator()(const char* name, Opcode value) {
    (*this)(name, static_cast<std::uint8_t>(value));
  }
  void operator()(const char* name, const std::string& text) {
    (*this)(name, checked_length(text.size()));
    const Bytes bytes = bytes_of(text);
    into_.insert(into_.end(), bytes.begin(), bytes.end());
  }
  template <typename Key, typename Value>
  void operator()(const char* name, const std::map<Key, Value>& map) {
    Counted<std::uint32_t> length(into_);
    for (const auto& [key, value] : map) {
      (*this)(name, key);
      (*this)(name, value);
    }
    length.close();
  }
  template <typename Entry>
  void operator()(const char* /*name*/, const std::vector<Entry>& entries) {
    Counted<std::uint32_t> length(into_);
    for (const Entry& entry : entries) {
      visit_fields(entry, *this);
    }
    length.close();
  }

 private:
  std::vector<std::byte>& into_;
};

/// The beginning of a record: its fields and `data_size`, which `more` bytes follow.
template <typename Kind>
void put_head(std::vector<std::byte>& into, Opcode opcode, const Kind& record,
              std::uint64_t data_size, std::uint64_t more) {
  FieldWriter fields(into);
  fields("opcode", opcode);
  Counted<std::uint64_t> length(into);
  visit_fields(record, fields);
  fields("size", data_size);
  length.close(more);
}

}  // namespace

template <typename Kind>
void encode(const Kind& record, std::vector<std::byte>& into) {
  FieldWriter fields(into);
  fields("opcode", kOpcodeOf<Kind>);
  Counted<std::uint64_t> length(into);
  visit_fields(record, fields);
  length.close();
}

template void encode(const Header&, std::vector<std::byte>&);
template void encode(const Footer&, std::vector<std::byte>&);
template void encode(const Schema&, std::vector<std::byte>&);
template void encode(const Channel&, std::vector<std::byte>&);
template void encode(const MessageIndex&, std::vector<std::byte>&);
template void encode(const ChunkIndex&, std::vector<std::byte>&);
template void encode(const AttachmentIndex&, std::vector<std::byte>&);
template void encode(const Statistics&, std::vector<std::byte>&);
template void encode(const Metadata&, std::vector<std::byte>&);
template void encode(const MetadataIndex&, std::vector<std::byte>&);
template void encode(const SummaryOffset&, std::vector<std::byte>&);
template void encode(const DataEnd&, std::vector<std::byte>&);

std::array<std::byte, kFrameBytes + kMessageHeadBytes> encode_head(const MessageHead& head,
                                                                   std::uint64_t data_size) {
  std::array<std::byte, kFrameBytes + kMessageHeadBytes> bytes{};
  std::byte* to = store(bytes.data(), static_cast<std::uint8_t>(Opcode::kMessage));
  to = store(to, kMessageHeadBytes + data_size);
  to = store(to, head.channel_id);
  to = store(to, head.sequence);
  to = store(to, head.log_time_ns);
  store(to, head.publish_time_ns);
  return bytes;
}

void encode_head(const Chunk& chunk, std::uint64_t records_size, std::vector<std::byte>& into) {
  put_head(into, Opcode::kChunk, chunk, records_size, records_size);
}

void encode_head(const AttachmentHead& head, std::uint64_t data_size,
                 std::vector<std::byte>& into) {
  put_head(into, Opcode::kAttachment, head, data_size, data_size + sizeof(std::uint32_t));
}

std::array<std::byte, 4> encode_u32(std::uint32_t value) {
  std::array<std::byte, 4> bytes{};
  store(bytes.data(), value);
  return bytes;
}

}  // namespace fastcycle::mcap
