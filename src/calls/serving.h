#pragma once

#include <utility>

#include "broker/publisher_core.h"
#include "component/component_core.h"

namespace fastcycle::detail {

/// While it lives, what the component calls is called to answer `ticket`.
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

/// While it lives, the framework's own words are heard, also of a component that is not active.
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

/// While it lives, what is published has this origin, and these trails if there are any.
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
