#pragma once

#include <string>

#include "ros2/definition.h"

namespace fastcycle::ros2 {

/// The type description of `definition` and of all types in it, as text: the input of its hash.
[[nodiscard]] std::string type_description(const Definition& definition);

/// `RIHS01_` and 64 digits: identifies the version of a type in ROS 2.
[[nodiscard]] std::string type_hash(const Definition& definition);

}  // namespace fastcycle::ros2
