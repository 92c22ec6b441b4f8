#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "fastcycle/service.h"

namespace fastcycle::detail {

/// One component's end of a service, in its core: owns the service's name, and whether the
/// component's present object declared it.
///
/// @threads  Confined to the component's activations.
class ServiceEnd {
 public:
  explicit ServiceEnd(std::string its_service) : service(std::move(its_service)) {}
  ServiceEnd(const ServiceEnd&) = delete;
  ServiceEnd& operator=(const ServiceEnd&) = delete;
  virtual ~ServiceEnd() = default;

  /// Ends every open call and pending request of this end with `status`; in an activation.
  virtual void end_all(CallStatus status, std::string_view reason) = 0;
  /// The object that declared it is gone, because of `what`: ends its open calls and pending
  /// requests. In an activation.
  virtual void abandon(std::string_view what) = 0;

  const std::string service;
  bool is_declared = false;  ///< By the component's present object.
};

}  // namespace fastcycle::detail
