#pragma once

#include <pybind11/pybind11.h>

namespace fastcycle::python {

class PythonComponent;

/// Makes the types that Python components use, once. @pre The GIL is held.
void make_bindings();

/// What the constructor of a Python component is given. Its methods are those of `Context` and of
/// `Component`, in Python's words; they end with `component`, and say so after that.
[[nodiscard]] pybind11::object make_context(PythonComponent& component);

}  // namespace fastcycle::python
