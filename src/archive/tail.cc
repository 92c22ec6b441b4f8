#include "archive/tail.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "mcap/crc.h"
#include "mcap/decode.h"
#include "mcap/encode.h"

namespace fastcycle::archive {
namespace {

std::optional<mcap::Footer> find_footer(const mcap::Source& file) {
  constexpr std::size_t kEndBytes = mcap::kFrameBytes + mcap::kFooterBytes + mcap::kMagic.size();
  if (file.size() < kEndBytes) {
    return {};
  }
  std::vector<std::byte> end(kEndBytes);
  file.read(file.size() - kEndBytes, end);
  const mcap::Frame frame = mcap::decode_frame(end);
  if (frame.opcode != mcap::Opcode::kFooter || frame.length != mcap::kFooterBytes) {
    return {};
  }
  return mcap::decode_as<mcap::Footer>(
      mcap::Bytes(end).subspan(mcap::kFrameBytes, mcap::kFooterBytes), {});
}

/// Whether the summary, `size` bytes with what the CRC covers of the footer, is as it was written.
bool has_right_crc(const mcap::Source& file, const mcap::Footer& footer, std::uint64_t size) {
  std::vector<std::byte> summary(static_cast<std::size_t>(size));
  file.read(footer.summary_start, summary);
  mcap::Crc crc;
  crc.add(summary);
  return footer.summary_crc == 0 || footer.summary_crc == crc.value();
}

}  // namespace

Tail::Tail(const mcap::Source& whole, std::uint64_t from, std::vector<std::byte> beginning)
    : whole_(whole), from_(from), beginning_(std::move(beginning)) {}

std::uint64_t Tail::size() const {
  return beginning_.size() + (whole_.size() - from_);
}

void Tail::read(std::uint64_t offset, std::span<std::byte> into) const {
  if (offset < beginning_.size()) {
    const std::size_t count =
        std::min(into.size(), beginning_.size() - static_cast<std::size_t>(offset));
    std::copy_n(beginning_.begin() + static_cast<std::ptrdiff_t>(offset), count, into.begin());
    into = into.subspan(count);
    offset += count;
  }
  if (!into.empty()) {
    whole_.read(from_ + (offset - beginning_.size()), into);
  }
}

std::uint64_t Tail::in_whole(std::uint64_t offset) const {
  return offset < beginning_.size() ? from_ : from_ + (offset - beginning_.size());
}

std::vector<std::byte> beginning_of_file() {
  std::vector<std::byte> bytes(mcap::kMagic.begin(), mcap::kMagic.end());
  mcap::encode(mcap::Header{}, bytes);
  return bytes;
}

void read_summary(const mcap::Source& file, const mcap::ReadLimits& limits,
                  const std::function<void(const mcap::Record&)>& take) {
  const std::optional<mcap::Footer> footer = find_footer(file);
  if (!footer || footer->summary_start == 0) {
    return;
  }
  const std::uint64_t end = file.size() - mcap::kMagic.size() - sizeof(footer->summary_crc);
  if (footer->summary_start > end || end - footer->summary_start > limits.index_bytes ||
      !has_right_crc(file, *footer, end - footer->summary_start)) {
    return;
  }
  std::vector<std::byte> beginning = beginning_of_file();
  mcap::encode(mcap::DataEnd{}, beginning);
  const Tail tail(file, footer->summary_start, std::move(beginning));
  mcap::RecordReader reader(tail, {.limits = limits});
  while (const std::optional<mcap::Record> record = reader.next()) {
    if (reader.is_past_data()) {
      take(*record);
    }
  }
}

}  // namespace fastcycle::archive
