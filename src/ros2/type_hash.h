#pragma once

#include <string>

#include "ros2/definition.h"

namespace fastcycle::ros2 {

/// The type description of `definition` and of all types in it, as text: what its hash is made of.
[[nodiscard]] std::string type_description(const Definition& definition);

/// `RIHS01_` and 64 digits: what ROS 2 tells two versions of a type apart by.
[[nodiscard]] std::string type_hash(const Definition& definition);

}  // namespace fastcycle::ros2
