#pragma once

#include <string>

#include "command_tree.h"

namespace fastcycle::tool {

/// "fastcycle-topic-echo"
[[nodiscard]] std::string man_page_name(const CommandPath& path);

/// The manual page of one command, generated from its --help.
[[nodiscard]] std::string man_page(const CommandPath& path);

}  // namespace fastcycle::tool
