#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/thread.h"
#include "sandbox/options.h"

namespace fastcycle::sandbox {

/// The files that a process may use from some time on, by Landlock.
///
/// @threads  Confined to its owner.
class FileRules {
 public:
  FileRules() = default;
  FileRules(const FileRules&) = delete;
  FileRules& operator=(const FileRules&) = delete;
  ~FileRules();

  /// Opens what `options` name and what every process needs. Takes nothing yet.
  [[nodiscard]] std::optional<base::Refusal> prepare(const SandboxOptions& options);

  /// Takes all other files from the calling thread and those that it makes. The process has given
  /// up new privileges before.
  [[nodiscard]] std::optional<base::Refusal> enforce();

 private:
  [[nodiscard]] bool add(const std::filesystem::path& path, std::uint64_t rights);
  [[nodiscard]] std::optional<base::Refusal> add_named(const std::filesystem::path& path,
                                                       std::uint64_t rights);

  int rules_ = -1;
  std::uint64_t handled_ = 0;  ///< The rights that the kernel judges.
};

}  // namespace fastcycle::sandbox
