#pragma once

#include <cstdint>

namespace fastcycle::peers {

/// The stamps sent with a payload, CLOCK_MONOTONIC nanoseconds.
struct Stamps {
  std::int64_t number = 0;   ///< Of the message, from 0, including the warm-up.
  std::int64_t made_ns = 0;  ///< Before the payload was borrowed and filled.
  std::int64_t sent_ns = 0;  ///< Right before the publish call.
};

}  // namespace fastcycle::peers
