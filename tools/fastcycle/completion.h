#pragma once

#include <string>

#include <CLI/App.hpp>

namespace fastcycle::tool {

/// A script for bash that completes the commands and options of `program`, and the values of those
/// options whose type lists them: `live|simulated`. Everything else is a file.
[[nodiscard]] std::string bash_completion(const CLI::App& program);

}  // namespace fastcycle::tool
