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

/// The process that is followed, as far as its follower must know it.
///
/// @threads  Safe.
class Followed {
 public:
  Followed() = default;
  Followed(const Followed&) = delete;
  Followed& operator=(const Followed&) = delete;
  virtual ~Followed() = default;

  [[nodiscard]] virtual const detail::PeerActivity::Rings& rings() const = 0;
  /// Counted up after each of its activations.
  [[nodiscard]] virtual std::uint32_t progress() const noexcept = 0;
  /// None of its workers will ever do anything again, and it did not end in order.
  [[nodiscard]] virtual bool has_ended() const noexcept = 0;
  /// In an activation of which component it crashed, by its place; none if it was ended otherwise.
  [[nodiscard]] virtual std::optional<std::uint32_t> crashed_in() const noexcept = 0;
  /// It has ended: takes what it published and what did not come here yet.
  virtual void take_rest() = 0;
  /// Says to all that this process publishes from now on.
  virtual void take_place() = 0;
};

/// Follows all components of another process: executes their activations here, in the same order,
/// and takes their place when that process ends.
///
/// What the other process published is published again by nobody, unless it may not have reached
/// all: of the activation in which it ended, and of those that were not executed here yet.
///
/// @threads  Safe.
class Follower final : public detail::OutputComparer {
 public:
  struct Listener {
    /// It follows, from now on up to the present.
    std::function<void()> in_step = [] {};
    /// Two messages of one sequence, by several threads; not set: a difference is the end of
    /// following.
    std::function<void(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
                       const detail::Envelope& own, bool is_equal)>
        compare = {};
    /// One that only one of both has published, the other one or this.
    std::function<void(const detail::PublisherCore& publisher, bool is_theirs)> unmatched = {};
    /// It cannot follow any longer.
    std::function<void(const std::string& why)> lost = [](const std::string&) {};
    /// All components serve by themselves, so many ns after the end of the other one was seen.
    std::function<void(std::int64_t duration_ns)> taken_over = [](std::int64_t) {};
  };

  struct Options {
    bool is_late = false;    ///< From a key frame on; else from the first activation on.
    bool takes_over = true;  ///< Else it ends when the other one does.
  };
  /// `components` were built and not started. All have to live as long as this.
  Follower(host::ApplicationHost& application, Followed& followed,
           const std::vector<detail::ComponentCore*>& components, Options options,
           Listener listener);
  ~Follower() override;

  /// Looks for what is new; `has_come`: messages came here. True if there was anything.
  bool look(bool has_come);
  [[nodiscard]] bool has_news() const noexcept;

  /// The application stops.
  void end();

  /// Activations of the other one that are known here, and of these, executed.
  struct Progress {
    std::uint64_t known = 0;
    std::uint64_t executed = 0;
    std::uint64_t compared = 0;  ///< Messages that both published.
  };
  [[nodiscard]] Progress progress() const;

  void compare(const detail::PublisherCore& publisher, const detail::Envelope& theirs,
               const detail::Envelope& own) noexcept override;
  void unmatched(const detail::PublisherCore& publisher, bool is_theirs) noexcept override;

 private:
  struct Its {
    std::unique_ptr<FollowedComponent> script;
    std::unique_ptr<ReadAssembly> reads;
    std::map<std::uint64_t, detail::ActivationRecord> pending;  ///< By number.
    std::uint64_t next = 1;                                     ///< The number that is expected.
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
  std::map<std::uint32_t, Its> its_;  ///< By component. Constant but for what is in them.

  mutable std::mutex mutex_;
  std::vector<std::uint64_t> next_;  ///< In each ring.
  std::vector<detail::ActivationRecord> new_;
  std::uint64_t known_ = 0;
  bool is_in_step_ = false;  ///< It was told.
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
