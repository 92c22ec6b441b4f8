#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <vector>

#include "diagnostics/crash_reporter.h"
#include "diagnostics/watchdog.h"
#include "executor/activation.h"
#include "host/observer.h"

namespace fastcycle::host {

/// The component that the calling thread serves: its index in the application file, from 1; 0:
/// none. Safe, also in a signal handler.
[[nodiscard]] std::uint32_t component_of_this_thread() noexcept;

/// Attributes failures of one application to components: owns the crash reporter, for crashes of
/// the process, and the watchdog, for calls of components that do not return. One of the process at
/// a time.
///
///     Application application(description, {});
///     Diagnosis diagnosis(application, folder);
///     application.add(diagnosis);
///     application.build(libraries, problems, ConstructorFault::kFault);
///
/// @threads  As `Observer`; constructed and destroyed by the control thread.
class Diagnosis final : public Observer {
 public:
  /// Reports of crashes are written to `folder`, and to standard error.
  Diagnosis(Application& application, std::filesystem::path folder);
  ~Diagnosis() override;

  void open(config::Problems& problems) override;
  void start(const ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void stop(const Application& application) override;

 private:
  /// A call of a component whose hang ends the run, and when it was reported.
  struct Ending {
    diagnostics::RunningCall call;
    std::chrono::steady_clock::time_point since;
  };

  void update_reporter(std::vector<const detail::ActivationRing*> rings);
  [[nodiscard]] diagnostics::Watchdog::Options options();
  void hangs(const diagnostics::RunningCall& call);
  void goes_on_hanging(const diagnostics::RunningCall& call);
  void returns(const diagnostics::RunningCall& call);

  Application& application_;
  const std::filesystem::path folder_;
  const detail::ServingThread control_thread_;
  diagnostics::CrashReporter reporter_;
  std::vector<Ending> endings_;  ///< The watchdog's thread only.
  std::optional<diagnostics::Watchdog> watchdog_;
};

}  // namespace fastcycle::host
