#include "archive/recover.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "archive/readable.h"
#include "archive/tail.h"
#include "mcap/crc.h"
#include "mcap/decode.h"
#include "mcap/encode.h"
#include "mcap/reader.h"
#include "mcap/writer.h"

namespace fastcycle::archive {
namespace {

// Limits the cost of repeated restarts in the middle of a hostile file.
constexpr int kMostRestarts = 10'000;
constexpr std::uint64_t kMostRestartBytes = std::uint64_t{1} << 30U;

/// Adds up what a file has.
class Summer {
 public:
  void add(const mcap::Message& message) {
    ++sum_.messages;
    const auto head = mcap::encode_head(message, message.data.size());
    messages_.add(head);
    messages_.add(message.data);
  }

  void add(const mcap::Attachment& attachment) {
    ++sum_.attachments;
    scratch_.clear();
    mcap::encode_head(attachment, attachment.data.size(), scratch_);
    attachments_.add(scratch_);
    attachments_.add(attachment.data);
  }

  void add(const mcap::Metadata& metadata) {
    ++sum_.metadata;
    scratch_.clear();
    mcap::encode(metadata, scratch_);
    metadata_.add(scratch_);
  }

  [[nodiscard]] ContentSum sum() const {
    ContentSum sum = sum_;
    sum.messages_crc = messages_.value();
    sum.attachments_crc = attachments_.value();
    sum.metadata_crc = metadata_.value();
    return sum;
  }

 private:
  ContentSum sum_;
  mcap::Crc messages_;
  mcap::Crc attachments_;
  mcap::Crc metadata_;
  std::vector<std::byte> scratch_;
};

std::uint64_t load_u64(mcap::Bytes bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = sizeof(value); i-- > 0;) {
    value = value << 8U | std::to_integer<std::uint64_t>(bytes[i]);
  }
  return value;
}

/// Whether the bytes, which are the beginning of the rest of a file, look like a chunk that is
/// whole.
bool is_chunk(mcap::Bytes bytes, std::uint64_t left) {
  constexpr std::size_t kBeforeCompression = mcap::kFrameBytes + 8 + 8 + 8 + 4;
  constexpr std::uint64_t kFieldBytes = 8 + 8 + 8 + 4 + 4 + 8;
  const mcap::Frame frame = mcap::decode_frame(bytes);
  if (frame.length < kFieldBytes || frame.length > left - mcap::kFrameBytes) {
    return false;
  }
  std::array<std::byte, 4> length{};
  std::copy_n(bytes.begin() + kBeforeCompression, length.size(), length.begin());
  const bool is_short = length == mcap::encode_u32(0) || length == mcap::encode_u32(3) ||
                        length == mcap::encode_u32(4);
  if (!is_short) {
    return false;
  }
  try {
    const mcap::Chunk chunk = mcap::decode_begun_chunk(bytes.subspan(mcap::kFrameBytes), {});
    const auto compression = mcap::find_compression(chunk.compression);
    const std::uint64_t records = frame.length - kFieldBytes - chunk.compression.size();
    return compression &&
           load_u64(bytes.subspan(kBeforeCompression + 4 + chunk.compression.size())) == records &&
           mcap::can_become(*compression, records, chunk.uncompressed_size);
  } catch (const mcap::Damage&) {
    return false;
  }
}

/// Where the first chunk from `from` on begins; none if there is no further one.
std::optional<std::uint64_t> find_chunk(const mcap::Source& file, std::uint64_t from) {
  constexpr std::size_t kBlock = std::size_t{64} << 10U;
  constexpr std::size_t kLook = 64;  // More than all fields of a chunk before its records.
  mcap::Window window(file);
  for (std::uint64_t at = from; at < file.size() && file.size() - at >= kLook;) {
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, file.size() - at));
    const mcap::Bytes block = window.view(at, size);
    const void* const found =
        std::memchr(block.data(), static_cast<int>(mcap::Opcode::kChunk), block.size());
    if (found == nullptr) {
      at += size;
      continue;
    }
    at += static_cast<std::uint64_t>(static_cast<const std::byte*>(found) - block.data());
    const std::uint64_t left = file.size() - at;
    if (left >= kLook && is_chunk(window.view(at, kLook), left)) {
      return at;
    }
    ++at;
  }
  return {};
}

bool is_index(std::string_view record) {
  using mcap::name_of;
  using mcap::Opcode;
  return record == name_of(Opcode::kMessageIndex) || record == name_of(Opcode::kChunkIndex) ||
         record == name_of(Opcode::kAttachmentIndex) || record == name_of(Opcode::kStatistics) ||
         record == name_of(Opcode::kMetadataIndex) || record == name_of(Opcode::kSummaryOffset) ||
         record == name_of(Opcode::kFooter);
}

