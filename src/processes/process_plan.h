#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"
#include "host/application_wiring.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// The plan of an application of several processes: which component runs where, and the links for
/// its messages. Made before the first process, and the same in all.
///
/// Process 0 is the supervisor; process 1 is the main process, which has the tools and the
/// components that name no process.
///
/// @threads  Constant after construction.
class ProcessPlan {
 public:
  static constexpr segment::ProcessIndex kSupervisor = 0;
  static constexpr segment::ProcessIndex kMain = 1;
  static constexpr const char* kMainName = "main";
  /// Suffix of a standby's process name.
  static constexpr const char* kStandbySuffix = ".standby";
  /// The executor for links without a receiving component's executor; in each process.
  static constexpr const char* kLinkExecutor = "processes";

  /// A publisher whose messages go to another process.
  struct Link {
    std::string topic;
    std::string component;    ///< Of the publisher.
    std::size_t ordinal = 0;  ///< Index among its publishers on the topic.
    std::string executor;     ///< Of the receiver.
    std::size_t wire = 0;     ///< Index in `wire().links`.
    std::size_t depth = 0;    ///< The largest depth of the receiver's subscriptions.
  };

  struct Needs {
    /// Tools of the main process read topics to which none of its components subscribes.
    bool main_gets_all = false;
    /// One of them records what components do beside publishing.
    bool has_activity = false;
    bool is_simulated = false;
    unsigned simulated_workers = 1;  ///< Of each process, in simulated time.
  };
  /// `problem` reports what does not fit.
  ProcessPlan(config::ApplicationDescription description, host::ApplicationWiring wiring,
              const Needs& needs);

  /// Why the application cannot run in several processes; none if it can.
  [[nodiscard]] const std::optional<std::string>& problem() const { return problem_; }

  [[nodiscard]] segment::ProcessIndex count() const {
    return static_cast<segment::ProcessIndex>(names_.size());
  }
  [[nodiscard]] const std::string& name(segment::ProcessIndex process) const {
    return names_[process];
  }
  /// As the application file assigns it.
  [[nodiscard]] segment::ProcessIndex process_of(const std::string& component) const;
  /// The other process of a pair; none if `process` has no standby.
  [[nodiscard]] std::optional<segment::ProcessIndex> twin_of(segment::ProcessIndex process) const;
  /// Whether it follows another process at the start: a standby or a shadow.
  [[nodiscard]] bool follows_at_start(segment::ProcessIndex process) const {
    return first_standby_ > 0 && process >= first_standby_;
  }
  /// Its description as a shadow; null if it is none.
  [[nodiscard]] const config::ShadowDescription* shadow_in(segment::ProcessIndex process) const;
  /// The process it follows at the start, or may take turns with; none if there is none.
  [[nodiscard]] std::optional<segment::ProcessIndex> other_of(segment::ProcessIndex process) const;
  /// The processes that follow it, or may.
  [[nodiscard]] std::vector<segment::ProcessIndex> followers_of(
      segment::ProcessIndex process) const;
  /// Whether `process` has a working object of the component; also on standby.
  [[nodiscard]] bool hosts(segment::ProcessIndex process, const std::string& component) const;
  /// The description in the file; defaults for the main process.
  [[nodiscard]] config::ProcessDescription description_of(segment::ProcessIndex process) const;
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }
  /// The application as one process sees it: components of others by name only.
  [[nodiscard]] config::ApplicationDescription description_in(segment::ProcessIndex process) const;

  [[nodiscard]] const host::ApplicationWiring& wiring() const { return wiring_; }
  [[nodiscard]] const std::vector<Link>& links() const { return links_; }
  [[nodiscard]] const segment::WirePlan& wire() const { return wire_; }
  /// Index, in the stages of a process, of the five words that belong to no component.
  [[nodiscard]] std::size_t stage_count() const { return description_.components.size(); }
  /// The word that a process increments as long as it lives.
  [[nodiscard]] std::size_t heartbeat_word() const { return stage_count() + 3; }
  /// The word for the process's pid.
  [[nodiscard]] std::size_t pid_word() const { return stage_count() + 4; }
  [[nodiscard]] bool is_simulated() const { return is_simulated_; }

 private:
  [[nodiscard]] std::string executor_of(const std::string& component) const;
  [[nodiscard]] std::vector<std::string> executors_in(segment::ProcessIndex process) const;
  void add_standbys();
  void add_links(const Needs& needs);
  void add_link(const host::ApplicationWiring::Publisher& publisher, std::size_t ordinal,
                segment::ProcessIndex from, segment::ProcessIndex to, const Needs& needs,
                std::map<segment::ProcessIndex, std::vector<std::string>>& executors);
  void add_activity(const Needs& needs);
  [[nodiscard]] bool gets_all(segment::ProcessIndex process, const Needs& needs) const;
  void find_problems();

  config::ApplicationDescription description_;
  host::ApplicationWiring wiring_;
  std::vector<std::string> names_;
  segment::ProcessIndex first_standby_ = 0;       ///< After all processes of the file,
  segment::ProcessIndex first_shadow_ = 0;        ///< and after the standbys.
  std::vector<segment::ProcessIndex> primaries_;  ///< Whom each of these follows at the start.
  std::vector<Link> links_;
  segment::WirePlan wire_;
  std::optional<std::string> problem_;
  bool is_simulated_ = false;
};

/// The component as configured for its shadow.
[[nodiscard]] config::ComponentDescription described_as_shadow(
    config::ComponentDescription component, const config::ShadowDescription& shadow);

}  // namespace fastcycle::processes
