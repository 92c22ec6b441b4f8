#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/description.h"

namespace fastcycle::config {

/// The names of all kinds of faults.
[[nodiscard]] std::vector<std::string> fault_kinds();

[[nodiscard]] std::optional<FaultKind> fault_kind(std::string_view name);

/// A key that a fault lacks, or has without meaning.
struct WrongKey {
  std::string key;  ///< Empty if it is missing.
  std::string message;
};

/// What is wrong with the keys of a fault of this kind, which has those for which `has` is true.
[[nodiscard]] std::vector<WrongKey> wrong_keys(FaultKind kind,
                                               const std::function<bool(const char*)>& has);

}  // namespace fastcycle::config