/// Reads one file and writes another one.
class Recoverer {
 public:
  Recoverer(const mcap::Source& in, mcap::Sink& out, const RecoverOptions& options,
            const Progress& progress)
      : in_(in), out_(out), options_(options), progress_(progress) {
    limits_.definition_bytes = std::min(limits_.definition_bytes, kMostDefinitionBytes);
    read_summary(in, limits_, [this](const mcap::Record& record) {
      if (const auto* schema = std::get_if<mcap::Schema>(&record)) {
        spare_.add(*schema, {});
      } else if (const auto* channel = std::get_if<mcap::Channel>(&record)) {
        spare_.add(*channel, {});
      } else if (const auto* statistics = std::get_if<mcap::Statistics>(&record)) {
        statistics_ = *statistics;
      }
    });
  }

  Recovery run() {
    std::optional<std::uint64_t> from = 0;
    for (int restarts = 0; from; ++restarts) {
      from = read_from(*from, restarts < kMostRestarts && restart_bytes_ < kMostRestartBytes);
    }
    settle_messages();
    if (!writer_) {
      begin({});
    }
    writer_->close();
    result_.kept = sum_.sum();
    compare_with_statistics();
    return std::move(result_);
  }

 private:
  /// Reads as far as possible. Returns where to continue, if there is such a place.
  std::optional<std::uint64_t> read_from(std::uint64_t from, bool may_restart) {
    const Tail tail(in_, from, from == 0 ? std::vector<std::byte>{} : beginning());
    mcap::RecordReader reader(tail, {.limits = limits_});
    for (;;) {
      while (const std::optional<mcap::Record> record = reader.next()) {
        take(*record, reader);
        report(tail.in_whole(reader.next_offset()));
      }
      if (reader.stop()->reason == mcap::Stop::Reason::kEnd) {
        return {};
      }
      const mcap::Problem problem = translated(reader.stop()->problem, tail);
      std::optional<std::uint64_t> next;
      if (reader.resume()) {
        next = tail.in_whole(reader.next_offset());
        if (from == 0 || !is_about_all(problem)) {
          note(problem, 0, reader, *next);
        }
        if (may_restart && has_lost_definitions(problem, reader)) {
          return next;
        }
        continue;
      }
      learn(reader.definitions());
      // Of a chunk that is cut off, the records before the problem were used.
      const std::uint64_t used =
          problem.place.offset_in_chunk
              ? tail.in_whole(reader.offset_of_chunk_records()) + *problem.place.offset_in_chunk
              : problem.place.offset;
      if (may_restart && may_be_followed(problem, reader)) {
        next = find_chunk(in_, used + 1);
      }
      const std::uint64_t end = next.value_or(in_.size());
      note(problem, end - std::min(end, used), reader, end);
      return next;
    }
  }

  /// Whether the first chunk that is lost may have defined what follows; the summary has it then.
  bool has_lost_definitions(const mcap::Problem& problem, const mcap::RecordReader& reader) {
    const bool is_first = problem.record == mcap::name_of(mcap::Opcode::kChunk) &&
                          !problem.place.offset_in_chunk && !std::exchange(has_looked_, true);
    return is_first && learn(reader.definitions());
  }

  /// A CRC or an offset that counts from the beginning of the file, and cannot be checked from a
  /// later one.
  [[nodiscard]] static bool is_about_all(const mcap::Problem& problem) {
    return problem.record == mcap::name_of(mcap::Opcode::kDataEnd) ||
           problem.record == mcap::name_of(mcap::Opcode::kFooter);
  }

  /// Keeps what is known of schemas and channels; whether the summary has more than `known`.
  bool learn(const mcap::Definitions& known) {
    definitions_ = known;
    for (const auto& [id, schema] : spare_.schemas()) {
      if (known.find_schema(id) == nullptr) {
        definitions_.add(schema, {});
      }
    }
    for (const auto& [id, channel] : spare_.channels()) {
      if (known.find_channel(id) == nullptr) {
        definitions_.add(channel, {});
      }
    }
    return definitions_.schemas().size() > known.schemas().size() ||
           definitions_.channels().size() > known.channels().size();
  }

  /// Magic, header, and what is known of schemas and channels: what a reader needs before chunks.
  std::vector<std::byte> beginning() {
    std::vector<std::byte> bytes = beginning_of_file();
    for (const auto& [id, schema] : definitions_.schemas()) {
      mcap::encode(schema, bytes);
    }
    for (const auto& [id, channel] : definitions_.channels()) {
      mcap::encode(channel, bytes);
    }
    restart_bytes_ += bytes.size();
    return bytes;
  }

