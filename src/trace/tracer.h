#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "base/clock.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "config/description.h"
#include "executor/activation_ring.h"
#include "host/observer.h"
#include "host/status_news.h"
#include "trace/packets.h"
#include "trace/trace_file.h"

namespace fastcycle::trace {

/// Statistics of a trace.
struct TraceReport {
  std::string file = {};
  std::string problem = {};  ///< Why the trace is incomplete; empty if it is not.
  std::uint64_t bytes = 0;
  std::uint64_t slices = 0;            ///< Activations.
  std::uint64_t flows = 0;             ///< From publish to callback.
  std::uint64_t instants = 0;          ///< Drops and faults.
  std::uint64_t samples = 0;           ///< Of queues.
  std::uint64_t activations_lost = 0;  ///< Overwritten before they were read.
  std::uint64_t events_lost = 0;       ///< The buffer was full.
  std::uint64_t notes_lost = 0;        ///< Drops and faults that came too fast.

  [[nodiscard]] std::uint64_t lost() const noexcept {
    return activations_lost + events_lost + notes_lost;
  }
};

/// Writes the activity of an application to a trace for Perfetto: a slice for each activation, a
/// flow from each publish to the resulting callback, queues as counters, drops and faults.
///
/// Live, one thread reads the activation rings every few milliseconds and another one writes the
/// file: workers and publishers have no extra work, except that an overflow leaves a note.
/// Activations overwritten before they were read, and events that did not fit into the buffer, are
/// counted, and reported in the trace itself. A flow is written with the slice that it leads to or
/// not at all, so each has both ends.
///
/// In simulated time nothing polls and nothing is lost: rings are read after each round.
///
/// @threads  As `Observer`; `report` when stopped.
class Tracer final : public host::Observer {
 public:
  static constexpr std::chrono::milliseconds kPoll{5};

  /// `inputs` are files that the trace never replaces.
  explicit Tracer(config::TraceDescription description,
                  std::vector<std::filesystem::path> inputs = {});
  ~Tracer() override;

  void open(config::Problems& problems) override;
  void start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override;
  void faulted(std::string_view component, std::string_view what) noexcept override;
  void changed_elsewhere(const host::ComponentNews& news) noexcept override;
  [[nodiscard]] bool wants_overflows() const override { return true; }
  void overflowed(const detail::Subscription& subscription) noexcept override;
  void stop(const host::Application& application) override;

  [[nodiscard]] TraceReport report() const;

 private:
  /// An overflow on its way to the reading thread. A bounded queue of many writers and one reader:
  /// `turn` determines who owns the entry.
  /// https://www.1024cores.net/home/lock-free-algorithms/queues/bounded-mpmc-queue
  struct Note {
    std::atomic<std::uint64_t> turn{0};
    std::int64_t time_ns = 0;
    const detail::Subscription* subscription = nullptr;
  };
  static constexpr std::size_t kNotes = 4096;

  struct FaultNote {
    std::int64_t time_ns = 0;
    std::string component = {};
    std::string what = {};
  };
  static constexpr std::size_t kFaultNotes = 64;

  /// An activation that was read but not written yet. Times are those of the trace.
  struct Slice {
    detail::ActivationRecord record = {};
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    std::int64_t read_ns = 0;  ///< When it was read.
  };
  /// The begin of a flow.
  struct FlowBegin {
    std::uint64_t track = 0;
    std::int64_t time_ns = 0;
  };
  enum class Found : std::uint8_t { kYes, kNo, kNotYet };

  /// An activation that may have published.
  struct Past {
    std::uint64_t number = 0;
    std::uint64_t track = 0;
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
    std::int64_t time_ns = 0;  ///< The application's.
    std::uint64_t batch = 0;   ///< The pass in which it was read.
  };

  struct Worker {
    const detail::ActivationRing* ring = nullptr;  ///< Null: its process has ended.
    const detail::PeerActivity* peer = nullptr;    ///< Its process, if it is another one.
    std::uint64_t next = 0;
    std::uint64_t track = 0;
    std::int64_t end_ns = 0;  ///< Of the last slice.
    std::deque<Slice> slices = {};
  };
  /// Another process of the application.
  struct PeerState {
    const detail::PeerActivity* peer = nullptr;
    std::uint32_t incarnation = 0;  ///< 0: it has ended, or not started.
    std::size_t first_worker = 0;   ///< Index of its first worker; the others follow.
  };
  struct ComponentState {
    std::string name = {};
    std::vector<std::string> timers = {};        ///< Names, by number, as first declared.
    const detail::PeerActivity* peer = nullptr;  ///< Its process, if it is another one.
    std::uint64_t track = 0;                     ///< In simulated time.
    std::int64_t end_ns = 0;                     ///< In simulated time: of the last slice.
    std::deque<Past> past = {};
  };
  struct PublisherState {
    std::string topic = {};
    std::size_t component = 0;
    std::uint64_t name = 0;            ///< Of the begin of a flow.
    std::uint64_t external_track = 0;  ///< Of flows from outside of activations.
  };
  struct Queue {
    const detail::Subscription* subscription = nullptr;
    std::vector<std::shared_ptr<detail::Lane>> lanes = {};
    std::uint64_t track = 0;
    std::uint64_t depth = 0;  ///< As written last.
    std::uint64_t name_of_drop = 0;
    detail::Ledger ledger = {};  ///< As written last.
  };

