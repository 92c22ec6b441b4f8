#include "fastcycle/version.h"

#include <cstdio>

#include <google/protobuf/stubs/common.h>

#include "command.h"
#include "loading/component_library.h"
#include "print.h"

namespace fastcycle::tool {

Command add_version(CLI::App& program) {
  CLI::App* line = program.add_subcommand("version", "Show the version and the build");
  line->footer(examples("  fastcycle version\n"));
  return {line, [] {
            const std::string protobuf =
                google::protobuf::internal::VersionString(GOOGLE_PROTOBUF_VERSION);
            print_to(stdout, "fastcycle  {}\nbuild      {}\nprotobuf   {}\n", FASTCYCLE_VERSION,
                     host::host_build_note(), protobuf);
            return static_cast<int>(kDone);
          }};
}

}  // namespace fastcycle::tool
