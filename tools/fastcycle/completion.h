#pragma once

#include <string>

#include <CLI/App.hpp>

namespace fastcycle::tool {

/// A bash script that completes the commands and options of `program`, and the values of options
/// whose type lists them: `live|simulated`. Everything else completes to a file.
[[nodiscard]] std::string bash_completion(const CLI::App& program);

}  // namespace fastcycle::tool
