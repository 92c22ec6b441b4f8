#pragma once

#include <cstdint>

#include "config/description.h"
#include "config/problem.h"
#include "fastcycle/library.h"

namespace fastcycle::host {

/// Finds where a component's code comes from.
class ComponentClasses {
 public:
  ComponentClasses() = default;
  ComponentClasses(const ComponentClasses&) = delete;
  ComponentClasses& operator=(const ComponentClasses&) = delete;
  virtual ~ComponentClasses() = default;

  /// The class that `component` names, or null after adding to `problems` why there is none.
  virtual const ComponentClass* find(const config::ComponentDescription& component,
                                     config::Problems& problems) = 0;
};

/// What to do with a constructor that throws.
enum class ConstructorFault : std::uint8_t {
  kFault,    ///< A fault of the component: the others run on, or not, as the policy says.
  kMistake,  ///< A mistake, for a check that starts nothing.
};

}  // namespace fastcycle::host
