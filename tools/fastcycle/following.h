#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "host/application.h"
#include "processes/partition.h"
#include "processes/process_plan.h"
#include "replay/field_changes.h"
#include "report/report.h"
#include "standby/follower.h"

namespace fastcycle::tool {

/// Reports the state of a process that follows another one: of a standby, whether it is in step; of
/// a shadow, how its messages differ. The main process shows it (`fastcycle standby`, `fastcycle
/// shadow`).
///
/// @threads  Safe; constructed, begun and ended by the control thread.
class Following {
 public:
  /// All references must outlive this. `command` is the prefix of messages to the user.
  Following(const processes::ProcessPlan& plan, processes::Partition& partition,
            host::Application& application, std::string command);
  Following(const Following&) = delete;
  Following& operator=(const Following&) = delete;
  ~Following() { end(); }

  /// The listener to pass to the partition before it is connected.
  [[nodiscard]] standby::Follower::Listener listener();
  /// Starts to report to the main process, five times a second.
  void begin();
  void end();

  /// The differences of a shadow; empty for a standby.
  [[nodiscard]] std::vector<host::ToolReport> report() const;

 private:
  enum class Stage : std::uint8_t { kSeeks, kInStep, kHasTakenOver };

  struct Output {
    host::TopicChange change;
    host::FieldChanges fields;
  };

  void compare(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
               const detail::Envelope& own, bool is_equal);
  Output& output_of(const detail::PublisherCore& publisher);
  [[nodiscard]] std::vector<host::TopicChange> topics() const;
  [[nodiscard]] std::string in_json() const;
  void send();

  const processes::ProcessPlan& plan_;
  processes::Partition& partition_;
  host::Application& application_;
  const std::string command_;
  const std::string& name_;
  const bool is_shadow_;

  mutable std::mutex mutex_;
  Stage stage_ = Stage::kSeeks;
  std::map<PublisherId, Output> outputs_;
  std::string reported_;
  std::jthread thread_;
};

}  // namespace fastcycle::tool
