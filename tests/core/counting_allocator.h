#pragma once

#include <cstdint>

/// How often this process allocated memory by `new`, on any thread, in any library.
[[nodiscard]] std::uint64_t allocation_count() noexcept;
