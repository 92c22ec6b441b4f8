#pragma once

#include <cstdint>
#include <functional>

namespace fastcycle::archive {

/// Told now and then how many bytes of what is read are done. What it throws ends the work. May be
/// empty.
using Progress = std::function<void(std::uint64_t bytes)>;

}  // namespace fastcycle::archive
