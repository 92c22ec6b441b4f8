#pragma once

#include <cstdint>

#include "ros2/definition.h"

namespace fastcycle::ros2 {

/// Calls `f` with a zero of the C++ type of `kind`, a number; a bool is a byte.
template <typename F>
decltype(auto) with_number(Kind kind, F&& f) {
  switch (kind) {
    case Kind::kInt8:
      return f(std::int8_t{});
    case Kind::kInt16:
      return f(std::int16_t{});
    case Kind::kUint16:
      return f(std::uint16_t{});
    case Kind::kInt32:
      return f(std::int32_t{});
    case Kind::kUint32:
      return f(std::uint32_t{});
    case Kind::kInt64:
      return f(std::int64_t{});
    case Kind::kUint64:
      return f(std::uint64_t{});
    case Kind::kFloat32:
      return f(float{});
    case Kind::kFloat64:
      return f(double{});
    default:
      return f(std::uint8_t{});
  }
}

}  // namespace fastcycle::ros2
