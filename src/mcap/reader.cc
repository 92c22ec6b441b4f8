#include "mcap/reader.h"

#include <algorithm>
#include <queue>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "mcap/crc.h"
#include "mcap/decode.h"
#include "mcap/encode.h"

namespace fastcycle::mcap {
namespace {

/// The minimum content of a chunk record: all fields, and no records.
constexpr std::uint64_t kChunkHeadBytes = 8 + 8 + 8 + 4 + 4 + 8;
/// Footer and magic, the end of every closed file.
constexpr std::uint64_t kFileEndBytes = kFrameBytes + kFooterBytes + kMagic.size();
/// Messages outside of chunks are read together, up to this.
constexpr std::uint64_t kMostBytesOfPlainSpan = std::uint64_t{1} << 20U;

[[noreturn]] void damaged(const Place& place, Opcode record, std::string expected,
                          std::string found) {
  throw Damage({.place = place,
                .record = name_of(record),
                .expected = std::move(expected),
                .found = std::move(found)});
}

}  // namespace

// ---------------------------------------------------------------------------------------------
// The index: from the summary, or from a scan.

Reader::Reader(const Source& source, ReadOptions options) : source_(source), options_(options) {
  if (!options_.use_summary || !read_summary()) {
    scan();
  }
}

Reader::~Reader() = default;

/// False if there is no summary, or an incomplete one.
bool Reader::read_summary() {
  const std::optional<Footer> footer = find_footer();
  if (!footer || footer->summary_start == 0) {
    return false;
  }
  const std::uint64_t end = source_.size() - kFileEndBytes;
  parse_summary(*footer, end);
  if (!is_enough()) {
    return false;
  }
  check_spans(footer->summary_start);
  read_header();
  return true;
}

std::optional<Footer> Reader::find_footer() const {
  if (source_.size() < kMagic.size() + kFileEndBytes) {
    return {};
  }
  std::array<std::byte, kFileEndBytes> bytes{};
  const Place place{.file = source_.name(), .offset = source_.size() - kFileEndBytes};
  source_.read(place.offset, bytes);
  const Frame frame = decode_frame(bytes);
  if (!std::ranges::equal(Bytes(bytes).last(kMagic.size()), kMagic) ||
      frame.opcode != Opcode::kFooter || frame.length != kFooterBytes) {
    return {};
  }
  return decode_as<Footer>(Bytes(bytes).subspan(kFrameBytes, kFooterBytes), place);
}

void Reader::parse_summary(const Footer& footer, std::uint64_t end) {
  Place place{.file = source_.name(), .offset = end};
  if (footer.summary_start < kMagic.size() || footer.summary_start > end) {
    damaged(place, Opcode::kFooter, fmt::format("summary_start before byte {}", end),
            fmt::format("{}", footer.summary_start));
  }
  const std::uint64_t size = end - footer.summary_start;
  if (size > options_.limits.index_bytes) {
    damaged(place, Opcode::kFooter,
            fmt::format("a summary of at most {} bytes", options_.limits.index_bytes),
            fmt::format("{}", size));
  }
  // Including the part of the footer that the CRC covers.
  std::vector<std::byte> bytes(static_cast<std::size_t>(size) + kFrameBytes + 8 + 8);
  source_.read(footer.summary_start, bytes);
  if (options_.check_crcs && footer.summary_crc != 0) {
    Crc crc;
    crc.add(bytes);
    if (crc.value() != footer.summary_crc) {
      damaged(place, Opcode::kFooter,
              fmt::format("CRC {:#010x} of the summary", footer.summary_crc),
              fmt::format("{:#010x}", crc.value()));
    }
  }
  Bytes rest = Bytes(bytes).first(static_cast<std::size_t>(size));
  while (!rest.empty()) {
    place.offset = end - rest.size();
    const Frame frame = rest.size() < kFrameBytes ? Frame{} : decode_frame(rest);
    if (frame.opcode == Opcode{} || frame.length > rest.size() - kFrameBytes) {
      damaged(place, frame.opcode, "a record that ends before the footer",
              fmt::format("{} bytes left, {} needed", rest.size(), frame.length));
    }
    const auto length = static_cast<std::size_t>(frame.length);
    if (const std::optional<Record> record =
            decode(frame.opcode, rest.subspan(kFrameBytes, length), place)) {
      take_summary_record(*record, place);
    }
    rest = rest.subspan(kFrameBytes + length);
  }
}

void Reader::take_summary_record(const Record& record, const Place& place) {
  if (const auto* schema = std::get_if<Schema>(&record)) {
    if (schema->id != 0) {
      definitions_.add(*schema, place);
    }
  } else if (const auto* channel = std::get_if<Channel>(&record)) {
    definitions_.add(*channel, place);
  } else if (const auto* statistics = std::get_if<Statistics>(&record)) {
    if (statistics_ && *statistics_ != *statistics) {
      damaged(place, Opcode::kStatistics, "one Statistics", "a second one");
    }
    statistics_ = *statistics;
  } else if (const auto* attachment = std::get_if<AttachmentIndex>(&record)) {
    attachments_.push_back(*attachment);
  } else if (const auto* metadata = std::get_if<MetadataIndex>(&record)) {
    metadata_.push_back(*metadata);
  } else if (const auto* index = std::get_if<ChunkIndex>(&record)) {
    Span span{.begin_ns = index->message_start_time_ns,
              .end_ns = index->message_end_time_ns,
              .offset = index->chunk_start_offset,
              .length = index->chunk_length,
              .uncompressed_size = index->uncompressed_size,
              .is_chunk = true,
              .compression = index->compression,
              .channel_ids = {}};
    for (const ChunkIndex::MessageIndexOffset& offset : index->message_index_offsets) {
      span.channel_ids.push_back(offset.channel_id);
    }
    std::ranges::sort(span.channel_ids);
    spans_.push_back(std::move(span));
  } else if (!std::holds_alternative<SummaryOffset>(record)) {
    damaged(place, Opcode::kFooter, "records of the summary after summary_start", "another one");
  }
}

/// Whether messages, attachments and metadata can be found without reading all of the file:
/// everything counted by the statistics has to be indexed.
bool Reader::is_enough() const {
  if (!statistics_ || (statistics_->message_count > 0 && spans_.empty()) ||
      statistics_->chunk_count != spans_.size() ||
      statistics_->attachment_count != attachments_.size() ||
      statistics_->metadata_count != metadata_.size() ||
      statistics_->channel_count != definitions_.channels().size() ||
      statistics_->schema_count != definitions_.schemas().size()) {
    return false;
  }
  const auto is_channel = [this](std::uint16_t id) {
    return definitions_.find_channel(id) != nullptr;
  };
  const auto has_channels = [&](const Span& span) {
    return std::ranges::all_of(span.channel_ids, is_channel);
  };
  const auto has_schema = [this](const auto& entry) {
    const std::uint16_t schema_id = entry.second.schema_id;
    return schema_id == 0 || definitions_.find_schema(schema_id) != nullptr;
  };
  return std::ranges::all_of(spans_, has_channels) &&
         std::ranges::all_of(definitions_.channels(), has_schema);
}

/// Chunks lie between header and summary, and no two of them overlap.
void Reader::check_spans(std::uint64_t end) const {
  std::vector<const Span*> sorted;
  for (const Span& span : spans_) {
    sorted.push_back(&span);
  }
  std::ranges::sort(sorted, {}, &Span::offset);
  std::uint64_t free = kMagic.size() + kFrameBytes;
  for (const Span* span : sorted) {
    const Place place{.file = source_.name(), .offset = span->offset};
    if (span->offset < free || span->offset > end || span->length > end - span->offset) {
      damaged(place, Opcode::kChunkIndex,
              fmt::format("a chunk between byte {} and byte {}", free, end),
              fmt::format("one of {} bytes at byte {}", span->length, span->offset));
    }
    if (span->length < kFrameBytes + kChunkHeadBytes) {
      damaged(place, Opcode::kChunkIndex,
              fmt::format("chunk_length {} or more", kFrameBytes + kChunkHeadBytes),
              fmt::format("{}", span->length));
    }
    free = span->offset + span->length;
  }
}

void Reader::read_header() {
  RecordReader reader(source_, options_);
  const std::optional<Record> record = reader.next();
  if (!record) {
    throw Damage(reader.stop()->problem);
  }
  header_ = std::get<Header>(*record);  // Any other first record is damage.
}

/// Builds the index from all records.
struct Reader::Scan {
  Reader& reader;
  RecordReader records;
  Statistics statistics = {};
  Span* open = nullptr;  ///< The span that the next message may belong to.
  std::uint64_t index_bytes = 0;

