#pragma once

#include "fastcycle/component.h"
#include "measure/samples.h"
#include "measure/usage.h"

namespace fastcycle::benchmark {

inline void report_usage(Context& context, const measure::Usage& usage) {
  context.report("cpu_us", usage.cpu_us);
  context.report("minor_faults", usage.minor_faults);
  context.report("major_faults", usage.major_faults);
  context.report("voluntary_switches", usage.voluntary_switches);
  context.report("involuntary_switches", usage.involuntary_switches);
}

/// Writes the stamps to the file that the benchmark reads; does nothing for an empty path.
inline void report_samples(Context& context, const Path& file, const measure::Samples& samples) {
  if (!file.empty()) {
    context.report("trouble", measure::write_samples(file, samples));
  }
}

}  // namespace fastcycle::benchmark
