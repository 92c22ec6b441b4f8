#include "tracing_options.h"

namespace fastcycle::tool {

std::optional<config::TraceDescription> TracingOptions::describe(
    const config::ApplicationDescription& application) const {
  if (file.empty() && !application.trace) {
    return std::nullopt;
  }
  config::TraceDescription trace = application.trace.value_or(config::TraceDescription{});
  if (!file.empty()) {
    trace.file = file;
    trace.place = {};
    trace.place.file = "the command line";
  }
  if (trace.file.empty()) {
    trace.file = application.name + ".pftrace";
  }
  return trace;
}

}  // namespace fastcycle::tool
