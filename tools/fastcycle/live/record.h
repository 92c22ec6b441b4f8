#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "live/session.h"
#include "recording_options.h"

namespace fastcycle::tool::live {

/// The options of `fastcycle record --live`.
struct LiveRecordOptions {
  Target target;
  RecordingOptions record;
  std::string duration;  ///< Empty: until Ctrl-C, or the application ends.
  bool is_quiet = false;
};

/// Records a running application from outside.
int record(const LiveRecordOptions& options);

}  // namespace fastcycle::tool::live
