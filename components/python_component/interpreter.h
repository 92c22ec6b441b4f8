#pragma once

#include <filesystem>
#include <string>

// Python requires it before all others.
#include <pybind11/pybind11.h>

namespace fastcycle::python {

/// Starts Python, if it is not running: one interpreter for the whole process, which ends with it.
/// If Python is the program itself (`python3 -m pytest`), it is that one.
///
/// String hashes are equal in every run, so that sets and dicts have the same order. The host keeps
/// handling Ctrl-C and other signals; output of scripts is unbuffered.
///
/// @threads  Safe.
/// @errors   std::runtime_error if Python does not start.
void start_interpreter();

/// Whether Python can be called: it was started, and is not shutting down.
[[nodiscard]] bool is_interpreter_there() noexcept;

/// Holds the GIL: the calling thread may call Python while this lives. No other thread does
/// meanwhile, except during operations that release the GIL: waiting, and NumPy's larger
/// computations.
///
/// A thread is attached to Python the first time, and detached when it ends.
class Gil {
 public:
  Gil();
  Gil(const Gil&) = delete;
  Gil& operator=(const Gil&) = delete;
  ~Gil() { PyGILState_Release(state_); }

 private:
  PyGILState_STATE state_;
};

/// Clears the pending Python exception, and returns it on one line: its text, and its traceback,
/// innermost first:
///
///     ValueError: no lane (follower.py:31 in steer, from follower.py:12 in on_lane)
///
/// @pre  The GIL is held.
[[nodiscard]] std::string take_exception();
/// The same for one that pybind11 caught.
[[nodiscard]] std::string in_words(pybind11::error_already_set& error);

/// The module of the Python file `file`: imported once, whatever changes in the file later. Imports
/// of others are searched in its folder.
///
/// @pre     The GIL is held.
/// @errors  pybind11::error_already_set.
[[nodiscard]] pybind11::module_ import_file(const std::filesystem::path& file);

}  // namespace fastcycle::python
