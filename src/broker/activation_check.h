#pragma once

#include <string_view>

#include "broker/publishing_component.h"

namespace fastcycle::detail {

/// The remedy where a publisher is used outside of its component's callbacks.
inline constexpr const char* kPublishFromThreads =
    "publish from your own thread with create_external_publisher()";

/// Whether the calling thread is in an activation of `component`.
[[nodiscard]] inline bool is_in_activation_of(const PublishingComponent& component) noexcept {
  return component.is_active_here();
}

/// Ends the process: code of `component` broke the contract, as `what` says, and `remedy` how it is
/// done right. Prints `component "planner": WHAT; REMEDY`.
[[noreturn]] void broke_contract(const PublishingComponent& component, std::string_view what,
                                 std::string_view remedy) noexcept;
/// The same of a `call` ("publish on") that concerns the topic `name`, outside of a callback.
[[noreturn]] void called_outside(const PublishingComponent& component, std::string_view call,
                                 std::string_view name, std::string_view remedy) noexcept;

}  // namespace fastcycle::detail
