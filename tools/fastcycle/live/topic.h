#pragma once

#include <CLI/App.hpp>

#include "command.h"

namespace fastcycle::tool::live {

// The subcommands of `fastcycle topic`.
Command add_topic_list(CLI::App& group);
Command add_topic_info(CLI::App& group);
Command add_topic_echo(CLI::App& group);
Command add_topic_hz(CLI::App& group);
Command add_topic_bw(CLI::App& group);
Command add_topic_delay(CLI::App& group);
Command add_topic_pub(CLI::App& group);

}  // namespace fastcycle::tool::live
