#pragma once

#include <string_view>

#include "broker/publishing_component.h"

namespace fastcycle::detail {

/// The remedy for a publisher that is used outside of its component's callbacks.
inline constexpr const char* kPublishFromThreads =
    "publish from your own thread with create_external_publisher()";

/// Whether the calling thread is in an activation of `component`.
[[nodiscard]] inline bool is_in_activation_of(const PublishingComponent& component) noexcept {
  return component.is_active_here();
}

/// Ends the process: code of `component` broke a contract. Prints
/// `component "planner": WHAT; REMEDY`.
[[noreturn]] void broke_contract(const PublishingComponent& component, std::string_view what,
                                 std::string_view remedy) noexcept;
/// The same for a `call` ("publish on") on the topic `name` outside of a callback.
[[noreturn]] void called_outside(const PublishingComponent& component, std::string_view call,
                                 std::string_view name, std::string_view remedy) noexcept;

}  // namespace fastcycle::detail
