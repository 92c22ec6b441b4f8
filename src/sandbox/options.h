#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace fastcycle::sandbox {

/// Returns the component for which the calling thread works, as a number defined by the caller.
/// Called in a signal handler, on the thread that made a refused call.
using WhoCalls = std::uint32_t (*)();

/// Permissions of a process of components beyond computing.
struct SandboxOptions {
  /// Readable files and folders, with their contents.
  std::vector<std::filesystem::path> read = {};
  /// Files that may be read and written, and folders in which files and folders may be read,
  /// written, created, renamed and deleted.
  std::vector<std::filesystem::path> write = {};
  /// Whether shared libraries may be loaded later, and machine code be generated: for components
  /// that are interpreted, load plugins, or compile at run time. Memory that is writable and
  /// executable at once stays refused.
  bool may_load_code = false;
  /// May be null; then refusals are of component 0.
  WhoCalls who = nullptr;
};

}  // namespace fastcycle::sandbox