  explicit Scan(Reader& the_reader)
      : reader(the_reader), records(the_reader.source_, the_reader.options_) {}

  void take(const Header& header) { reader.header_ = header; }

  void take(const Chunk& chunk) {
    ++statistics.chunk_count;
    add_span({.begin_ns = 0,
              .end_ns = 0,
              .offset = records.place().offset,
              .length = records.next_offset() - records.place().offset,
              .uncompressed_size = chunk.uncompressed_size,
              .is_chunk = true,
              .compression = chunk.compression,
              .channel_ids = {}});
  }

  void take(const Message& message) {
    // A truncated chunk is read like records outside of chunks.
    const Place& place = records.place();
    const bool is_in_chunk =
        open != nullptr && open->is_chunk && place.offset_in_chunk && open->offset == place.offset;
    const std::uint64_t size = kFrameBytes + kMessageHeadBytes + message.data.size();
    if (!is_in_chunk) {
      const std::uint64_t offset = place.offset_in_chunk
                                       ? records.offset_of_chunk_records() + *place.offset_in_chunk
                                       : place.offset;
      const bool is_next = open != nullptr && !open->is_chunk &&
                           open->offset + open->length == offset &&
                           open->length + size <= kMostBytesOfPlainSpan;
      if (!is_next) {
        add_span({.begin_ns = message.log_time_ns,
                  .end_ns = message.log_time_ns,
                  .offset = offset,
                  .length = 0,
                  .uncompressed_size = 0,
                  .is_chunk = false,
                  .compression = {},
                  .channel_ids = {}});
      }
      open->length += size;
      open->uncompressed_size += size;
    }
    count(message);
  }

