#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "loading/component_library.h"

namespace fastcycle::host {

/// The functions that a library imports, as mangled names, read from the file without loading it;
/// empty if it is no dynamic ELF library.
///
/// @threads  Reentrant.
[[nodiscard]] std::vector<std::string> imported_functions(const std::filesystem::path& library);

/// Warns of libraries that bypass the component context: a run is not repeatable if a component
/// reads another clock, draws other random numbers or creates threads. One warning per library and
/// kind, at the first component that uses it.
void warn_of_imports(const config::ApplicationDescription& description,
                     const LibraryLoader& libraries, config::Problems& problems);

}  // namespace fastcycle::host
