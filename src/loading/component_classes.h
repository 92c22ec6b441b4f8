#pragma once

#include <cstdint>

#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/library.h"

namespace fastcycle::host {

/// Provides the classes of components.
class ComponentClasses {
 public:
  ComponentClasses() = default;
  ComponentClasses(const ComponentClasses&) = delete;
  ComponentClasses& operator=(const ComponentClasses&) = delete;
  virtual ~ComponentClasses() = default;

  /// The class of `component`, or null after adding the reason to `problems`.
  virtual const ComponentClass* find(const config::ComponentDescription& component,
                                     config::Problems& problems) = 0;
};

/// Handling of a constructor that throws.
enum class ConstructorFault : std::uint8_t {
  kFault,  ///< A fault of the component; the policy decides about the others.
  kError,  ///< An error of the application, for a check that starts nothing.
};

}  // namespace fastcycle::host
