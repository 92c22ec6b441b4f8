#pragma once

#include <fstream>
#include <string>
#include <string_view>

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

/// Writes the stamps to the file that the benchmark reads; does nothing for an empty path. In the
/// path, "{process}" stands for the name of the process: a standby and its primary have the same
/// params.
inline void report_samples(Context& context, const Path& file, const measure::Samples& samples) {
  if (file.empty()) {
    return;
  }
  constexpr std::string_view kProcess = "{process}";
  std::string path = file.string();
  if (const std::size_t place = path.find(kProcess); place != std::string::npos) {
    std::string name;
    std::getline(std::ifstream("/proc/self/comm"), name);
    path.replace(place, kProcess.size(), name);
  }
  context.report("trouble", measure::write_samples(path, samples));
}

}  // namespace fastcycle::benchmark
