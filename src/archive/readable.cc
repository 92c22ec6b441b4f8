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

void write_readably(mcap::Writer& writer, const mcap::MessageHead& head, mcap::Bytes data) {
  constexpr std::uint64_t kLarge = std::uint64_t{16} << 20U;
  if (data.size() > kLarge) {
    writer.flush();  // It gets a chunk without the schemas and channels that wait for one.
  }
  writer.write(head, {&data, 1});
}

}  // namespace fastcycle::archive
