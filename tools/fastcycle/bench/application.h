#pragma once

#include <string>

#include "host/report.h"
#include "measure/floors.h"
#include "measure/row.h"

namespace fastcycle::tool::bench {

/// How the executors of publisher and subscriber wait and run.
struct Profile {
  std::string wait = "park";  ///< As in an application file: park, spin, adaptive.
  bool is_fifo = false;
};

/// The application file of a mode: JSON that `fastcycle run` accepts as well. `folder` is where the
/// components write the stamps.
[[nodiscard]] std::string latency_application(const measure::Plan& plan, const Profile& profile,
                                              const std::string& folder);
[[nodiscard]] std::string rtt_application(const measure::Plan& plan, const Profile& profile,
                                          const std::string& folder);

/// Runs the application as `fastcycle run` does: read from a file in `folder`, libraries loaded and
/// components made by the host.
///
/// @errors  std::runtime_error with all there is to say if it did not start or did not end well.
host::RunReport run_application(const std::string& text, const std::string& folder);

}  // namespace fastcycle::tool::bench
