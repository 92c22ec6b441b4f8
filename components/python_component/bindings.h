#pragma once

#include <pybind11/pybind11.h>

namespace fastcycle::python {

class PythonComponent;

/// Creates the types for Python components, once. @pre The GIL is held.
void make_bindings();

/// The constructor argument of a Python component. Its methods are those of `Context` and of
/// `Component`, in Python's naming; after the end of `component` they raise an error.
[[nodiscard]] pybind11::object make_context(PythonComponent& component);

}  // namespace fastcycle::python
