#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "base/priority_mutex.h"
#include "broker/inbox.h"
#include "broker/read_ring.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "executor/activation_ring.h"
#include "executor/script.h"

namespace fastcycle::standby {

/// One activation of the followed component, with its reads.
struct FollowedActivation {
  detail::ActivationRecord record;
  std::vector<detail::ReplayedReads::Entry> reads = {};
};

/// The script of one component on standby: the activations of the followed component, each as soon
/// as its inputs have arrived here too.
///
/// @threads  `add`, `take_over`, `end` and the numbers are Safe; `serve` as `Script`.
class FollowedComponent final : public detail::Script {
 public:
  /// Callbacks, by the worker that serves the component.
  struct Listener {
    /// It has started from a key frame.
    std::function<void()> found_frame;
    /// It can no longer follow.
    std::function<void(const std::string& why)> lost;
    /// It has taken over, and works independently.
    std::function<void()> taken_over;
  };

  /// Makes `core` follow: from its first activation on, or, with `late`, its application, from the
  /// first available key frame of its state after the start. Before anything runs; all arguments
  /// must outlive it.
  FollowedComponent(detail::ComponentCore& core, detail::OutputComparer& comparer,
                    Listener listener, host::ApplicationHost* late = nullptr);

  /// Adds the next one, in the order of their numbers.
  void add(FollowedActivation activation);
  /// Does not execute this activation, in which the other process crashed: its input is lost.
  /// Before `take_over`.
  void leave_out(std::uint64_t number) { left_out_.store(number); }
  /// No more activations follow: once those added are executed, the component works independently.
  /// What it publishes from then on is delivered.
  void take_over();
  /// The application stops: the component works independently, but its messages are discarded.
  void end();
  /// Has it check whether it can continue.
  void mark() { core_.inbox.mark_control(); }
  void wake() { core_.inbox.queue().wake(); }

  bool serve(detail::ActivationRing& ring) override;

  [[nodiscard]] detail::ComponentCore& core() noexcept { return core_; }
  /// Number of the last activation executed.
  [[nodiscard]] std::uint64_t executed() const noexcept { return executed_.load(); }
  [[nodiscard]] bool is_over() const noexcept { return stage_.load() == Stage::kOver; }

 private:
  enum class Stage : std::uint8_t { kFollows, kTakesOver, kEnds, kOver };
  enum class Input : std::uint8_t { kThere, kNotYet, kLost };

  /// A message for a view, taken out of its lane.
  struct ForView {
    detail::View* view;
    detail::Lane* lane;
    detail::Envelope* envelope;
  };

  [[nodiscard]] const FollowedActivation* next();
  void drop_posted();
  void pop();
  [[nodiscard]] std::string lost_of() const;
  [[nodiscard]] std::string why_lost() const;
  void skip(const FollowedActivation& activation, std::string_view why);
  [[nodiscard]] bool seek(detail::ActivationRing& ring, const FollowedActivation& activation);
  [[nodiscard]] std::uint64_t missing() const;
  void drop_cause(const FollowedActivation& activation);
  [[nodiscard]] Input find_frame(const FollowedActivation& activation);
  [[nodiscard]] Input find_after_frame();
  void begin_at(detail::ActivationRing& ring, const FollowedActivation& frame);
  bool execute_next(detail::ActivationRing& ring, const FollowedActivation& activation);
  void go_public();
  bool stop_following();
  void lose(std::string why);
  [[nodiscard]] Input find(detail::Lane& lane, std::uint64_t sequence, detail::Lane::Head& found);
  [[nodiscard]] Input find_inputs(const FollowedActivation& activation);
  [[nodiscard]] Input find_for_views(const FollowedActivation& activation);
  [[nodiscard]] Input find_for_view(detail::View& view, const detail::Read& read);
  [[nodiscard]] Input find_cause(const FollowedActivation& activation);
  [[nodiscard]] Input find_message(const FollowedActivation& activation);
  void execute(detail::ActivationRing& ring, const FollowedActivation& activation);
  void answer_for_mode(detail::ActivationRing& ring);
  void connect_what_waits(detail::ActivationRing& ring);

  detail::ComponentCore& core_;
  /// Activity while it follows was already recorded by the other process.
  const std::unique_ptr<detail::ActivationRing> ring_ = std::make_unique<detail::ActivationRing>();
  const Listener listener_;
  detail::ReplayedReads replayed_;
  std::vector<detail::PublisherCore*> publishers_;

  std::mutex mutex_;
  std::deque<FollowedActivation> waiting_;
  std::atomic<Stage> stage_{Stage::kFollows};
  std::atomic<std::uint64_t> executed_{0};
  std::atomic<std::uint64_t> left_out_{0};  ///< 0: none.

  // Of the worker.
  bool is_public_ = false;  ///< Its messages are delivered.
  bool is_lost_ = false;
  std::int64_t missing_since_ns_ = 0;  ///< Since when an input has been missing; 0: none is.
  host::ApplicationHost* late_;        ///< Null once no key frame is needed.
  std::uint64_t missing_ = 0;          ///< With `late_`: as of the last `missing()`.
  std::int64_t frames_after_ns_ = -1;  ///< Earlier key frames may have gaps after them.
  bool has_started_ = false;           ///< With `late_`: the start of its process is complete.
  std::size_t reads_found_ = 0;        ///< Of the next activation: with messages searched for.
  std::vector<ForView> for_views_;
  std::shared_ptr<detail::Lane> lost_;  ///< Of the message that never came; null if unknown.
  detail::LaneHead message_;            ///< Its cause; none: not found yet, or no message.
};

}  // namespace fastcycle::standby
