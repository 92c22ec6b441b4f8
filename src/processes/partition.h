#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "component/peers.h"
#include "host/application.h"
#include "loading/component_classes.h"
#include "processes/activity.h"
#include "processes/notice_order.h"
#include "processes/pair.h"
#include "processes/process_plan.h"
#include "processes/rounds.h"
#include "segment/export.h"
#include "segment/link_set.h"
#include "segment/segments.h"
#include "segment/wire.h"

namespace fastcycle::processes {

/// One process of an application: which components run here, and their links to the others.
///
///     partition.become(process, incarnation);
///     host::Application application(plan.description_in(process), …);
///     application.set_peers(partition);
///     application.build(partition, problems, …);
///     partition.connect(application);
///
/// @threads  Confined to the control thread, but for `runs_here`.
class Partition final : public host::Peers, public host::ComponentClasses {
 public:
  /// `classes` provides the components' code. All arguments must outlive this.
  Partition(const ProcessPlan& plan, segment::Segments& segments, host::ComponentClasses& classes);
  ~Partition() override;

  /// Call first in the process. Returns an error of the kernel.
  [[nodiscard]] std::optional<std::string> become(segment::ProcessIndex process,
                                                  std::uint32_t incarnation);
  [[nodiscard]] segment::ProcessIndex process() const { return process_; }
  [[nodiscard]] std::uint32_t incarnation() const { return incarnation_; }
  /// Null if this process follows none.
  [[nodiscard]] const standby::Follower* follower() const {
    return pair_ == nullptr ? nullptr : pair_->follower();
  }

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  /// Creates the ends of all links, after the application was built. In simulated time it serves
  /// rounds together with the others from then on; these also synchronize starts and stops.
  void connect(host::Application& application);
  /// Connects to what the others publish; call once all publishers of the start exist.
  void attach();

  /// Called with the state of following, in the processes of a pair. Set before `connect`; any
  /// thread.
  standby::Follower::Listener on_standby;
  /// Asks the supervisor to end `process` so that its standby takes over; set before the start. Any
  /// thread.
  std::function<void(const std::string& process)> on_switch;
  /// Called when all sources of this process have finished; set before the start. Any thread.
  std::function<void()> on_sources_finished;

  /// Where messages leave for another process.
  struct Outlet {
    std::string topic;
    std::size_t depth = 0;  ///< The largest depth of a subscription there.
    detail::PublisherCore* publisher = nullptr;
    std::unique_ptr<segment::Export> to;
  };
  [[nodiscard]] const std::vector<Outlet>& outlets() const { return outlets_; }

  [[nodiscard]] bool runs_here(const std::string& component) const override;
  [[nodiscard]] const std::string& name() const override { return plan_.name(process_); }
  [[nodiscard]] bool is_main() const override { return process_ == ProcessPlan::kMain; }
  [[nodiscard]] const std::set<std::string>& services() const override { return services_; }
  void declare(detail::ComponentCore& component) override;
  void give_latched(std::uint32_t process) override;
  void sources_finished() override;
  void send_notice(host::Notice::Kind kind, std::uint32_t component, std::string text) override {
    notices_->send_notice(kind, component, text);
  }
  void look() override { notices_->wake(); }
  [[nodiscard]] std::uint32_t process_of(const std::string& component) const override;
  [[nodiscard]] std::uint16_t lane_room(const std::string& component) const override;
  void stops() override;
  [[nodiscard]] std::string switch_to_standby(const std::string& component) override;
  [[nodiscard]] std::vector<Process> others() const override;
  [[nodiscard]] std::atomic<std::uint32_t>* crashed() override;
  [[nodiscard]] bool is_wanted(const std::string& topic) const override;
  [[nodiscard]] std::vector<Invalid> take_invalid() override;
  [[nodiscard]] bool is_here(std::uint32_t process) const override { return process == process_; }
  [[nodiscard]] const std::set<std::uint32_t>& recipients() const override {
    return notices_->recipients();
  }
  [[nodiscard]] bool keeps_activity() const override { return !plan_.wire().workers.empty(); }
  [[nodiscard]] std::vector<detail::ActivationRing*> rings() const override;
  [[nodiscard]] std::unique_ptr<detail::ReadRing> reads_of(std::size_t component) const override;
  [[nodiscard]] std::vector<const detail::PeerActivity*> activity_elsewhere() const override;
  [[nodiscard]] detail::RoundPeers* rounds() override { return rounds_.get(); }
  [[nodiscard]] std::size_t place_count() const override;
  [[nodiscard]] AgreedEnd agreed_end() const override;
  void reach_start(std::size_t place) override;
  void await_start(const detail::ComponentCore& component, std::size_t place,
                   const std::function<bool()>& is_over) override;
  [[nodiscard]] Time agree_on_begin(base::Clock& clock,
                                    const std::function<bool()>& is_over) override;
  [[nodiscard]] std::optional<std::int64_t> clocks_began() const override;
  [[nodiscard]] Time began() const override;
  void reach_end_of_input(const std::function<bool()>& is_over) override;
  void reach(Step step) override;
  void reach_stop(std::size_t place) override;
  void await_stop(const detail::ComponentCore& component, std::size_t place) override;
  void end() override;
  void stop_notices() override { notices_->stop(); }
  void count_rest() override;

 private:
  /// A serialized link that leads here.
  struct Untrusted {
    Invalid found;
    const segment::Import* import;
    std::uint64_t reported = 0;  ///< Of those that were invalid.
    Time next{};                 ///< When it may be reported again.
  };

  void publish_progress(std::uint32_t progress);
  [[nodiscard]] std::atomic<std::uint32_t>& begin_word(std::size_t which) const;
  void publish_begin(std::int64_t begin_ns);
  [[nodiscard]] std::int64_t published_begin_ns() const;
  [[nodiscard]] std::uint32_t progress_of(segment::ProcessIndex process) const;
  void await_progress(segment::ProcessIndex process, std::uint32_t progress,
                      const std::function<bool()>& is_over) const;
  void await_all(std::uint32_t progress, const std::function<bool()>& is_over) const;
  [[nodiscard]] std::uint32_t steps() const;
  void await_readers();
  void notify_followers();
  void begin_pair();
  [[nodiscard]] std::string why_other(const detail::ComponentCore& core) const;
  [[nodiscard]] std::uint64_t last_sequence(const ProcessPlan::Link& link) const;
  void beat(std::chrono::nanoseconds limit, const std::stop_token& stop);

  const ProcessPlan& plan_;
  segment::Segments& segments_;
  host::ComponentClasses& classes_;
  segment::Wire wire_;
  segment::ProcessIndex process_ = 0;
  std::uint32_t incarnation_ = 0;
  const base::Clock* clock_ = nullptr;
  std::set<std::string> services_;
  host::Application* application_ = nullptr;
  std::vector<Outlet> outlets_;
  std::vector<std::unique_ptr<segment::LinkSet>> link_sets_;
  std::vector<Untrusted> untrusted_;
  std::unique_ptr<FollowerBell> bell_;  ///< Null in a process without followers.
  std::unique_ptr<Pair> pair_;          ///< Null in one that never follows.
  std::vector<std::unique_ptr<PairedInputs>> paired_inputs_;
  std::vector<std::unique_ptr<ActivityOfProcess>> activity_elsewhere_;
  std::unique_ptr<NoticeOrder> notices_;  ///< Null before `become`.
  std::unique_ptr<Rounds> rounds_;        ///< In simulated time.
  std::jthread heart_;                    ///< If the file requires a heartbeat.
};

}  // namespace fastcycle::processes
