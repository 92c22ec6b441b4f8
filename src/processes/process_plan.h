#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/description.h"
#include "host/application_wiring.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// What runs where in an application of several processes, and how its messages get from one to the
/// other: made before the first process, and the same in all.
///
/// The first process is the one that makes the others; the second is the main process, with the
/// components that name none, and the tools.
///
/// @threads  Constant after construction.
class ProcessPlan {
 public:
  static constexpr segment::ProcessIndex kSupervisor = 0;
  static constexpr segment::ProcessIndex kMain = 1;
  static constexpr const char* kMainName = "main";
  /// Behind the name of a process, for its standby.
  static constexpr const char* kStandbySuffix = ".standby";
  /// The executor of what is no component's: in each process, for what nobody else takes.
  static constexpr const char* kLinkExecutor = "processes";

  /// A publisher whose messages go to another process.
  struct Link {
    std::string topic;
    std::string component;    ///< Of the publisher.
    std::size_t ordinal = 0;  ///< Of several that it has on the topic.
    std::string executor;     ///< Of the receiver.
    std::size_t wire = 0;     ///< Its place among `wire().links`.
    std::size_t depth = 0;    ///< The most that a subscription of the receiver takes.
  };

  struct Needs {
    /// Tools of the main process look at topics to which none of its components subscribes.
    bool main_gets_all = false;
    /// One of them wants to know what components do beside publishing.
    bool has_activity = false;
    bool is_simulated = false;
    unsigned simulated_workers = 1;  ///< Of each process, in simulated time.
  };
  /// What does not fit is told by `problem`.
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
  /// Where the file has it.
  [[nodiscard]] segment::ProcessIndex process_of(const std::string& component) const;
  /// The other one of the two that a process with a standby is; none if it has none.
  [[nodiscard]] std::optional<segment::ProcessIndex> twin_of(segment::ProcessIndex process) const;
  /// Whether it follows another one at the start: of two, the one that is on standby; a shadow.
  [[nodiscard]] bool follows_at_start(segment::ProcessIndex process) const {
    return first_standby_ > 0 && process >= first_standby_;
  }
  /// What the process is a shadow of; null if it is none.
  [[nodiscard]] const config::ShadowDescription* shadow_in(segment::ProcessIndex process) const;
  /// Whom it follows at the start, or takes turns with; none if it stands alone.
  [[nodiscard]] std::optional<segment::ProcessIndex> other_of(segment::ProcessIndex process) const;
  /// Who follows it, or may.
  [[nodiscard]] std::vector<segment::ProcessIndex> followers_of(
      segment::ProcessIndex process) const;
  /// Whether `process` has an object of the component that does its work: on standby too.
  [[nodiscard]] bool hosts(segment::ProcessIndex process, const std::string& component) const;
  /// What the file says of a process; defaults for the main one.
  [[nodiscard]] config::ProcessDescription description_of(segment::ProcessIndex process) const;
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }
  /// The application as it is in one process: components of others are there by name only.
  [[nodiscard]] config::ApplicationDescription description_in(segment::ProcessIndex process) const;

  [[nodiscard]] const host::ApplicationWiring& wiring() const { return wiring_; }
  [[nodiscard]] const std::vector<Link>& links() const { return links_; }
  [[nodiscard]] const segment::WirePlan& wire() const { return wire_; }
  /// Where the words that no component has stand among the stages of a process: five.
  [[nodiscard]] std::size_t stage_count() const { return description_.components.size(); }
  /// The word that a process counts up as long as it lives.
  [[nodiscard]] std::size_t heartbeat_word() const { return stage_count() + 3; }
  /// Where a process says its number on this machine.
  [[nodiscard]] std::size_t pid_word() const { return stage_count() + 4; }
  [[nodiscard]] bool is_simulated() const { return is_simulated_; }

 private:
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
  segment::ProcessIndex first_standby_ = 0;       ///< Behind all that the file has,
  segment::ProcessIndex first_shadow_ = 0;        ///< and behind these.
  std::vector<segment::ProcessIndex> primaries_;  ///< Of these: whom they follow at the start.
  std::vector<Link> links_;
  segment::WirePlan wire_;
  std::optional<std::string> problem_;
  bool is_simulated_ = false;
};

/// The component as its shadow is.
[[nodiscard]] config::ComponentDescription described_as_shadow(
    config::ComponentDescription component, const config::ShadowDescription& shadow);

}  // namespace fastcycle::processes