  void take(const Attachment& attachment) {
    ++statistics.attachment_count;
    grow(sizeof(AttachmentIndex) + attachment.name.size() + attachment.media_type.size());
    reader.attachments_.push_back({.offset = records.place().offset,
                                   .length = records.next_offset() - records.place().offset,
                                   .log_time_ns = attachment.log_time_ns,
                                   .create_time_ns = attachment.create_time_ns,
                                   .data_size = attachment.data.size(),
                                   .name = attachment.name,
                                   .media_type = attachment.media_type});
  }

  void take(const Metadata& metadata) {
    ++statistics.metadata_count;
    grow(sizeof(MetadataIndex) + metadata.name.size());
    reader.metadata_.push_back({.offset = records.place().offset,
                                .length = records.next_offset() - records.place().offset,
                                .name = metadata.name});
  }

  template <typename Other>
  void take(const Other& /*other*/) {}

  void add_span(Span span) {
    grow(sizeof(Span));
    reader.spans_.push_back(std::move(span));
    open = &reader.spans_.back();
  }

  void count(const Message& message) {
    const auto extend = [&](std::uint64_t& first_ns, std::uint64_t& last_ns, bool is_first) {
      first_ns = is_first ? message.log_time_ns : std::min(first_ns, message.log_time_ns);
      last_ns = is_first ? message.log_time_ns : std::max(last_ns, message.log_time_ns);
    };
    extend(open->begin_ns, open->end_ns, open->channel_ids.empty());
    extend(statistics.message_start_time_ns, statistics.message_end_time_ns,
           statistics.message_count == 0);
    ++statistics.message_count;
    ++statistics.channel_message_counts[message.channel_id];
    const auto at = std::ranges::lower_bound(open->channel_ids, message.channel_id);
    if (at == open->channel_ids.end() || *at != message.channel_id) {
      grow(sizeof(*at));
      open->channel_ids.insert(at, message.channel_id);
    }
  }

