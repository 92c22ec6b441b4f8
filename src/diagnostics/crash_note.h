#pragma once

#include <array>
#include <cstdint>

#include "executor/activation_ring.h"

namespace fastcycle::diagnostics {

/// What a crash stores in memory that outlives the process, for later readers. The bytes are in the
/// format of the machine that wrote them, and not trusted.
struct CrashNote {
  static constexpr std::uint32_t kMagic = 0x46434352;  ///< Written last.

  std::uint32_t magic = 0;
  std::uint32_t text_size = 0;
  detail::ActivationRecord activation;  ///< The one that did not end; number 0: none.
  std::array<char, 64> component{};     ///< Ends with a zero; empty: none.
  std::array<char, 256> summary{};      ///< As text, one line.
  std::array<char, 2048> text{};        ///< The beginning of the report.
};

}  // namespace fastcycle::diagnostics
