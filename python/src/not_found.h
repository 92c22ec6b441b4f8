#pragma once

#include <stdexcept>

namespace fastcycle::python {

/// A name that there is not. It says which ones there are.
class NotFound final : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace fastcycle::python
