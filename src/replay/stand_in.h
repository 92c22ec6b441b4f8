#pragma once

#include "fastcycle/library.h"

namespace fastcycle::host {

/// The class of a component that publishes nothing itself: recorded messages are published in its
/// name. Its constructor has the application declare its publishers.
[[nodiscard]] const ComponentClass& stand_in_class() noexcept;

}  // namespace fastcycle::host
