#pragma once

#include <cstdint>
#include <functional>

namespace fastcycle::archive {

/// Told now and then how many bytes of what is read are done. What it throws ends the work. May be
/// empty.
using Progress = std::function<void(std::uint64_t bytes)>;

/// So often it is told where records are read one by one.
inline constexpr unsigned kRecordsPerProgress = 256;

}  // namespace fastcycle::archive
