#pragma once

#include <optional>
#include <vector>

#include <linux/filter.h>

#include "base/thread.h"

namespace fastcycle::sandbox {

/// The program by which the kernel judges every system call of the process `own`.
[[nodiscard]] std::vector<sock_filter> filter_program(bool may_load_code, int own);

/// Whether the kernel can do what the filter needs.
[[nodiscard]] std::optional<base::Refusal> check_filter();

/// Puts the filter in force, for good. The process has given up new privileges before.
[[nodiscard]] std::optional<base::Refusal> install_filter(bool may_load_code);

}  // namespace fastcycle::sandbox