  void grow(std::uint64_t bytes) {
    index_bytes += bytes;
    if (index_bytes > reader.options_.limits.index_bytes) {
      damaged(records.place(), Opcode::kChunkIndex,
              fmt::format("an index of at most {} bytes", reader.options_.limits.index_bytes),
              "more");
    }
  }
};

void Reader::scan() {
  was_scanned_ = true;
  statistics_.reset();
  spans_.clear();
  attachments_.clear();
  metadata_.clear();

  Scan scan(*this);
  while (const std::optional<Record> record = scan.records.next()) {
    if (!scan.records.is_past_data()) {
      std::visit([&](const auto& one) { scan.take(one); }, *record);
    }
  }
  const Stop& stop = *scan.records.stop();
  if (stop.reason == Stop::Reason::kDamaged && !scan.records.is_past_data()) {
    throw Damage(stop.problem);
  }
  if (stop.reason != Stop::Reason::kEnd) {
    problem_ = stop.problem;
  }
  definitions_ = scan.records.definitions();
  scan.statistics.schema_count = static_cast<std::uint16_t>(definitions_.schemas().size());
  scan.statistics.channel_count = static_cast<std::uint32_t>(definitions_.channels().size());
  statistics_ = std::move(scan.statistics);
}

std::vector<std::byte> Reader::read_record(Opcode opcode, std::uint64_t offset,
                                           std::uint64_t length) const {
  const Place place{.file = source_.name(), .offset = offset};
  if (length < kFrameBytes || offset > source_.size() || length > source_.size() - offset ||
      length > options_.limits.record_bytes) {
    damaged(place, opcode, "an index that names a record within the file",
            fmt::format("one of {} bytes at byte {}", length, offset));
  }
  std::vector<std::byte> bytes(static_cast<std::size_t>(length));
  source_.read(offset, bytes);
  const Frame frame = decode_frame(bytes);
  if (frame.opcode != opcode || frame.length != length - kFrameBytes) {
    damaged(place, opcode, fmt::format("a {} of {} bytes", name_of(opcode), length),
            fmt::format("a {} of {} bytes of content", name_of(frame.opcode), frame.length));
  }
  return bytes;
}

Attachment Reader::read(const AttachmentIndex& index, std::vector<std::byte>& memory) const {
  const Place place{.file = source_.name(), .offset = index.offset};
  memory = read_record(Opcode::kAttachment, index.offset, index.length);
  const Bytes content = Bytes(memory).subspan(kFrameBytes);
  Attachment attachment = decode_as<Attachment>(content, place);
  if (attachment.name != index.name || attachment.data.size() != index.data_size) {
    damaged(place, Opcode::kAttachment,
            fmt::format("{} of {} bytes", shown(index.name), index.data_size),
            fmt::format("{} of {} bytes", shown(attachment.name), attachment.data.size()));
  }
  const AttachmentCrc crc = crc_of_attachment(content, place);
  if (options_.check_crcs && crc.written != 0 && crc.written != crc.computed) {
    damaged(place, Opcode::kAttachment, fmt::format("CRC {:#010x}", crc.written),
            fmt::format("{:#010x}", crc.computed));
  }
  return attachment;
}

Metadata Reader::read(const MetadataIndex& index) const {
  const Place place{.file = source_.name(), .offset = index.offset};
  if (index.length > kFrameBytes + options_.limits.small_record_bytes) {
    damaged(place, Opcode::kMetadata,
            fmt::format("at most {} bytes of content", options_.limits.small_record_bytes),
            fmt::format("{}", index.length));
  }
  const std::vector<std::byte> bytes = read_record(Opcode::kMetadata, index.offset, index.length);
  Metadata metadata = decode_as<Metadata>(Bytes(bytes).subspan(kFrameBytes), place);
  if (metadata.name != index.name) {
    damaged(place, Opcode::kMetadata, shown(index.name), shown(metadata.name));
  }
  return metadata;
}

MessageReader Reader::messages(MessageQuery query) const {
  return {*this, std::move(query)};
}

// ---------------------------------------------------------------------------------------------
// Messages in the order of their times.

struct MessageReader::State {
  using Span = Reader::Span;

  struct Entry {
    std::uint64_t log_time_ns = 0;  ///< 0 for a head: it comes first.
    std::uint64_t offset = 0;       ///< Of the message record, in `records`.
  };

  /// A span whose messages are being returned.
  struct Open {
    const Span* span = nullptr;
    std::vector<std::byte> memory;
    Bytes records;
    std::vector<Entry> entries;
    std::size_t next = 0;

    [[nodiscard]] const Entry& entry() const { return entries[next]; }
  };

  /// Orders a queue whose top is the earliest.
  struct IsLater {
    bool operator()(const Open* left, const Open* right) const {
      return std::pair(left->entry().log_time_ns, left->span->offset) >
             std::pair(right->entry().log_time_ns, right->span->offset);
    }
  };

  State(const Reader& the_reader, MessageQuery the_query)
      : reader(the_reader), query(std::move(the_query)) {
    const auto is_in = [](const std::vector<std::string>& topics, const Channel& channel) {
      return std::ranges::find(topics, channel.topic) != topics.end();
    };
    is_wanted.resize(std::size_t{1} << 16U);
    is_head.resize(is_wanted.size());
    for (const auto& [id, channel] : reader.definitions_.channels()) {
      is_head[id] = is_in(query.heads, channel);
      is_wanted[id] = !is_head[id] && (query.topics.empty() || is_in(query.topics, channel));
    }
    wants_everything =
        query.topics.empty() && query.heads.empty() && query.begin_ns == 0 && !query.end_ns;
    for (const Span& span : reader.spans_) {
      if (may_have_wanted(span)) {
        waiting.push_back(&span);
      }
    }
    std::ranges::sort(waiting, {},
                      [](const Span* span) { return std::pair(span->begin_ns, span->offset); });
  }

