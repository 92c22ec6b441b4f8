#pragma once

#include "config/description.h"
#include "config/load_options.h"
#include "config/problem.h"

namespace fastcycle::config {

/// Reads an application and all files it names, and checks everything that can be checked without
/// opening a library.
///
///     Problems problems;
///     const ApplicationDescription application = load({.file = "app.json"}, problems);
///     if (problems.has_errors()) { … }
///
/// Reports all errors at once. With errors the description is as complete as possible, for further
/// checks, and must not be started.
///
/// @threads  Safe.
/// @errors   Everything goes to `problems`; nothing is thrown but `std::bad_alloc`.
[[nodiscard]] ApplicationDescription load(const LoadOptions& options, Problems& problems);

}  // namespace fastcycle::config
