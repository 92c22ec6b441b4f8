#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/shared_memory.h"
#include "broker/read_ring.h"
#include "broker/trail.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

class PublisherCore;

/// Notifies another process, which follows a component, at the end of its activations.
///
/// @threads  Safe.
/// @realtime No lock, no allocation; one system call if the other process sleeps.
class ActivationBell {
 public:
  ActivationBell() = default;
  ActivationBell(const ActivationBell&) = delete;
  ActivationBell& operator=(const ActivationBell&) = delete;
  virtual ~ActivationBell() = default;

  virtual void ring() noexcept = 0;
};

/// Where published messages wait until the end of a round of simulated time.
class Stage {
 public:
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  virtual ~Stage() = default;

  virtual void put(PublisherCore& publisher, Envelope* envelope) = 0;
};

/// Saves the state of a component at the end of an activation.
class KeyFrames {
 public:
  KeyFrames() = default;
  KeyFrames(const KeyFrames&) = delete;
  KeyFrames& operator=(const KeyFrames&) = delete;
  virtual ~KeyFrames() = default;

  /// At the end of each activation, while it may still publish.
  virtual void end_activation() = 0;
  /// The component's object is about to be replaced.
  virtual void end_object() noexcept = 0;
  /// Params were changed; `text` is their form in a log.
  virtual void change_params(std::uint64_t transaction, std::string_view text) = 0;
};

/// The part of a component that its publishers use.
///
/// @threads  Confined to the component's activations, and to the control thread before the start.
struct PublishingComponent {
  std::string name;
  const base::Clock* clock = nullptr;
  Stage* stage = nullptr;        ///< In simulated time; null when live.
  bool has_subscribers = false;  ///< Then its messages inherit their origin.
  /// The thread of its activation; null if there is none. Only this thread may publish. Also read
  /// by its own threads, to compare with themselves.
  std::atomic<const void*> active_thread{nullptr};
  bool is_muted = false;       ///< Then its messages are not delivered.
  Time now{};                  ///< The activation's time.
  Duration simulated_cost{0};  ///< In simulated time: how much later it publishes.
  /// The activation's origin; root 0 if it has no cause. That of a message is read only if
  /// something is published.
  const Origin* origin = &kNoOrigin;
  static constexpr Origin kNoOrigin{};
  /// The trails of the activation's cause, for each root of latency chains; null if it has none.
  const Trail* trails = nullptr;
  /// The newest delivered trail of each root, used for roots that the cause has no trail of; null
  /// if there are no chains.
  const Trail* held_trails = nullptr;
  std::uint32_t publish_count = 0;  ///< In this activation.
  Time published{};                 ///< The last publish time of its own publishers.
  /// There is work at the end of the activation: credits were queried, or a subscription has ended.
  bool has_leftovers = false;
  std::vector<PublisherCore*> asked = {};    ///< Publishers whose credits were queried.
  std::vector<PublisherId> publishers = {};  ///< All of its own. Constant once declared.

  KeyFrames* key_frames = nullptr;  ///< Null if no state is declared.
  /// Records the reads of its activations; null if they are not recorded.
  ReadRing* reads = nullptr;
  /// In a replay: the recorded reads of its activations. Else null.
  ReplayedReads* replayed = nullptr;
  /// Its process is a standby: its activations were executed in the followed one before.
  bool is_following = false;
  ActivationBell* follower = nullptr;  ///< Rung after each activation; null: no process follows it.
  /// Records a read of this activation.
  void learned(ReadKind kind, PublisherId about, std::uint64_t value,
               std::uint32_t place = 0) const noexcept {
    if (reads != nullptr) {
      reads->add(kind, place, about, value);
    }
  }
  void learned(ReadKind kind, std::string_view text, std::uint32_t place = 0) const noexcept {
    if (reads != nullptr) {
      reads->add(kind, place, text);
    }
  }
  /// The result of `find()`, or in a replay the recorded one.
  template <typename Find>
  std::uint64_t learn(ReadKind kind, PublisherId about, const Find& find) const {
    if (replayed != nullptr) [[unlikely]] {
      if (const ReplayedReads::Entry* entry = replayed->take(kind, about)) {
        return entry->read.value;
      }
    }
    const auto value = static_cast<std::uint64_t>(find());
    learned(kind, about, value);
    return value;
  }

  /// A limit that others also affect refused `call`, which identifies it within this activation.
  void refused(std::string_view call, std::string_view why) const {
    if (is_active_here()) {
      learned(ReadKind::kRefused, std::string(call) + '\0' + std::string(why));
    }
  }
  /// In a replay: why `call` was refused in the recorded activation; none if it was not.
  [[nodiscard]] std::optional<std::string> replayed_refusal(std::string_view call) const {
    return replayed == nullptr ? std::nullopt : replayed->take_text(ReadKind::kRefused, call);
  }

  /// An activation begins on the calling thread.
  void enter() noexcept {
    active_thread.store(__builtin_thread_pointer(), std::memory_order_relaxed);
  }
  void leave() noexcept {
    active_thread.store(nullptr, std::memory_order_relaxed);
    base::shared_scopes =
        0;  // A loan that outlives the activation keeps its memory, not the scope.
  }
  /// For work on the component's behalf, possibly by another thread while it waits.
  [[nodiscard]] bool is_in_activation() const noexcept {
    return active_thread.load(std::memory_order_relaxed) != nullptr;
  }
  /// Whether the calling thread is in an activation of this component. Safe: a thread finds its own
  /// id there only if it stored it.
  [[nodiscard]] bool is_active_here() const noexcept {
    return active_thread.load(std::memory_order_relaxed) == __builtin_thread_pointer();
  }
};

}  // namespace fastcycle::detail
