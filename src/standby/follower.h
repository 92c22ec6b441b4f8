#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "broker/followed_outputs.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "executor/peer_activity.h"
#include "standby/followed_component.h"
#include "standby/read_assembly.h"

namespace fastcycle::standby {

/// The followed process, as its follower sees it.
///
/// @threads  Safe.
class Followed {
 public:
  Followed() = default;
  Followed(const Followed&) = delete;
  Followed& operator=(const Followed&) = delete;
  virtual ~Followed() = default;

  [[nodiscard]] virtual const detail::PeerActivity::Rings& rings() const = 0;
  /// Incremented after each of its activations.
  [[nodiscard]] virtual std::uint32_t progress() const noexcept = 0;
  /// All its workers have ended, and it did not end in order.
  [[nodiscard]] virtual bool has_ended() const noexcept = 0;
  /// Index of the component in whose activation it crashed; none if it ended otherwise.
  [[nodiscard]] virtual std::optional<std::uint32_t> crashed_in() const noexcept = 0;
  /// It has ended: takes its remaining messages and returns.
  virtual void take_rest() = 0;
  /// Announces to all that this process publishes from now on.
  virtual void take_place() = 0;
};

/// Follows all components of another process: executes their activations here, in the same order,
/// and takes over when that process ends.
///
/// Messages that the other process published are not published again, unless they may not have
/// reached all: those of the activation in which it ended, and of those not executed here yet.
///
/// @threads  Safe.
class Follower final : public detail::OutputComparer {
 public:
  struct Listener {
    /// It has caught up, and follows.
    std::function<void()> in_step = [] {};
    /// Two messages of one sequence, by several threads; if not set, a difference ends following.
    std::function<void(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
                       const detail::Envelope& own, bool is_equal)>
        compare = {};
    /// A message that only one of them has published.
    std::function<void(const detail::PublisherCore& publisher, bool is_theirs)> unmatched = {};
    /// A message that has waited too long for that of the other.
    std::function<void(const detail::PublisherCore& publisher)> not_compared = {};
    /// It can no longer follow.
    std::function<void(const std::string& why)> lost = [](const std::string&) {};
    /// All components work independently, this many ns after the end of the other process was
    /// noticed.
    std::function<void(std::int64_t duration_ns)> taken_over = [](std::int64_t) {};
  };

  struct Options {
    bool is_late = false;    ///< From a key frame on; else from the first activation on.
    bool takes_over = true;  ///< Else it ends with the other process.
  };
  /// `components` were built and not started. All arguments must outlive this.
  Follower(host::ApplicationHost& application, Followed& followed,
           const std::vector<detail::ComponentCore*>& components, Options options,
           Listener listener);
  ~Follower() override;

  /// Checks for news; `has_come`: messages arrived. True if there was anything.
  bool look(bool has_come);
  [[nodiscard]] bool has_news() const noexcept;

  /// The application stops.
  void end();

  /// Known activations of the other process, and those of them executed.
  struct Progress {
    std::uint64_t known = 0;
    std::uint64_t executed = 0;
    std::uint64_t compared = 0;  ///< Messages published by both.
  };
  [[nodiscard]] Progress progress() const;

  void compare(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
               const detail::Envelope& own) noexcept override;
  void unmatched(const detail::PublisherCore& publisher, bool is_theirs) noexcept override;
  void not_compared(const detail::PublisherCore& publisher) noexcept override;

 private:
  struct Its {
    std::unique_ptr<FollowedComponent> script;
    std::unique_ptr<ReadAssembly> reads;
    std::map<std::uint64_t, detail::ActivationRecord> pending;  ///< By number.
    std::uint64_t next = 1;                                     ///< The next expected number.
    bool is_late = false;                                       ///< No key frame was found yet.
  };

  void read_rings();
  void add(const detail::ActivationRecord& record);
  void pass_on(Its& its);
  void take_over();
  void mark_all();
  void lose(const std::string& why);
  void component_is_over();

  Followed& followed_;
  const Options options_;
  const Listener listener_;
  std::map<std::uint32_t, Its> its_;  ///< By component. The map itself is constant.

  mutable std::mutex mutex_;
  std::vector<std::uint64_t> next_;  ///< Position in each ring.
  /// Follows the activations that began after this, CLOCK_MONOTONIC; 0: all. Of earlier ones some
  /// may be before the positions at which it began to read.
  std::int64_t begins_after_ns_ = 0;
  std::vector<detail::ActivationRecord> new_;
  std::uint64_t known_ = 0;
  bool is_in_step_ = false;  ///< The listener was notified.
  std::int64_t ended_ns_ = 0;

  std::atomic<std::uint32_t> progress_seen_{0};
  std::atomic<bool> is_taking_over_{false};
  std::atomic<bool> is_over_{false};
  std::atomic<bool> is_lost_{false};
  std::atomic<std::size_t> still_following_{0};
  std::atomic<std::size_t> still_seeking_{0};
  std::atomic<std::uint64_t> compared_{0};
};

}  // namespace fastcycle::standby
