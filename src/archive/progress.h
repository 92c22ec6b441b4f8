#pragma once

#include <cstdint>
#include <functional>

namespace fastcycle::archive {

/// Called periodically with the number of bytes read. An exception from it ends the work. May be
/// empty.
using Progress = std::function<void(std::uint64_t bytes)>;

/// Number of records per call, if records are read one by one.
inline constexpr unsigned kRecordsPerProgress = 256;

}  // namespace fastcycle::archive
