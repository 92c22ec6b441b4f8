// Recovers and examines any bytes. What is recovered can always be read; what the doctor finds in
// order is not to be mended.

#include <cstddef>
#include <cstdint>
#include <span>

#include "archive/doctor.h"
#include "archive/recover.h"
#include "fastcycle/assert.h"
#include "mcap/error.h"
#include "mcap/file.h"

namespace {

using namespace fastcycle;  // NOLINT(google-build-using-namespace): a program of one page.

// Small, so that a fuzzer finds what lies beyond them.
constexpr mcap::ReadLimits kLimits{.record_bytes = std::uint64_t{4} << 20U,
                                   .small_record_bytes = std::uint64_t{1} << 20U,
                                   .chunk_bytes = std::uint64_t{4} << 20U,
                                   .definition_bytes = std::uint64_t{4} << 20U,
                                   .index_bytes = std::uint64_t{4} << 20U,
                                   .open_chunk_bytes = std::uint64_t{16} << 20U};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mcap::MemorySource source(std::as_bytes(std::span(data, size)));
  const archive::Diagnosis diagnosis =
      archive::diagnose(source, [](const archive::Finding& /*finding*/) {}, kLimits);

  mcap::MemorySink sink;
  const archive::Recovery recovery =
      archive::recover(source, sink, {.chunk = {}, .limits = kLimits});
  const mcap::MemorySource written(sink.bytes(), "recovered");
  archive::verify(written, recovery.kept);
  const archive::Diagnosis after =
      archive::diagnose(written, [](const archive::Finding& /*finding*/) {});

  FASTCYCLE_ASSERT(after.messages == recovery.kept.messages, "all that was kept can be read");
  FASTCYCLE_ASSERT(diagnosis.errors > 0 ||
                       (recovery.loss_count == 0 && recovery.kept.messages == diagnosis.messages),
                   "what is in order is kept");
  return 0;
}
