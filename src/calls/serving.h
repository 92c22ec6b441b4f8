#pragma once

#include <utility>

#include "broker/publisher_core.h"
#include "component/component_core.h"

namespace fastcycle::detail {

/// Scope in which calls of the component are made to answer `ticket`.
class Serving {
 public:
  Serving(ComponentCore& core, const Ticket& ticket)
      : core_(core), before_(std::exchange(core.serving, ticket)) {}
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;
  ~Serving() { core_.serving = before_; }

 private:
  ComponentCore& core_;
  const Ticket before_;
};

/// Scope in which the framework's own messages are delivered, even for an inactive component.
class Unmuted {
 public:
  explicit Unmuted(PublishingComponent& component)
      : component_(component), before_(std::exchange(component.is_muted, false)) {}
  Unmuted(const Unmuted&) = delete;
  Unmuted& operator=(const Unmuted&) = delete;
  ~Unmuted() { component_.is_muted = before_; }

 private:
  PublishingComponent& component_;
  const bool before_;
};

/// Scope in which published messages have this origin, and these trails if there are any.
class OriginOf {
 public:
  OriginOf(PublishingComponent& component, const Origin& origin, const Trail* trails = nullptr)
      : component_(component),
        origin_(origin),
        before_(component.origin),
        trails_before_(component.trails) {
    component.origin = &origin_;
    if (trails != nullptr) {
      component.trails = trails;
    }
  }
  OriginOf(const OriginOf&) = delete;
  OriginOf& operator=(const OriginOf&) = delete;
  ~OriginOf() {
    component_.origin = before_;
    component_.trails = trails_before_;
  }

 private:
  PublishingComponent& component_;
  const Origin origin_;
  const Origin* const before_;
  const Trail* const trails_before_;
};

}  // namespace fastcycle::detail