  [[nodiscard]] mcap::Problem translated(mcap::Problem problem, const Tail& tail) const {
    problem.place.offset = tail.in_whole(problem.place.offset);
    if (problem.found.starts_with("the end of the file")) {
      problem.found = fmt::format("the end of the file, at byte {}", in_.size());
    }
    return problem;
  }

  /// Whether something can be behind the problem: not where the file is cut off in a record.
  [[nodiscard]] static bool may_be_followed(const mcap::Problem& problem,
                                            const mcap::RecordReader& reader) {
    const bool is_cut_off = reader.stop()->reason == mcap::Stop::Reason::kTruncated &&
                            !problem.record.starts_with("record of opcode");
    return !is_cut_off && !reader.is_past_data();
  }

  void begin(const mcap::Header& header) {
    writer_.emplace(
        out_, mcap::WriterOptions{
                  .profile = header.profile, .library = "fastcycle", .chunk = options_.chunk});
  }

  /// @errors  `mcap::Error` if there is more than readers take.
  mcap::Writer& writer() {
    if (!writer_) {
      begin({});
    }
    require_readable(*writer_, in_.name());
    return *writer_;
  }

  void take(const mcap::Record& record, const mcap::RecordReader& reader) {
    const auto* index = std::get_if<mcap::MessageIndex>(&record);
    if (index != nullptr) {
      indexed_messages_ = indexed_messages_.value_or(0) + index->entries.size();
      return;
    }
    if (!reader.place().offset_in_chunk) {
      settle_messages();
    }
    std::visit([this](const auto& one) { keep(one); }, record);
  }

  void keep(const mcap::Header& header) {
    if (!writer_) {
      begin(header);
    }
  }
  void keep(const mcap::Schema& schema) { writer().add(schema); }
  void keep(const mcap::Channel& channel) { writer().add(channel); }

  void keep(const mcap::Message& message) {
    ++chunk_messages_;
    if (message.data.size() > kMostMessageBytes) {
      add_loss({.problem = {.place = {.file = in_.name()},
                            .record = mcap::name_of(mcap::Opcode::kMessage),
                            .expected = fmt::format("at most {} bytes", kMostMessageBytes),
                            .found = fmt::format("{}", message.data.size())},
                .bytes = message.data.size(),
                .messages = 1});
      return;
    }
    write_readably(writer(), message, message.data);
    sum_.add(message);
  }

  void keep(const mcap::Attachment& attachment) {
    writer().write(attachment);
    sum_.add(attachment);
  }
  void keep(const mcap::Metadata& metadata) {
    writer().write(metadata);
    sum_.add(metadata);
  }

  template <typename Other>
  void keep(const Other& /*made anew*/) {}

  // ---- Losses ----

  [[nodiscard]] static bool is_lost_chunk(const mcap::Problem& problem) {
    return problem.record == mcap::name_of(mcap::Opcode::kChunk) || problem.place.offset_in_chunk;
  }

  /// Records a problem, after which reading continues at `next`; `bytes` were not used if they are
  /// known, else all up to there.
  void note(const mcap::Problem& problem, std::uint64_t bytes, const mcap::RecordReader& reader,
            std::uint64_t next) {
    const mcap::Place& place = problem.place;
    if (!place.offset_in_chunk) {
      settle_messages();
    }
    if (costs_nothing(problem, reader)) {
      if (result_.mended.size() < Recovery::kMostListed) {
        result_.mended.push_back(problem);
      }
      return;
    }
    const bool is_record_of_file =
        !place.offset_in_chunk && problem.record != mcap::name_of(mcap::Opcode::kDataEnd);
    add_loss({.problem = problem,
              .bytes = is_record_of_file ? next - place.offset : bytes,
              .messages = {}});
    chunk_lost_ = chunk_lost_ || is_lost_chunk(problem);
  }

  [[nodiscard]] static bool is_message_index(const mcap::Problem& problem) {
    return problem.record == mcap::name_of(mcap::Opcode::kMessageIndex);
  }

  [[nodiscard]] bool costs_nothing(const mcap::Problem& problem,
                                   const mcap::RecordReader& reader) const {
    const std::uint64_t offset = problem.place.offset;
    const bool is_truncated =
        reader.stop() && reader.stop()->reason == mcap::Stop::Reason::kTruncated;
    // A message index that is wrong may be something else, of which the first byte is wrong: who
    // counts all messages knows.
    if (reader.is_past_data() ||
        (is_index(problem.record) && (is_truncated || statistics_ || !is_message_index(problem)))) {
      return true;
    }
    if (!is_truncated || problem.place.offset_in_chunk) {
      return false;
    }
    if (offset >= in_.size() || problem.record == mcap::name_of(mcap::Opcode::kDataEnd)) {
      return true;
    }
    // Not even its length is there: its opcode is.
    std::array<std::byte, 1> opcode{};
    in_.read(offset, opcode);
    return is_index(mcap::name_of(static_cast<mcap::Opcode>(opcode[0]))) ||
           static_cast<mcap::Opcode>(opcode[0]) == mcap::Opcode::kDataEnd;
  }

