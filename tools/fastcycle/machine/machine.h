#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fastcycle::tool::machine {

/// `kAdvice` makes latencies better; without what is a `kProblem` real time does not work.
enum class Level : std::uint8_t { kFine, kAdvice, kProblem };

/// One thing that the machine, or its administrator, decides.
struct Finding {
  std::string name;
  Level level = Level::kFine;
  std::string found;
  std::string why = {};     ///< What it does to an application; none if all is fine.
  std::string remedy = {};  ///< The command that changes it.
};

/// What the kernel tells in its files under `root`, which is / but for tests.
///
/// What a machine has no file for, as a virtual one for its frequencies, is said to be fine: there
/// is nothing to change.
[[nodiscard]] std::vector<Finding> look_at_kernel(const std::filesystem::path& root);

/// What this process may do: priorities of real time, locked memory, and on how many CPUs it runs.
[[nodiscard]] std::vector<Finding> look_at_rights();

/// `Intel(R) Xeon(R) Processor, 2 CPUs, 23.5 GiB, Linux 6.1.0 (x86_64)`.
[[nodiscard]] std::string name_of_machine(const std::filesystem::path& root);

}  // namespace fastcycle::tool::machine