  [[nodiscard]] bool is_in_time(std::uint64_t log_time_ns) const {
    return log_time_ns >= query.begin_ns && (!query.end_ns || log_time_ns < *query.end_ns);
  }

  [[nodiscard]] bool may_have_wanted(const Span& span) const {
    const bool has_channel =
        span.channel_ids.empty() ||
        std::ranges::any_of(span.channel_ids, [&](std::uint16_t id) { return is_wanted[id]; });
    return has_channel && span.end_ns >= query.begin_ns &&
           (!query.end_ns || span.begin_ns < *query.end_ns);
  }

  std::optional<StoredMessage> next();
  void open(const Span& span);
  Bytes read_chunk(Open& open);
  void find_messages(Open& open) const;
  void check_definition(Opcode opcode, Bytes content, const Place& place) const;
  void drop_finished();
  void check_count() const;

  [[nodiscard]] Place place_of(const Span& span) const {
    return {.file = reader.source_.name(), .offset = span.offset};
  }

  const Reader& reader;
  const MessageQuery query;
  std::vector<bool> is_wanted;  // By channel id.
  std::vector<bool> is_head;    // The same.
  bool wants_everything = false;

  std::vector<const Span*> waiting;  // In the order of their earliest messages.
  std::size_t next_waiting = 0;
  std::vector<std::unique_ptr<Open>> opened;
  std::priority_queue<Open*, std::vector<Open*>, IsLater> queue;
  Open* current = nullptr;  // Contains the message returned last.
  std::uint64_t open_bytes = 0;
  std::uint64_t given_count = 0;
  Decompressor decompressor;
  std::vector<std::byte> compressed;
};

MessageReader::MessageReader(const Reader& reader, MessageQuery query)
    : state_(std::make_unique<State>(reader, std::move(query))) {}
MessageReader::MessageReader(MessageReader&&) noexcept = default;
MessageReader::~MessageReader() = default;

std::optional<StoredMessage> MessageReader::next() {
  return state_->next();
}

std::optional<StoredMessage> MessageReader::State::next() {
  drop_finished();
  while (next_waiting < waiting.size() &&
         (queue.empty() || waiting[next_waiting]->begin_ns <= queue.top()->entry().log_time_ns)) {
    open(*waiting[next_waiting]);
    ++next_waiting;
  }
  if (queue.empty()) {
    check_count();
    return {};
  }
  current = queue.top();
  queue.pop();
  const Bytes record = current->records.subspan(static_cast<std::size_t>(current->entry().offset));
  const Bytes content =
      record.subspan(kFrameBytes, static_cast<std::size_t>(decode_frame(record).length));
  StoredMessage message{decode_as<Message>(content, place_of(*current->span)), nullptr};
  message.channel = reader.definitions_.find_channel(message.channel_id);
  ++given_count;
  return message;
}

/// Releases the message returned last, and its span if it was the last of it.
void MessageReader::State::drop_finished() {
  if (current == nullptr) {
    return;
  }
  ++current->next;
  if (current->next < current->entries.size()) {
    queue.push(current);
  } else {
    open_bytes -= current->span->uncompressed_size;
    std::erase_if(opened, [this](const auto& one) { return one.get() == current; });
  }
  current = nullptr;
}

void MessageReader::State::open(const Span& span) {
  const ReadLimits& limits = reader.options_.limits;
  if (span.uncompressed_size > limits.open_chunk_bytes ||
      open_bytes > limits.open_chunk_bytes - span.uncompressed_size) {
    damaged(place_of(span), Opcode::kChunk,
            fmt::format("at most {} bytes of chunks whose times overlap", limits.open_chunk_bytes),
            "more");
  }
  auto open = std::make_unique<Open>();
  open->span = &span;
  if (span.is_chunk) {
    open->records = read_chunk(*open);
  } else {
    open->memory.resize(static_cast<std::size_t>(span.length));
    reader.source_.read(span.offset, open->memory);
    open->records = open->memory;
  }
  find_messages(*open);
  if (!open->entries.empty()) {
    open_bytes += span.uncompressed_size;
    queue.push(open.get());
    opened.push_back(std::move(open));
  }
}

/// Reads and decompresses a chunk, and checks that it matches the index.
Bytes MessageReader::State::read_chunk(Open& open) {
  const Span& span = *open.span;
  const Place place = place_of(span);
  // Checked before reading: an index may claim more than chunks may have.
  if (span.uncompressed_size > reader.options_.limits.chunk_bytes) {
    damaged(place, Opcode::kChunk,
            fmt::format("at most {} bytes of records", reader.options_.limits.chunk_bytes),
            fmt::format("{}", span.uncompressed_size));
  }
  compressed = reader.read_record(Opcode::kChunk, span.offset, span.length);
  const Chunk chunk = decode_as<Chunk>(Bytes(compressed).subspan(kFrameBytes), place);
  if (chunk.uncompressed_size != span.uncompressed_size || chunk.compression != span.compression) {
    damaged(place, Opcode::kChunk,
            fmt::format("{} bytes, compression {}, as its index says", span.uncompressed_size,
                        shown(span.compression)),
            fmt::format("{} bytes, {}", chunk.uncompressed_size, shown(chunk.compression)));
  }
  const Bytes records = uncompress(chunk, reader.options_, place, decompressor, open.memory);
  if (records.data() == chunk.records.data()) {
    open.memory.swap(compressed);  // Not compressed: `records` point into it, and stay valid.
  }
  return records;
}

void MessageReader::State::find_messages(Open& open) const {
  const Span& span = *open.span;
  Place place = place_of(span);
  for (std::uint64_t offset = 0; offset < open.records.size();) {
    const Bytes rest = open.records.subspan(static_cast<std::size_t>(offset));
    place.offset_in_chunk = offset;
    const Frame frame = rest.size() < kFrameBytes ? Frame{} : decode_frame(rest);
    if (frame.opcode == Opcode{} || frame.length > rest.size() - kFrameBytes) {
      damaged(place, frame.opcode, "a record that ends before the chunk does",
              fmt::format("{} bytes left, {} needed", rest.size(), frame.length));
    }
    const Bytes content = rest.subspan(kFrameBytes, static_cast<std::size_t>(frame.length));
    if (frame.opcode == Opcode::kMessage) {
      const Message message = decode_as<Message>(content, place);
      reader.definitions_.require_channel(message.channel_id, place);
      if (message.log_time_ns < span.begin_ns || message.log_time_ns > span.end_ns) {
        damaged(place, Opcode::kMessage,
                fmt::format("log_time from {} to {}, as the index of its chunk says", span.begin_ns,
                            span.end_ns),
                fmt::format("{}", message.log_time_ns));
      }
      if (is_head[message.channel_id]) {
        open.entries.push_back({.log_time_ns = 0, .offset = offset});
      } else if (is_wanted[message.channel_id] && is_in_time(message.log_time_ns)) {
        open.entries.push_back({.log_time_ns = message.log_time_ns, .offset = offset});
      }
    } else {
      check_definition(frame.opcode, content, place);
    }
    offset += kFrameBytes + frame.length;
  }
  std::ranges::sort(open.entries, {},
                    [](const Entry& entry) { return std::pair(entry.log_time_ns, entry.offset); });
}

/// Definitions in a chunk must match those repeated in the summary.
void MessageReader::State::check_definition(Opcode opcode, Bytes content,
                                            const Place& place) const {
  const auto check = [&](const auto& found, const auto* known) {
    if (known == nullptr || *known != found) {
      damaged(place, opcode, fmt::format("what the summary has for id {}", found.id),
              "another one");
    }
  };
  if (opcode == Opcode::kSchema) {
    const auto schema = decode_as<Schema>(content, place);
    if (schema.id != 0) {
      check(schema, reader.definitions_.find_schema(schema.id));
    }
  } else if (opcode == Opcode::kChannel) {
    const auto channel = decode_as<Channel>(content, place);
    check(channel, reader.definitions_.find_channel(channel.id));
  } else if (opcode <= Opcode::kDataEnd) {
    damaged(place, opcode, "a Schema, Channel or Message in a chunk", "none of these");
  }
}

/// After reading everything, the number of messages must match the summary.
void MessageReader::State::check_count() const {
  if (wants_everything && reader.statistics_ && reader.statistics_->message_count != given_count) {
    damaged({.file = reader.source_.name(), .offset = reader.source_.size()}, Opcode::kStatistics,
            fmt::format("message_count {}, as many as there are in its chunks", given_count),
            fmt::format("{}", reader.statistics_->message_count));
  }
}

}  // namespace fastcycle::mcap
