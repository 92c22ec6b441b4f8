#pragma once

#include <filesystem>
#include <string>

// Before all others, as Python wants it.
#include <pybind11/pybind11.h>

namespace fastcycle::python {

/// Starts Python, if nothing has done so yet: one interpreter for the whole process, which ends
/// with it. Where Python is the program itself (`python3 -m pytest`), it is that one.
///
/// Strings have the same hash in every run, so that sets and dicts are walked in the same order.
/// Ctrl-C and other signals stay with the host; what scripts print is not kept back.
///
/// @threads  Safe.
/// @errors   std::runtime_error if Python does not start.
void start_interpreter();

/// Whether Python can be called: it was started, and is not ending.
[[nodiscard]] bool is_interpreter_there() noexcept;

/// The calling thread may call Python while this lives. Nobody else does meanwhile, but for what
/// lets go of it on its own: waiting, and NumPy's larger computations.
///
/// A thread is made known to Python the first time, and forgotten when it ends.
class Gil {
 public:
  Gil();
  Gil(const Gil&) = delete;
  Gil& operator=(const Gil&) = delete;
  ~Gil() { PyGILState_Release(state_); }

 private:
  PyGILState_STATE state_;
};

/// The pending Python exception on one line, and none is pending any more: what it says, and the
/// places that led to it, innermost first:
///
///     ValueError: no lane (follower.py:31 in steer, from follower.py:12 in on_lane)
///
/// @pre  The GIL is held.
[[nodiscard]] std::string take_exception();
/// The same of one that pybind11 caught.
[[nodiscard]] std::string in_words(pybind11::error_already_set& error);

/// The module that the Python file `file` is: imported once, whatever changes in the file later.
/// Its folder is where it finds others.
///
/// @pre     The GIL is held.
/// @errors  pybind11::error_already_set.
[[nodiscard]] pybind11::module_ import_file(const std::filesystem::path& file);

}  // namespace fastcycle::python
