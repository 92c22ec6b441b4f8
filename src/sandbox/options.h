#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace fastcycle::sandbox {

/// Says on whose behalf the calling thread works, as a number that the caller understands.
/// Called in a signal handler, on the thread that made a refused call.
using WhoCalls = std::uint32_t (*)();

/// What a process of components may do beyond computing.
struct SandboxOptions {
  /// Files, and folders with all that is in them, that may be read.
  std::vector<std::filesystem::path> read = {};
  /// Files that may be read and written, and folders in which files and folders may be read,
  /// written, made, renamed and deleted.
  std::vector<std::filesystem::path> write = {};
  /// Whether shared libraries may be loaded later, and machine code be made: for components that
  /// are interpreted, load plugins, or compile at run time. Memory that can be written and executed
  /// at once stays refused.
  bool may_load_code = false;
  /// Or none; then refusals are of component 0.
  WhoCalls who = nullptr;
};

}  // namespace fastcycle::sandbox
