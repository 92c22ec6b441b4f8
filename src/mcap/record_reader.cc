#include "mcap/record_reader.h"

#include <algorithm>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "mcap/decode.h"
#include "mcap/encode.h"

namespace fastcycle::mcap {
namespace {

constexpr std::size_t kReadAheadBytes = std::size_t{256} << 10U;
constexpr const char* kEndOfFile = "the end of the file";

/// Records that may be large.
bool is_bulk(Opcode opcode) {
  return opcode == Opcode::kMessage || opcode == Opcode::kAttachment || opcode == Opcode::kChunk ||
         opcode == Opcode::kMessageIndex;
}

bool is_known(Opcode opcode) {
  return opcode >= Opcode::kHeader && opcode <= Opcode::kDataEnd;
}

bool may_be_in_chunk(Opcode opcode) {
  return opcode == Opcode::kSchema || opcode == Opcode::kChannel || opcode == Opcode::kMessage;
}

bool may_be_in_data(Opcode opcode) {
  return is_bulk(opcode) || may_be_in_chunk(opcode) || opcode == Opcode::kMetadata ||
         opcode == Opcode::kDataEnd;
}

bool may_be_in_summary(Opcode opcode) {
  switch (opcode) {
    case Opcode::kSchema:
    case Opcode::kChannel:
    case Opcode::kChunkIndex:
    case Opcode::kAttachmentIndex:
    case Opcode::kStatistics:
    case Opcode::kMetadataIndex:
    case Opcode::kSummaryOffset:
    case Opcode::kFooter:
      return true;
    default:
      return false;
  }
}

bool is_magic(Bytes bytes) {
  return std::ranges::equal(bytes, kMagic);
}

}  // namespace

Bytes Window::view(std::uint64_t offset, std::size_t size) {
  if (offset >= begin_ && offset - begin_ <= bytes_.size() &&
      size <= bytes_.size() - (offset - begin_)) {
    return Bytes(bytes_).subspan(static_cast<std::size_t>(offset - begin_), size);
  }
  const auto ahead = static_cast<std::size_t>(
      std::min<std::uint64_t>(std::max(size, kReadAheadBytes), end_ - offset));
  bytes_.resize(ahead);
  begin_ = offset;
  source_.read(offset, bytes_);
  return Bytes(bytes_).first(size);
}

bool is_behind_end(const Problem& problem) {
  return problem.record.empty() && problem.expected == kEndOfFile;
}

Bytes uncompress(const Chunk& chunk, const ReadOptions& options, const Place& place,
                 Decompressor& decompressor, std::vector<std::byte>& memory) {
  const auto fail = [&](std::string expected, std::string found) {
    throw Damage({.place = place,
                  .record = name_of(Opcode::kChunk),
                  .expected = std::move(expected),
                  .found = std::move(found)});
  };
  const std::optional<Compression> compression = find_compression(chunk.compression);
  if (!compression) {
    fail(R"(compression "", "lz4" or "zstd")", shown(chunk.compression));
  }
  if (chunk.uncompressed_size > options.limits.chunk_bytes) {
    fail(fmt::format("at most {} bytes of records", options.limits.chunk_bytes),
         fmt::format("{}", chunk.uncompressed_size));
  }
  if (!can_become(*compression, chunk.records.size(), chunk.uncompressed_size)) {
    fail(fmt::format("{} bytes of records", chunk.uncompressed_size),
         fmt::format("{} bytes that cannot become as many", chunk.records.size()));
  }
  Bytes records = chunk.records;
  if (*compression != Compression::kNone) {
    memory.resize(static_cast<std::size_t>(chunk.uncompressed_size));
    if (std::optional<std::string> found =
            decompressor.decompress(*compression, chunk.records, memory)) {
      fail(fmt::format("{} bytes of records", chunk.uncompressed_size), std::move(*found));
    }
    records = memory;
  }
  if (options.check_crcs && chunk.uncompressed_crc != 0) {
    Crc crc;
    crc.add(records);
    if (crc.value() != chunk.uncompressed_crc) {
      fail(fmt::format("CRC {:#010x} of its records", chunk.uncompressed_crc),
           fmt::format("{:#010x}", crc.value()));
    }
  }
  return records;
}

RecordReader::RecordReader(const Source& source, ReadOptions options)
    : options_(options), window_(source), place_{.file = source.name(), .offset = 0} {}

std::optional<Record> RecordReader::next() {
  while (!stop_) {
    try {
      if (std::optional<Record> record = step()) {
        return record;
      }
    } catch (const Damage& damage) {
      stop_ = {.reason = Stop::Reason::kDamaged, .problem = damage.problem()};
    }
  }
  return {};
}

/// Advances one step; returns a record if that led to one.
std::optional<Record> RecordReader::step() {
  if (is_in_chunk_) {
    return next_in_chunk();
  }
  place_.offset = position_;
  place_.offset_in_chunk.reset();
  can_resume_ = false;
  if (section_ == Section::kBegin) {
    read_magic();
    return {};
  }
  if (section_ == Section::kEnd) {
    read_end();
    return {};
  }
  return next_in_file();
}

void RecordReader::read_magic() {
  const std::size_t size = std::min<std::uint64_t>(kMagic.size(), window_.end());
  const Bytes bytes = window_.view(0, size);
  if (!std::ranges::equal(bytes, Bytes(kMagic).first(size))) {
    damaged("", "the magic bytes of MCAP", shown(text_of(bytes)));
  }
  if (size < kMagic.size()) {
    return truncated("", "the magic bytes of MCAP");
  }
  data_crc_.add(bytes);
  position_ = size;
  section_ = Section::kHeader;
}

void RecordReader::read_end() {
  const std::uint64_t left = window_.end() - position_;
  const Bytes bytes = window_.view(position_, std::min<std::uint64_t>(kMagic.size(), left));
  if (left < kMagic.size()) {
    return truncated("", "the magic bytes of MCAP at the end");
  }
  if (!is_magic(bytes)) {
    damaged("", "the magic bytes of MCAP at the end", shown(text_of(bytes)));
  }
  if (left > kMagic.size()) {
    damaged("", kEndOfFile, fmt::format("{} more bytes", left - kMagic.size()));
  }
  stop_ = {.reason = Stop::Reason::kEnd, .problem = {}};
}

std::optional<Record> RecordReader::next_in_file() {
  const std::uint64_t left = window_.end() - position_;
  if (left < kFrameBytes) {
    truncated("", "a record");
    return {};
  }
  const Frame frame = decode_frame(window_.view(position_, kFrameBytes));
  if (frame.opcode == Opcode{}) {
    damaged("", "a record", "opcode 0, which none has");
  }
  can_resume_ = frame.length <= left - kFrameBytes;
  if (is_known(frame.opcode) || section_ == Section::kHeader) {
    check_section(frame.opcode);
  }
  if (frame.length > left - kFrameBytes) {
    if (frame.opcode != Opcode::kChunk || section_ != Section::kData || !enter_begun_chunk(left)) {
      truncated(name_of(frame.opcode), fmt::format("{} bytes of content", frame.length));
    }
    return {};
  }
  const std::uint64_t size = kFrameBytes + frame.length;
  if (!is_known(frame.opcode)) {
    // May have any length: read piecewise, only for the CRCs.
    for (std::uint64_t done = 0; done < size;) {
      const auto piece =
          static_cast<std::size_t>(std::min<std::uint64_t>(size - done, kReadAheadBytes));
      const Bytes bytes = window_.view(position_ + done, piece);
      data_crc_.add(bytes);
      summary_crc_.add(bytes);
      done += piece;
    }
    position_ += size;
    return {};
  }
  check_length(frame);
  const Bytes whole = window_.view(position_, static_cast<std::size_t>(size));
  position_ += size;
  return take(frame.opcode, whole);
}

void RecordReader::check_length(const Frame& frame) const {
  const std::uint64_t most =
      is_bulk(frame.opcode) ? options_.limits.record_bytes : options_.limits.small_record_bytes;
  if (is_known(frame.opcode) && frame.length > most) {
    damaged(name_of(frame.opcode), fmt::format("at most {} bytes of content", most),
            fmt::format("{}", frame.length));
  }
}

/// A record of the file itself, completely available.
std::optional<Record> RecordReader::take(Opcode opcode, Bytes whole) {
  const Bytes content = whole.subspan(kFrameBytes);
  std::optional<Record> record = decode(opcode, content, place_);
  if (opcode == Opcode::kDataEnd) {
    check_data_end(std::get<DataEnd>(*record));
  } else if (opcode == Opcode::kFooter) {
    check_footer(std::get<Footer>(*record), whole);
  } else {
    data_crc_.add(whole);
    summary_crc_.add(whole);
  }
  if (section_ == Section::kHeader) {
    section_ = Section::kData;
  }
  if (!keep(*record, content)) {
    return {};
  }
  if (const auto* chunk = std::get_if<Chunk>(&*record)) {
    chunk_records_offset_ =
        place_.offset + static_cast<std::uint64_t>(chunk->records.data() - whole.data());
    chunk_ = uncompress(*chunk, options_, place_, decompressor_, uncompressed_);
    chunk_position_ = 0;
    is_in_chunk_ = true;
    is_chunk_begun_only_ = false;
  }
  return record;
}

void RecordReader::check_section(Opcode opcode) const {
  switch (section_) {
    case Section::kHeader:
      if (opcode != Opcode::kHeader) {
        damaged(name_of(opcode), "a Header first", "a " + name_of(opcode));
      }
      break;
    case Section::kData:
      if (!may_be_in_data(opcode)) {
        damaged(name_of(opcode), "a record of the data section", "one of another section");
      }
      break;
    case Section::kSummary:
      if (!may_be_in_summary(opcode)) {
        damaged(name_of(opcode), "a record of the summary", "one of another section");
      }
      break;
    case Section::kBegin:
    case Section::kEnd:
      break;
  }
}

/// Updates the state for a record. False if it is not to be returned.
bool RecordReader::keep(const Record& record, Bytes content) {
  if (const auto* message = std::get_if<Message>(&record)) {
    definitions_.require_channel(message->channel_id, place_);
  } else if (const auto* schema = std::get_if<Schema>(&record)) {
    if (schema->id == 0) {
      return false;
    }
    define(record, content.size());
  } else if (const auto* channel = std::get_if<Channel>(&record)) {
    definitions_.require_schema_of(*channel, place_);
    define(record, content.size());
  } else if (std::holds_alternative<Attachment>(record) && options_.check_crcs) {
    const AttachmentCrc crc = crc_of_attachment(content, place_);
    check_crc(Opcode::kAttachment, crc.written, crc.computed);
  }
  return true;
}

void RecordReader::define(const Record& record, std::size_t size) {
  const auto* const schema = std::get_if<Schema>(&record);
  const auto* const channel = std::get_if<Channel>(&record);
  const bool is_new = schema != nullptr ? definitions_.find_schema(schema->id) == nullptr
                                        : definitions_.find_channel(channel->id) == nullptr;
  const std::uint64_t most = options_.limits.definition_bytes;
  if (is_new && (size > most || definition_bytes_ > most - size)) {
    damaged(name_of(schema != nullptr ? Opcode::kSchema : Opcode::kChannel),
            fmt::format("at most {} bytes of schemas and channels", most), "more");
  }
  if (schema != nullptr) {
    definitions_.add(*schema, place_);
  } else {
    definitions_.add(*channel, place_);
  }
  definition_bytes_ += is_new ? size : 0;
}

void RecordReader::check_data_end(const DataEnd& end) {
  section_ = Section::kSummary;
  summary_begin_ = position_;
  summary_crc_ = {};
  has_summary_crc_ = true;
  if (has_data_crc_) {
    check_crc(Opcode::kDataEnd, end.data_section_crc, data_crc_.value());
  }
  is_past_data_ = true;
}

void RecordReader::check_footer(const Footer& footer, Bytes whole) {
  section_ = Section::kEnd;
  const std::uint64_t expected = summary_begin_ == place_.offset ? 0 : summary_begin_;
  if (footer.summary_start != expected) {
    damaged(name_of(Opcode::kFooter), fmt::format("summary_start {}", expected),
            fmt::format("{}", footer.summary_start));
  }
  if (has_summary_crc_) {
    summary_crc_.add(whole.first(whole.size() - sizeof(footer.summary_crc)));
    check_crc(Opcode::kFooter, footer.summary_crc, summary_crc_.value());
  }
}

void RecordReader::check_crc(Opcode opcode, std::uint32_t written, std::uint32_t computed) const {
  if (options_.check_crcs && written != 0 && written != computed) {
    damaged(name_of(opcode), fmt::format("CRC {:#010x}", written),
            fmt::format("{:#010x}", computed));
  }
}

/// Enters a chunk whose end is missing; false if that is useless.
bool RecordReader::enter_begun_chunk(std::uint64_t size) {
  if (has_end() || size > options_.limits.record_bytes) {
    return false;
  }
  const Bytes begun = window_.view(position_, static_cast<std::size_t>(size));
  Chunk chunk;
  try {
    chunk = decode_begun_chunk(begun.subspan(kFrameBytes), place_);
  } catch (const Damage&) {
    return false;  // Even its head is incomplete.
  }
  if (!chunk.compression.empty() || chunk.records.size() > options_.limits.chunk_bytes) {
    return false;
  }
  chunk_records_offset_ = window_.end() - chunk.records.size();
  chunk_ = chunk.records;
  chunk_position_ = 0;
  is_in_chunk_ = true;
  is_chunk_begun_only_ = true;
  return true;
}

void RecordReader::leave_chunk() {
  is_in_chunk_ = false;
  if (is_chunk_begun_only_) {
    place_.offset_in_chunk = chunk_position_;
    truncated(name_of(Opcode::kChunk), "more records");
  }
}

std::optional<Record> RecordReader::next_in_chunk() {
  const Bytes rest = chunk_.subspan(static_cast<std::size_t>(chunk_position_));
  if (rest.empty()) {
    leave_chunk();
    return {};
  }
  place_.offset_in_chunk = chunk_position_;
  can_resume_in_chunk_ = false;
  const bool has_frame = rest.size() >= kFrameBytes;
  const Frame frame = has_frame ? decode_frame(rest) : Frame{};
  if (!has_frame || frame.length > rest.size() - kFrameBytes) {
    if (is_chunk_begun_only_) {
      leave_chunk();
      return {};
    }
    damaged(has_frame ? name_of(frame.opcode) : "",
            has_frame ? fmt::format("{} bytes of content", frame.length) : "a record",
            fmt::format("{} bytes left in the chunk", rest.size() - (has_frame ? kFrameBytes : 0)));
  }
  chunk_position_ += kFrameBytes + frame.length;
  can_resume_in_chunk_ = true;
  if (is_known(frame.opcode) ? !may_be_in_chunk(frame.opcode) : frame.opcode == Opcode{}) {
    damaged(name_of(frame.opcode), "a Schema, Channel or Message in a chunk", "none of these");
  }
  check_length(frame);
  const Bytes content = rest.subspan(kFrameBytes, static_cast<std::size_t>(frame.length));
  std::optional<Record> record = decode(frame.opcode, content, place_);
  if (!record || !keep(*record, content)) {
    return {};
  }
  return record;
}

bool RecordReader::resume() {
  if (!stop_ || stop_->reason != Stop::Reason::kDamaged || !can_resume_) {
    return false;
  }
  stop_.reset();
  has_data_crc_ = false;
  has_summary_crc_ = false;
  if (is_in_chunk_ && can_resume_in_chunk_) {
    return true;
  }
  is_in_chunk_ = false;
  if (position_ == place_.offset) {  // A record over the limits.
    position_ += kFrameBytes + decode_frame(window_.view(position_, kFrameBytes)).length;
  }
  section_ = std::max(section_, Section::kData);
  return true;
}

bool RecordReader::has_end() {
  const std::uint64_t end = window_.end();
  return end >= 2 * kMagic.size() && is_magic(window_.view(end - kMagic.size(), kMagic.size()));
}

/// The file ends too early. If it has a regular end, it is not truncated: then a length is wrong.
void RecordReader::truncated(std::string record, std::string expected) {
  const std::uint64_t end = window_.end();
  if (has_end()) {
    damaged(std::move(record), std::move(expected),
            fmt::format("the end of the file, at byte {}", end));
  }
  stop_ = {.reason = Stop::Reason::kTruncated,
           .problem = {.place = place_,
                       .record = std::move(record),
                       .expected = std::move(expected),
                       .found = fmt::format("the end of the file, at byte {}", end)}};
}

void RecordReader::damaged(std::string record, std::string expected, std::string found) const {
  throw Damage({.place = place_,
                .record = std::move(record),
                .expected = std::move(expected),
                .found = std::move(found)});
}

}  // namespace fastcycle::mcap
