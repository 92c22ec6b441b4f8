#pragma once

#include <optional>
#include <vector>

#include <linux/filter.h>

#include "base/thread.h"

namespace fastcycle::sandbox {

/// The BPF program by which the kernel checks every system call of the process `own`.
[[nodiscard]] std::vector<sock_filter> filter_program(bool may_load_code, int own);

/// Whether the kernel supports what the filter needs.
[[nodiscard]] std::optional<base::Refusal> check_filter();

/// Installs the filter permanently. Requires no_new_privs.
[[nodiscard]] std::optional<base::Refusal> install_filter(bool may_load_code);

}  // namespace fastcycle::sandbox
