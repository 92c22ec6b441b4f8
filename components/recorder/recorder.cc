#include <chrono>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "config/description.h"
#include "fastcycle/fastcycle.h"
#include "host/recording.h"

namespace {

/// A component that records its application.
class Recorder final : public fastcycle::Component {
 public:
  explicit Recorder(fastcycle::Context& context) : Component(context) {
    using fastcycle::config::Compression;
    fastcycle::config::RecordDescription record;
    record.file =
        context.param<fastcycle::Path>("file", {.fallback = fastcycle::Path("recording.mcap")})
            .get();
    record.topics = context.param<Texts>("topics", {.fallback = Texts{}}).get();
    record.except = context.param<Texts>("except", {.fallback = Texts{}}).get();
    record.compression =
        context
            .param<Compression>("compression", {.fallback = record.compression,
                                                .names = {{"none", Compression::kNone},
                                                          {"lz4", Compression::kLz4},
                                                          {"zstd", Compression::kZstd}}})
            .get();
    record.split_bytes = bytes_of(number("split_mb", 0, 0, 1e9, "MB"));
    record.split_time = nanoseconds_of(number("split_s", 0, 0, 86'400, "s") * 1e9);
    record.sync_interval = nanoseconds_of(number("sync_ms", 1'000, 0, 86'400'000, "ms") * 1e6);
    record.memory_bytes = bytes_of(number("memory_mb", 256, 1, 1e6, "MB"));
    record.has_activations = context.param<bool>("activations", {.fallback = true}).get();
    record.is_background = context.param<bool>("background", {.fallback = false}).get();
    fastcycle::host::record_for(context.core(), record);
  }

 private:
  using Texts = std::vector<std::string>;

  double number(const char* name, double fallback, double min, double max, const char* unit) {
    return context()
        .param<double>(name, {.fallback = fallback, .min = min, .max = max, .unit = unit})
        .get();
  }
  static std::uint64_t bytes_of(double megabytes) {
    return static_cast<std::uint64_t>(std::llround(megabytes * 1e6));
  }
  static std::chrono::nanoseconds nanoseconds_of(double nanoseconds) {
    return std::chrono::nanoseconds(std::llround(nanoseconds));
  }
};

}  // namespace

FASTCYCLE_COMPONENTS(Recorder);