  void add_loss(Loss loss) {
    ++result_.loss_count;
    result_.lost_bytes += loss.bytes;
    if (result_.losses.size() < Recovery::kMostListed) {
      result_.losses.push_back(std::move(loss));
    }
  }

  /// The summary counts all messages: those that are not there are lost, wherever they were.
  void compare_with_statistics() {
    const std::uint64_t kept = result_.kept.messages;
    if (!statistics_ || statistics_->message_count <= kept) {
      return;
    }
    const std::uint64_t lost = statistics_->message_count - kept;
    if (result_.loss_count == 0) {
      add_loss({.problem = {.place = {.file = in_.name(), .offset = in_.size()},
                            .record = mcap::name_of(mcap::Opcode::kStatistics),
                            .expected = fmt::format("{} messages", statistics_->message_count),
                            .found = fmt::format("{}", kept)},
                .bytes = 0,
                .messages = {}});
    }
    if (result_.loss_count == 1) {
      result_.losses.front().messages = lost;
    }
    result_.lost_messages = lost;
  }

  /// A chunk, and the message indexes behind it, are over: what they have beyond what came is lost.
  void settle_messages() {
    if (chunk_lost_ && indexed_messages_ && *indexed_messages_ >= chunk_messages_) {
      const std::uint64_t lost = *indexed_messages_ - chunk_messages_;
      result_.lost_messages += lost;
      if (result_.losses.size() == result_.loss_count && !result_.losses.empty()) {
        result_.losses.back().messages = lost;
      }
    }
    chunk_lost_ = false;
    chunk_messages_ = 0;
    indexed_messages_.reset();
  }

  void report(std::uint64_t bytes) {
    if (progress_ && ++records_ % kRecordsPerProgress == 0) {
      progress_(bytes);
    }
  }

  const mcap::Source& in_;
  mcap::Sink& out_;
  const RecoverOptions options_;
  const Progress& progress_;
  mcap::ReadLimits limits_ = options_.limits;

  std::optional<mcap::Writer> writer_;
  std::optional<mcap::Statistics> statistics_;  // Of the summary.
  mcap::Definitions spare_;                     // Those of the summary.
  mcap::Definitions definitions_;               // Those with which reading continues.
  bool has_looked_ = false;  // For definitions of a lost chunk; then all are known.
  Summer sum_;
  Recovery result_;
  std::uint64_t restart_bytes_ = 0;
  unsigned records_ = 0;

  // Of the chunk that is being read, and the message indexes behind it.
  bool chunk_lost_ = false;
  std::uint64_t chunk_messages_ = 0;
  std::optional<std::uint64_t> indexed_messages_;
};

[[noreturn]] void differs(const mcap::Source& file, std::string expected, std::string found) {
  throw mcap::Error({.place = {.file = file.name(), .offset = file.size()},
                     .record = {},
                     .expected = std::move(expected),
                     .found = std::move(found)});
}

}  // namespace

Recovery recover(const mcap::Source& in, mcap::Sink& out, const RecoverOptions& options,
                 const Progress& progress) {
  return Recoverer(in, out, options, progress).run();
}

void verify(const mcap::Source& file, const ContentSum& written, const Progress& progress) {
  mcap::RecordReader reader(file);
  Summer sum;
  unsigned records = 0;
  while (const std::optional<mcap::Record> record = reader.next()) {
    std::visit(
        [&](const auto& one) {
          if constexpr (requires { sum.add(one); }) {
            sum.add(one);
          }
        },
        *record);
    if (progress && ++records % kRecordsPerProgress == 0) {
      progress(reader.next_offset());
    }
  }
  if (reader.stop()->reason != mcap::Stop::Reason::kEnd) {
    throw mcap::Error(reader.stop()->problem);
  }
  const ContentSum found = sum.sum();
  if (found != written) {
    differs(
        file,
        fmt::format("{} messages, {} attachments, {} metadata, as they were written",
                    written.messages, written.attachments, written.metadata),
        fmt::format("{}, {}, {}, or others", found.messages, found.attachments, found.metadata));
  }
  const mcap::Reader indexed(file);
  if (indexed.was_scanned() || indexed.statistics()->message_count != written.messages) {
    differs(file, fmt::format("a summary that counts {} messages", written.messages), "another");
  }
}

}  // namespace fastcycle::archive