  /// A queue in another process, of which the main process gets the figures.
  struct QueueElsewhere {
    std::uint64_t track = 0;
    std::uint64_t name_of_drop = 0;
    detail::Ledger ledger = {};  ///< As written last.
  };
  /// The newest figures of a component there.
  struct FiguresNote {
    std::int64_t time_ns = 0;
    std::vector<host::FiguresElsewhere::Subscription> subscriptions = {};
  };

  void describe_tracks(const host::ObserverView& view);
  void describe_workers(const host::Application& application);
  void describe_peers(const host::ObserverView& view);
  void describe_process(const PeerState& its);
  void describe_publishers(const detail::Topics& topics);
  void poll();
  void end_reading();
  /// Reads and writes everything available; with `is_last` it waits for nothing more.
  void take(bool is_last);
  void read_rings();
  void read_ring(Worker& worker);
  void look_at(PeerState& its);
  void read_live(Worker& worker, const detail::ActivationRecord& record);
  void write_simulated(Worker& worker, const detail::ActivationRecord& record);
  void write_live(bool is_last);
  void write_notes();
  void write_faults();
  void write_queues();
  void write_ledgers();
  void write_figures();
  void write_figures(std::int64_t time_ns, QueueElsewhere& queue,
                     const host::FiguresElsewhere::Subscription& subscription);
  void write_losses(bool is_last);
  void find_queues();
  void write_slice(const Slice& slice, std::uint64_t track, const std::optional<FlowBegin>& flow);
  void write_instant(std::int64_t time_ns, std::uint64_t track, std::uint64_t name,
                     std::span<const Annotation> annotations, std::string_view text = {});
  /// Hands over new packets; false if they are lost.
  bool hand_over();
  void remember(const detail::ActivationRecord& record, const Slice& slice, std::uint64_t track);
  [[nodiscard]] Found find_live(const Slice& slice, FlowBegin& begin) const;
  [[nodiscard]] std::optional<FlowBegin> find_simulated(
      const detail::ActivationRecord& record) const;
  [[nodiscard]] std::uint64_t name_of(const detail::ActivationRecord& record);
  [[nodiscard]] std::uint64_t new_track(std::uint64_t parent, std::string name,
                                        bool is_counter = false);
  [[nodiscard]] std::int64_t now_ns() const;
  [[nodiscard]] std::int64_t to_trace(std::int64_t time_ns) const;

  const config::TraceDescription description_;
  TraceFile file_;

  // Constant once started.
  const host::Application* application_ = nullptr;
  const base::Clock* clock_ = nullptr;
  bool is_started_ = false;
  std::int64_t start_ns_ = 0;
  std::atomic<bool> takes_news_{false};  ///< Of components elsewhere; once the above is set.

  // Of the reading thread; in simulated time that of the simulation.
  Packets packets_;
  std::vector<Worker> workers_;
  std::vector<PeerState> peers_;
  std::vector<ComponentState> components_;
  std::unordered_map<PublisherId, PublisherState> publishers_;
  std::vector<Queue> queues_;
  std::unordered_map<const detail::Subscription*, std::size_t> queue_of_;
  /// By component, topic and its number among the component's subscriptions to that topic.
  std::map<std::tuple<std::size_t, std::string, std::size_t>, QueueElsewhere> queues_elsewhere_;
  std::vector<detail::ActivationRecord> records_;
  std::map<std::tuple<std::uint32_t, detail::Cause, std::uint64_t>, std::uint64_t> names_;
  std::array<std::uint64_t, 12> categories_{};  ///< Names, by cause.
  std::uint64_t next_track_ = 1;
  std::uint64_t process_track_ = 0;
  std::uint64_t drops_track_ = 0;
  std::uint64_t faults_track_ = 0;
  std::uint64_t losses_track_ = 0;
  struct {
    std::uint64_t number, sequence, waited, skipped, published, faulted, count, time, lost;
  } words_{};
  std::uint64_t batch_ = 0;
  std::uint64_t reported_lost_ = 0;
  TraceReport counts_;

  // Written by any thread.
  std::unique_ptr<std::array<Note, kNotes>> notes_;
  std::atomic<std::uint64_t> next_note_{0};
  std::uint64_t read_note_ = 0;
  std::atomic<std::uint64_t> notes_lost_{0};
  std::mutex fault_mutex_;
  std::vector<FaultNote> faults_;
  std::map<std::size_t, FiguresNote> figures_;  ///< By component; under the same mutex.

  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_stopping_ = false;
  base::Thread reading_;
};

}  // namespace fastcycle::trace
