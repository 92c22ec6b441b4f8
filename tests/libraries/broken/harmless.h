#pragma once

#include <fastcycle/fastcycle.h>

namespace broken {

/// A component without an error: what is wrong is the library around it.
class Harmless final : public fastcycle::Component {
 public:
  explicit Harmless(fastcycle::Context& context) : Component(context) {}
};

}  // namespace broken
