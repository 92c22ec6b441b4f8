#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "config/problem.h"
#include "config/value.h"

namespace fastcycle::config {

/// Limits of a file, so that a hostile or broken one costs little.
inline constexpr std::size_t kMaxFileBytes = std::size_t{16} << 20U;
inline constexpr std::size_t kMaxDepth = 64;
inline constexpr std::size_t kMaxValues = 1'000'000;     // Of one file.
inline constexpr std::size_t kMaxKeysOfObject = 10'000;  // Looking up a key goes through them all.
inline constexpr std::size_t kMaxKeyBytes = 256;

/// The content of a regular file of at most `kMaxFileBytes`; none, and an error at `asked_at`, if
/// there is no such file or it cannot be read. Never blocks: neither a FIFO nor a device is read.
[[nodiscard]] std::optional<std::string> read_file(const std::filesystem::path& file,
                                                   const Place& asked_at, Problems& problems);

/// The JSON in `text`, `//` and `/* */` comments allowed; none, and an error, if it cannot be
/// parsed to its end. A duplicate key is an error, but parsing continues.
[[nodiscard]] std::optional<Value> parse(std::string_view text,
                                         const std::shared_ptr<const Source>& source,
                                         Problems& problems);

/// `read_file` and `parse`. Errors in the file are at the file; a file that cannot be opened is an
/// error at `asked_at`, or at the file if `asked_at` is empty.
[[nodiscard]] std::optional<Value> parse_file(const std::filesystem::path& file,
                                              const Place& asked_at, Problems& problems);

/// The value of an option: `text` parsed as JSON if possible, as a string otherwise. Its place is
/// `option`, written as `--set limiter.limit_mps=20`.
[[nodiscard]] Value parse_option(const std::string& text, const std::string& option);

}  // namespace fastcycle::config
