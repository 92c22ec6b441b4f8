#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>

#include "configuration.h"
#include "host/application.h"
#include "host/diagnosis.h"
#include "loading/component_library.h"
#include "record/recorded_schedule.h"
#include "replay/exact_replay.h"
#include "replay/stand_ins.h"

namespace fastcycle::tool {

/// The common options of `verify`, `compare` and `debug`: a log, its application, and which
/// components are executed again.
struct ExactReplaying {
  std::vector<std::filesystem::path> files = {};  ///< The log's; the last may be the application.
  Configuration configuration = {};
  host::ExactReplayOptions options = {};
  std::string workers = {};
  std::string start = {};

  std::string input = "recorded";

  void add_to(CLI::App& line);
  /// `--continue-with`.
  void add_input_to(CLI::App& line);
  /// Separates the log from the application. Returns what does not fit together; empty if all does.
  std::string find_wrong();
};

/// An application that was built to re-execute a log.
class ReplayedApplication {
 public:
  /// Null, with all errors printed in the name of `command`, if it cannot be built.
  ///
  /// @errors  `mcap::Error` if the log cannot be read.
  static std::unique_ptr<ReplayedApplication> make(const std::string& command,
                                                   ExactReplaying& replaying);
  ~ReplayedApplication();

  [[nodiscard]] host::ExactReplay& replay() { return *replay_; }
  [[nodiscard]] const record::RecordedSchedule& schedule() const { return schedule_; }

 private:
  ReplayedApplication() = default;

  record::RecordedSchedule schedule_;
  std::unique_ptr<host::LibraryLoader> libraries_;
  std::unique_ptr<host::StandIns> stand_ins_;
  std::unique_ptr<host::Application> application_;
  std::unique_ptr<host::Diagnosis> diagnosis_;
  std::unique_ptr<host::ExactReplay> replay_;
};

}  // namespace fastcycle::tool
