#include "archive/readable.h"

#include <fmt/format.h>

#include "mcap/error.h"

namespace fastcycle::archive {

void require_readable(const mcap::Writer& writer, const std::string& file) {
  if (writer.index_bytes() > kMostIndexBytes) {
    throw mcap::Error(
        {.place = {.file = file},
         .record = {},
         .expected = fmt::format("content with at most {} bytes of index", kMostIndexBytes),
         .found = "more"});
  }
}

void require_messages(const std::optional<mcap::Problem>& problem, std::uint64_t messages) {
  if (problem && messages == 0) {
    throw mcap::Error(
        {.place = problem->place,
         .record = problem->record,
         .expected = "at least one whole message before the file ends or is damaged",
         .found = "none: expected " + problem->expected + ", found " + problem->found});
  }
}

void write_readably(mcap::Writer& writer, const mcap::MessageHead& head, mcap::Bytes data) {
  constexpr std::uint64_t kLarge = std::uint64_t{16} << 20U;
  if (data.size() > kLarge) {
    writer.flush();  // It gets a chunk without the schemas and channels that wait for one.
  }
  writer.write(head, {&data, 1});
}

}  // namespace fastcycle::archive
