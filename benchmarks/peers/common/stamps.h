#pragma once

#include <cstdint>

namespace fastcycle::peers {

/// What travels with a payload, CLOCK_MONOTONIC nanoseconds.
struct Stamps {
  std::int64_t number = 0;   ///< Of the message, from 0, the warm-up included.
  std::int64_t made_ns = 0;  ///< Before the payload was borrowed and filled.
  std::int64_t sent_ns = 0;  ///< Right before the publish call.
};

}  // namespace fastcycle::peers
