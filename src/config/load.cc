#include "config/load.h"

#include "config/compose.h"
#include "config/describe.h"
#include "config/machine.h"
#include "config/schema.h"

namespace fastcycle::config {

ApplicationDescription load(const LoadOptions& options, Problems& problems) {
  const Schema schema(options.schema_file, problems);
  const auto tree = Composer(schema, problems).compose(options);
  if (!tree) {
    return {};
  }
  ApplicationDescription application = describe(*tree);
  check_sense(application, problems);
  if (!options.text) {  // It runs on this machine; one whose text is at hand ran somewhere.
    check_machine(*tree, problems);
  }
  return application;
}

}  // namespace fastcycle::config
