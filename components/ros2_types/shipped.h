#pragma once

#include <span>
#include <string_view>

namespace fastcycle::ros2 {

struct ShippedInterface {
  std::string_view name;  ///< `std_msgs/msg/String`
  std::string_view text;
};

/// The files of interfaces/, embedded at build time.
[[nodiscard]] std::span<const ShippedInterface> shipped_interfaces();
/// mappings.json.
[[nodiscard]] std::string_view shipped_mappings();

}  // namespace fastcycle::ros2
