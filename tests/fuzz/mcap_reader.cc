// Reads any bytes as an MCAP file, both ways. What is not said by a `Damage` is a bug of ours.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "fastcycle/assert.h"
#include "mcap/error.h"
#include "mcap/file.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"

namespace {

using namespace fastcycle::mcap;  // NOLINT(google-build-using-namespace): all of this file is about
                                  // it.

// Small, so that a fuzzer finds what lies beyond them.
constexpr ReadLimits kLimits{.record_bytes = std::uint64_t{4} << 20U,
                             .small_record_bytes = std::uint64_t{1} << 20U,
                             .chunk_bytes = std::uint64_t{4} << 20U,
                             .definition_bytes = std::uint64_t{4} << 20U,
                             .index_bytes = std::uint64_t{4} << 20U,
                             .open_chunk_bytes = std::uint64_t{16} << 20U};

/// Adds up all bytes, so that the address sanitizer sees that they are there.
void touch(Bytes bytes) {
  static volatile unsigned sum = 0;
  for (const std::byte byte : bytes) {
    sum = sum + std::to_integer<unsigned>(byte);
  }
}

struct Streamed {
  bool is_whole = false;
  std::size_t message_count = 0;
};

Streamed stream(const Source& source, const ReadOptions& options) {
  RecordReader reader(source, options);
  Streamed result;
  bool was_damaged = false;
  do {
    while (const std::optional<Record> record = reader.next()) {
      if (const auto* message = std::get_if<Message>(&*record)) {
        touch(message->data);
        ++result.message_count;
      }
    }
    was_damaged = was_damaged || reader.stop()->reason == Stop::Reason::kDamaged;
  } while (reader.resume());
  result.is_whole = !was_damaged;
  return result;
}

std::size_t read_messages(const Reader& reader, const MessageQuery& query) {
  MessageReader messages = reader.messages(query);
  std::size_t count = 0;
  std::uint64_t last_ns = 0;
  while (const std::optional<StoredMessage> message = messages.next()) {
    FASTCYCLE_ASSERT(message->log_time_ns >= last_ns, "messages come in the order of their times");
    FASTCYCLE_ASSERT(message->channel != nullptr, "a message has a channel");
    last_ns = message->log_time_ns;
    touch(message->data);
    ++count;
  }
  return count;
}

/// How many messages there are; none if something is wrong.
std::optional<std::size_t> read_all(const Source& source, const ReadOptions& options) {
  try {
    const Reader reader(source, options);
    std::vector<std::byte> memory;
    for (const AttachmentIndex& index : reader.attachments()) {
      touch(reader.read(index, memory).data);
    }
    for (const MetadataIndex& index : reader.metadata()) {
      (void)reader.read(index);
    }
    (void)read_messages(reader, {.topics = {"control/speed"}, .begin_ns = 20, .end_ns = 90});
    return read_messages(reader, {});
  } catch (const Damage&) {
    return {};
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const MemorySource source(std::as_bytes(std::span(data, size)));
  (void)stream(source, {.check_crcs = true, .limits = kLimits});
  const Streamed streamed = stream(source, {.check_crcs = false, .limits = kLimits});
  (void)read_all(source, {.check_crcs = false, .limits = kLimits});
  const std::optional<std::size_t> scanned =
      read_all(source, {.check_crcs = false, .use_summary = false, .limits = kLimits});
  FASTCYCLE_ASSERT(!streamed.is_whole || !scanned || *scanned == streamed.message_count,
                   "both ways find the same messages");
  return 0;
}
