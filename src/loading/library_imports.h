#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/description.h"
#include "config/problem.h"
#include "loading/component_library.h"

namespace fastcycle::host {

/// The functions that a library wants from others, read from the file without loading it; empty if
/// it is no ELF library that says so. As the linker names them.
///
/// @threads  Reentrant.
[[nodiscard]] std::vector<std::string> imported_functions(const std::filesystem::path& library);

/// Warns of libraries whose code asks the machine for what its context should give: a run cannot be
/// repeated where a component reads another clock, draws other random numbers or makes threads.
/// Once for each library and kind, at the first component that uses it.
void warn_of_imports(const config::ApplicationDescription& description,
                     const LibraryLoader& libraries, config::Problems& problems);

}  // namespace fastcycle::host
