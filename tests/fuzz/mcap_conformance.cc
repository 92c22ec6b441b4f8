// Takes any bytes as a file for either direction of the conformance program. What is not said by an
// exception is a bug of ours.

#include <cstddef>
#include <cstdint>
#include <exception>
#include <span>
#include <string_view>

#include <nlohmann/json.hpp>

#include "conformance.h"
#include "mcap/file.h"

namespace {

using namespace fastcycle;  // NOLINT(google-build-using-namespace): all of this file is about it.

void read(mcap::Bytes bytes) {
  try {
    (void)conformance::read_records(mcap::MemorySource(bytes));
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): it is said.
  }
}

void write(std::string_view text) {
  try {
    mcap::MemorySink sink;
    conformance::write_file(nlohmann::json::parse(text), sink);
    read(sink.bytes());
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): it is said.
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mcap::Bytes bytes = std::as_bytes(std::span(data, size));
  read(bytes);
  write(mcap::text_of(bytes));
  return 0;
}
