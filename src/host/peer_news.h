#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "base/priority_mutex.h"
#include "component/peers.h"
#include "host/status_news.h"
#include "modes/chains.h"

namespace fastcycle::host {

class ApplicationHost;
class Wiring;

/// For an application of several processes: sends the state of this one's components to the main
/// process, and receives that of the others there. The latest state of a component is sent at most
/// 200 times a second; its figures 10 times a second, in simulated time once in each period of the
/// status.
///
/// @threads  `changed` in an activation of the component; `hang_changed` Safe; all else as
///           documented in `Peers`.
class PeerNews {
 public:
  PeerNews(ApplicationHost& application, const Wiring& wiring, const Chains& chains)
      : application_(application), wiring_(wiring), chains_(chains) {}

  /// In the main process: receives the state of the others. Set before the start.
  std::function<void(const ComponentNews&)> on_news;

  /// In the main process: a component is gone with its process, which is not restarted. Set before
  /// the start.
  std::function<void(const detail::ComponentCore& component, const std::string& why)> on_lost;
  /// In the main process: a component elsewhere faulted, or its process has ended.
  std::function<void(const detail::ComponentCore& component, const std::string& what)> on_fault;

  /// Once the components are constructed. Before this, `look` and `take`, which other threads may
  /// call already, do nothing.
  void begin();
  /// `component` ends this process next: sends that, and its state, at once. In its activation.
  void send_end(detail::ComponentCore& component);
  /// When they have started.
  void send_all();
  void changed(detail::ComponentCore& component, bool is_urgent);
  void hang_changed(const detail::ComponentCore& component);
  [[nodiscard]] std::int64_t look();
  /// The same in simulated time.
  void round_is_over();
  void take(const Notice& notice);
  /// In the main process: the version of a component in another one. Safe.
  [[nodiscard]] detail::VersionNews version_of(std::uint32_t component) const;
  /// In the main process: all chains, with the results of those that end in another one, which are
  /// at most 100 ms old and begin anew with that process. Safe.
  [[nodiscard]] std::vector<ChainReport> chains() const;
  /// In the main process: of components whose process has ended at least once. When all is over.
  [[nodiscard]] std::vector<EarlierRuns> earlier_runs() const;

 private:
  /// One component.
  struct Its {
    ComponentNews news;        ///< Its last state.
    bool is_new = false;       ///< It was not sent yet.
    bool has_figures = false;  ///< Its figures were not sent yet.
    std::int64_t reported_ns = 0;
    // In the main process: of processes that have ended.
    std::uint64_t faults_before = 0;
    std::uint64_t restarts_before = 0;
    std::uint64_t reloads_before = 0;
    std::uint64_t rollbacks_before = 0;
    std::string last_end = {};
    std::vector<ChainNews> chains_before = {};
    std::uint64_t ended_in = 0;  ///< In simulated time: the round in which the last one did.
  };

  void send(Its& its);
  void send_less(const ComponentNews& news, bool has_figures);
  void take_figures();
  void receive(std::uint32_t component, ComponentNews news);
  void process_has_ended(const Notice& notice);

  ApplicationHost& application_;
  const Wiring& wiring_;
  const Chains& chains_;
  mutable base::PriorityMutex mutex_;
  std::vector<Its> its_;  ///< By component; constant in size once it has begun.
  std::atomic<bool> has_begun_{false};
  std::int64_t figures_at_ns_ = 0;  ///< When figures are sent next.
  // In simulated time.
  Time reported_all_at_{};
  std::uint64_t round_ = 1;
  std::vector<ComponentNews> next_;  ///< For the next round.
};

}  // namespace fastcycle::host
