// A file that the recorder wrote, cut off at every byte: each of these files opens, and gives every
// whole chunk, and of a last chunk that is not compressed every whole message.
//
// FASTCYCLE_CUT_BYTES says how large the file is at least (default: 60000). Reading each of 10
// million files from its beginning would take months. So a cut in the middle of a chunk is read
// from a shorter file, which has what stands before the first chunk (all schemas and channels) and
// the chunk with the cut, but not the chunks between. To the reader that is the same: of records
// behind it, it keeps schemas, channels, the section, and the CRC of the data section, which is
// looked at with DataEnd only; there the shorter file has 0, "not computed". A random sample is
// read in full as well, and has to be the same.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "mcap/encode.h"
#include "mcap/reader.h"
#include "mcap/record_reader.h"
#include "process/process.h"

namespace fastcycle::recorder_test {
namespace {

using nlohmann::json;
using test::Process;

constexpr std::size_t kSample = 100;
/// Magic bytes: with one of them missing, all records are there already.
constexpr std::size_t kEndBytes = 8;

std::size_t wanted_bytes() {
  const char* const given = std::getenv("FASTCYCLE_CUT_BYTES");
  return given == nullptr ? 60'000 : static_cast<std::size_t>(std::atoll(given));
}

/// A message, distinguishable from others.
struct Seen {
  std::string topic;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::size_t hash = 0;
  std::uint64_t end = 0;  ///< Where its record ends, or the chunk if that is compressed.

  bool operator==(const Seen& other) const {
    return topic == other.topic && sequence == other.sequence && log_time_ns == other.log_time_ns &&
           hash == other.hash;
  }
};

/// A chunk with its message indexes; for the last one also what stands behind it.
struct Part {
  std::uint64_t begin = 0;
  std::uint64_t chunk_end = 0;
  std::uint64_t end = 0;
  std::size_t first_message = 0;
  std::size_t messages = 0;
};

/// A whole file, and what is in it.
struct Whole {
  explicit Whole(std::string_view text);

