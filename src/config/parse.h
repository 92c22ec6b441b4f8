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

/// What a file may ask of us, so that a hostile or broken one costs little.
inline constexpr std::size_t kMaxFileBytes = std::size_t{16} << 20U;
inline constexpr std::size_t kMaxDepth = 64;
inline constexpr std::size_t kMaxValues = 1'000'000;     // Of one file.
inline constexpr std::size_t kMaxKeysOfObject = 10'000;  // Looking up a key goes through them all.
inline constexpr std::size_t kMaxKeyBytes = 256;

/// The content of a regular file of at most `kMaxFileBytes`; none, and a mistake at `asked_at`, if
/// there is no such file or it cannot be read. Never waits: neither a FIFO nor a device is read.
[[nodiscard]] std::optional<std::string> read_file(const std::filesystem::path& file,
                                                   const Place& asked_at, Problems& problems);

/// The JSON in `text`, `//` and `/* */` comments allowed; none, and a mistake, if it cannot be read
/// to its end. A key that an object has twice is a mistake, but reading goes on.
[[nodiscard]] std::optional<Value> parse(std::string_view text,
                                         const std::shared_ptr<const Source>& source,
                                         Problems& problems);

/// `read_file` and `parse`. Mistakes of the file itself are at the file; that it cannot be opened
/// is a mistake at `asked_at`, or at the file where `asked_at` is empty.
[[nodiscard]] std::optional<Value> parse_file(const std::filesystem::path& file,
                                              const Place& asked_at, Problems& problems);

/// What an option gives: `text` as JSON if it is such, as a string otherwise. Its values say that
/// they come from `option`, written as `--set limiter.limit_mps=20`.
[[nodiscard]] Value parse_option(const std::string& text, const std::string& option);

}  // namespace fastcycle::config
