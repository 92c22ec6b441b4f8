#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::tool::machine {

/// `kAdvice` improves latencies; a `kProblem` prevents real-time operation.
enum class Level : std::uint8_t { kFine, kAdvice, kProblem };

/// One setting of the machine or its administrator.
struct Finding {
  std::string name;
  Level level = Level::kFine;
  std::string found;
  std::string why = {};     ///< Its effect on an application; empty if all is fine.
  std::string remedy = {};  ///< The command that changes it.
};

/// Reads the kernel's settings from the files under `root`, which is / except in tests.
///
/// A setting without a file, such as the CPU frequencies of a virtual machine, is reported as fine:
/// there is nothing to change.
[[nodiscard]] std::vector<Finding> look_at_kernel(const std::filesystem::path& root);

/// The limits of this process: real-time priorities, locked memory, and available CPUs.
[[nodiscard]] std::vector<Finding> look_at_rights();

/// `Intel(R) Xeon(R) Processor, 2 CPUs, 23.5 GiB, Linux 6.1.0 (x86_64)`.
[[nodiscard]] std::string name_of_machine(const std::filesystem::path& root);

}  // namespace fastcycle::tool::machine