  std::vector<std::byte> bytes;
  std::vector<Seen> messages;
  std::vector<Part> parts;
  std::uint64_t data_end = 0;  ///< Where DataEnd stands.
};

struct Reading {
  std::vector<Seen> messages;
  std::optional<mcap::Stop> stop;
};

/// All messages of a file in its order; `note` is called with each record before.
template <typename Note>
Reading read(mcap::Bytes bytes, const Note& note) {
  const mcap::MemorySource source(bytes, "cut");
  mcap::RecordReader reader(source);
  Reading reading;
  std::uint64_t chunk_offset = 0;
  bool is_compressed = false;
  while (const auto record = reader.next()) {
    note(reader, *record);
    if (const auto* chunk = std::get_if<mcap::Chunk>(&*record)) {
      chunk_offset = reader.place().offset;
      is_compressed = !chunk->compression.empty();
    }
    if (const auto* message = std::get_if<mcap::Message>(&*record)) {
      const bool is_in_chunk = reader.place().offset == chunk_offset;
      const std::uint64_t end = reader.offset_of_chunk_records() + *reader.place().offset_in_chunk +
                                mcap::kFrameBytes + mcap::kMessageHeadBytes + message->data.size();
      reading.messages.push_back(
          {.topic = reader.definitions().find_channel(message->channel_id)->topic,
           .sequence = message->sequence,
           .log_time_ns = message->log_time_ns,
           .hash = std::hash<std::string_view>()(mcap::text_of(message->data)),
           .end = is_in_chunk && is_compressed ? reader.next_offset() : end});
    }
  }
  reading.stop = reader.stop();
  return reading;
}

Reading read(mcap::Bytes bytes) {
  return read(bytes, [](const auto&, const auto&) {});
}

Whole::Whole(std::string_view text) {
  const mcap::Bytes content = mcap::bytes_of(text);
  bytes.assign(content.begin(), content.end());
  std::size_t counted = 0;
  const auto end_last_part = [this](std::uint64_t at) {
    if (!parts.empty()) {
      parts.back().end = at;
    }
  };
  messages = read(bytes, [&](const mcap::RecordReader& reader, const mcap::Record& record) {
               if (std::holds_alternative<mcap::Chunk>(record)) {
                 end_last_part(reader.place().offset);
                 parts.push_back({.begin = reader.place().offset,
                                  .chunk_end = reader.next_offset(),
                                  .end = 0,
                                  .first_message = counted,
                                  .messages = 0});
               } else if (std::holds_alternative<mcap::Message>(record)) {
                 ++counted;
                 ++parts.back().messages;
               } else if (std::holds_alternative<mcap::DataEnd>(record)) {
                 data_end = reader.place().offset;
               }
             }).messages;
  end_last_part(bytes.size());
}

/// Records some 0.8 MB/s until there are as many bytes: many small messages, and now and then one
/// that the recorder borrows.
std::string record(std::size_t bytes, const std::string& compression) {
  const auto count = static_cast<std::int64_t>(bytes / 2'600 + 20);
  const std::int64_t large_count = count / 1'000;
  const auto stream = [](const char* name, std::int64_t size, std::int64_t period_us,
                         std::int64_t messages) {
    return json{{"name", name},
                {"library", "recorder_parts"},
                {"params",
                 {{"size_bytes", size},
                  {"period_us", period_us},
                  {"count", messages},
                  {"is_noise", true}}}};
  };
  json application = {{"name", "cut"}, {"components", json::array()}};
  application["components"].push_back(stream("radar", 2'000, 3'000, count));
  application["components"].push_back(stream("imu", 200, 1'000, 3 * count));
  if (large_count > 0) {
    application["components"].push_back(
        stream("camera", 140'000, 3'000 * count / (large_count + 1), large_count));
  }
  const test::Folder folder;
  folder.write("app.json", application.dump());
  const std::filesystem::path file = folder / "drive.mcap";
  Process process({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"run", (folder / "app.json").string(), "--debuggable", "--quiet",
                                 "--record", file.string(), "--record-compression", compression}});
  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
  return test::read_file(file);
}

/// Of each compression one file, recorded when it is asked for first.
const Whole* whole_file(const std::string& compression) {
  static std::map<std::string, Whole> files;
  const auto found = files.find(compression);
  return found != files.end()
             ? &found->second
             : &files.emplace(compression, record(wanted_bytes(), compression)).first->second;
}

class CutFiles : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    ASSERT_GE(whole_.bytes.size(), wanted_bytes() / 2);  // Compressed, it may be smaller.
    ASSERT_GE(whole_.parts.size(), 2U);
  }

  /// How many messages of `part` a file has that ends before byte `cut`.
  [[nodiscard]] std::size_t messages_before(const Part& part, std::uint64_t cut) const {
    if (cut >= part.chunk_end) {
      return part.messages;
    }
    const auto begin = whole_.messages.begin() + static_cast<std::ptrdiff_t>(part.first_message);
    const auto end = begin + static_cast<std::ptrdiff_t>(part.messages);
    return static_cast<std::size_t>(
        std::upper_bound(begin, end, cut,
                         [](std::uint64_t at, const Seen& message) { return at < message.end; }) -
        begin);
  }

  /// Opens the file and counts what it has. False, and a failure, if that is not what it must be.
  [[nodiscard]] static bool opens(mcap::Bytes file, std::size_t messages, std::size_t chunks,
                                  std::uint64_t cut, bool is_cut = true) {
    try {
      const mcap::MemorySource source(file, "cut");
      const mcap::Reader reader(source);
      if (reader.statistics()->message_count == messages &&
          reader.statistics()->chunk_count == chunks && reader.problem().has_value() == is_cut) {
        return true;
      }
      ADD_FAILURE() << "cut at " << cut << ": expected " << messages << " messages in " << chunks
                    << " chunks, found " << reader.statistics()->message_count << " in "
                    << reader.statistics()->chunk_count;
    } catch (const std::exception& error) {
      ADD_FAILURE() << "cut at " << cut << ": " << error.what();
    }
    return false;
  }

  /// The file without the chunks between its first one and `part`.
  [[nodiscard]] std::vector<std::byte> without_chunks_before(const Part& part) const {
    const auto& bytes = whole_.bytes;
    const auto at = [&](std::uint64_t offset) {
      return bytes.begin() + static_cast<std::ptrdiff_t>(offset);
    };
    std::vector<std::byte> shorter(at(0), at(whole_.parts.front().begin));
    shorter.insert(shorter.end(), at(part.begin), at(part.end));
    if (whole_.data_end > part.begin && whole_.data_end < part.end) {
      constexpr std::size_t kFrame = 9;
      const auto crc =
          shorter.begin() + static_cast<std::ptrdiff_t>(whole_.parts.front().begin +
                                                        whole_.data_end - part.begin + kFrame);
      std::fill(crc, crc + 4, std::byte{});
    }
    return shorter;
  }

  [[nodiscard]] mcap::Bytes cut_at(std::uint64_t cut) const {
    return mcap::Bytes(whole_.bytes).first(static_cast<std::size_t>(cut));
  }

  [[nodiscard]] std::vector<std::uint64_t> random_cuts(std::size_t count) const {
    std::mt19937_64 random(std::random_device{}());
    std::vector<std::uint64_t> cuts;
    while (cuts.size() < count) {
      cuts.push_back(random() % whole_.bytes.size());
    }
    return cuts;
  }

  test::Folder folder_;
  const Whole& whole_ = *whole_file(GetParam());
};

INSTANTIATE_TEST_SUITE_P(Compressions, CutFiles, testing::Values("none", "lz4", "zstd"),
                         [](const auto& kind) { return std::string(kind.param); });

TEST_P(CutFiles, OpenAndGiveEveryWholeChunkWhereverTheyAreCut) {
  const std::uint64_t preamble = whole_.parts.front().begin;
  const std::uint64_t size = whole_.bytes.size();
  for (std::uint64_t cut = 0; cut < preamble; ++cut) {
    ASSERT_TRUE(opens(cut_at(cut), 0, 0, cut));
  }
  for (const Part& part : whole_.parts) {
    const std::vector<std::byte> shorter = without_chunks_before(part);
    const std::uint64_t end = std::min(part.end, size - kEndBytes);
    for (std::uint64_t cut = part.begin; cut < end; ++cut) {
      const mcap::Bytes file =
          mcap::Bytes(shorter).first(static_cast<std::size_t>(preamble + cut - part.begin));
      ASSERT_TRUE(opens(file, messages_before(part, cut), cut >= part.chunk_end ? 1 : 0, cut));
    }
  }
  for (std::uint64_t cut = size - kEndBytes; cut < size; ++cut) {
    ASSERT_TRUE(opens(cut_at(cut), whole_.messages.size(), whole_.parts.size(), cut));
  }
  ASSERT_TRUE(opens(whole_.bytes, whole_.messages.size(), whole_.parts.size(), size, false));
}

TEST_P(CutFiles, HaveTheSameMessagesAsTheWholeOne) {
  for (const std::uint64_t cut : random_cuts(kSample)) {
    const Reading reading = read(cut_at(cut));

    EXPECT_EQ(reading.stop->reason, mcap::Stop::Reason::kTruncated) << "cut at " << cut;
    std::size_t expected = 0;
    for (const Part& part : whole_.parts) {
      expected += part.begin <= cut ? messages_before(part, cut) : 0;
    }
    ASSERT_EQ(reading.messages.size(), expected) << "cut at " << cut;
    EXPECT_TRUE(
        std::equal(reading.messages.begin(), reading.messages.end(), whole_.messages.begin()))
        << "cut at " << cut;
  }
}

// FASTCYCLE_NPM_READER is tests/npm/read_log.mjs where its packages are.
TEST_P(CutFiles, AreReadUpToTheLastWholeChunkByTheReaderOfNpm) {
  const char* const script = std::getenv("FASTCYCLE_NPM_READER");
  if (script == nullptr) {
    GTEST_SKIP() << "FASTCYCLE_NPM_READER is not set";
  }
  const std::vector<std::uint64_t> cuts = random_cuts(kSample / 5);
  std::vector<std::string> words{"node", script, "count"};
  for (const std::uint64_t cut : cuts) {
    const auto file = folder_ / std::to_string(cut);
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(whole_.bytes.data()),
               static_cast<std::streamsize>(cut));
    words.push_back(file.string());
  }
  Process process({.program = "/usr/bin/env", .arguments = words});
  ASSERT_EQ(process.wait().exit_code, 0) << process.errors();

  std::map<std::string, json> lines;
  std::istringstream output(process.output());
  for (std::string line; std::getline(output, line);) {
    const json found = json::parse(line);
    lines[found.at("file")] = found;
  }
  for (const std::uint64_t cut : cuts) {
    std::map<std::string, std::uint64_t> expected;
    for (const Part& part : whole_.parts) {
      for (std::size_t i = 0; part.chunk_end <= cut && i < part.messages; ++i) {
        ++expected[whole_.messages[part.first_message + i].topic];
      }
    }
    const json& line = lines.at((folder_ / std::to_string(cut)).string());
    EXPECT_EQ(line.at("error"), nullptr) << "cut at " << cut;
    EXPECT_EQ((line.at("topics").get<std::map<std::string, std::uint64_t>>()), expected)
        << "cut at " << cut;
  }
}

}  // namespace
}  // namespace fastcycle::recorder_test
