#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/thread.h"
#include "sandbox/options.h"

namespace fastcycle::sandbox {

/// Restricts the files that a process may use, by Landlock.
///
/// @threads  Confined to its owner.
class FileRules {
 public:
  FileRules() = default;
  FileRules(const FileRules&) = delete;
  FileRules& operator=(const FileRules&) = delete;
  ~FileRules();

  /// Opens what `options` name and what every process needs. Restricts nothing yet.
  [[nodiscard]] std::optional<base::Refusal> prepare(const SandboxOptions& options);

  /// Denies all other files to the calling thread and to threads it creates. Requires no_new_privs.
  [[nodiscard]] std::optional<base::Refusal> enforce();

 private:
  [[nodiscard]] bool add(const std::filesystem::path& path, std::uint64_t rights);
  [[nodiscard]] std::optional<base::Refusal> add_named(const std::filesystem::path& path,
                                                       std::uint64_t rights);

  int rules_ = -1;
  std::uint64_t handled_ = 0;  ///< Rights controlled by the kernel.
};

}  // namespace fastcycle::sandbox
