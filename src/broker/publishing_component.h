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

/// Who is told of a component's activations when they are over: another process, which follows it.
///
/// @threads  Safe.
/// @realtime No lock, no allocation; one system call if the other one sleeps.
class ActivationBell {
 public:
  ActivationBell() = default;
  ActivationBell(const ActivationBell&) = delete;
  ActivationBell& operator=(const ActivationBell&) = delete;
  virtual ~ActivationBell() = default;

  virtual void ring() noexcept = 0;
};

/// Where published messages wait until a round of simulated time is over.
class Stage {
 public:
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  virtual ~Stage() = default;

  virtual void put(PublisherCore& publisher, Envelope* envelope) = 0;
};

/// Who writes down, at the end of an activation, what its component remembers.
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
  /// Params were changed; `text` is what a log says of them.
  virtual void change_params(std::uint64_t transaction, std::string_view text) = 0;
};

/// What a publisher must know of the component that owns it.
///
/// @threads  Confined to the component's activations, and to the control thread before the start.
struct PublishingComponent {
  std::string name;
  const base::Clock* clock = nullptr;
  Stage* stage = nullptr;        ///< In simulated time; null when live.
  bool has_subscribers = false;  ///< Then its messages inherit their origin.
  /// The thread of its activation; null: it is in none. Only there it may publish. Also read by its
  /// own threads, which ask whether they are the one.
  std::atomic<const void*> active_thread{nullptr};
  bool is_muted = false;       ///< Then nobody receives what it publishes.
  Time now{};                  ///< The activation's time.
  Duration simulated_cost{0};  ///< In simulated time: how much later it publishes.
  /// The activation's origin; root 0 if nothing led to it. That of a message is read only if
  /// something is published.
  const Origin* origin = &kNoOrigin;
  static constexpr Origin kNoOrigin{};
  /// What led to the activation, for each root of latency chains; null if nothing did.
  const Trail* trails = nullptr;
  /// The newest that was delivered for each root, for those that the cause knows nothing of; null
  /// where there are no chains.
  const Trail* held_trails = nullptr;
  std::uint32_t publish_count = 0;  ///< In this activation.
  Time published{};                 ///< The last publish time of its own publishers.
  /// Something is to be done when the activation is over: publishers were asked for credits, or a
  /// subscription has ended.
  bool has_leftovers = false;
  std::vector<PublisherCore*> asked = {};    ///< For credits.
  std::vector<PublisherId> publishers = {};  ///< All of its own. Constant once declared.

  KeyFrames* key_frames = nullptr;  ///< Null where no state is declared.
  /// Where what it learns in its activations is kept; null if nobody records that.
  ReadRing* reads = nullptr;
  /// Where its activations are executed again: what they learned when they were recorded. Else
  /// null.
  ToldReads* told = nullptr;
  /// Its process follows another one: what it does has been done there. Else false.
  bool is_following = false;
  ActivationBell* follower = nullptr;  ///< Rung after each activation; null: nobody follows it.
  /// It learned something in this activation.
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
  /// What `find()` gives, and what it gave when this activation was recorded.
  template <typename Find>
  std::uint64_t learn(ReadKind kind, PublisherId about, const Find& find) const {
    if (told != nullptr) [[unlikely]] {
      if (const ToldReads::Entry* entry = told->take(kind, about)) {
        return entry->read.value;
      }
    }
    const auto value = static_cast<std::uint64_t>(find());
    learned(kind, about, value);
    return value;
  }

  /// A limit that others have a part in refused `call`, which tells it from the other calls of this
  /// activation.
  void refused(std::string_view call, std::string_view why) const {
    if (is_active_here()) {
      learned(ReadKind::kRefused, std::string(call) + '\0' + std::string(why));
    }
  }
  /// Why `call` was refused when this activation was recorded; none if it was not.
  [[nodiscard]] std::optional<std::string> told_refusal(std::string_view call) const {
    return told == nullptr ? std::nullopt : told->take_text(ReadKind::kRefused, call);
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
  /// For what is done on the component's behalf, maybe by a thread that waits with it.
  [[nodiscard]] bool is_in_activation() const noexcept {
    return active_thread.load(std::memory_order_relaxed) != nullptr;
  }
  /// Whether the calling thread is in an activation of this component. Safe: a thread finds itself
  /// there only if it stored that.
  [[nodiscard]] bool is_active_here() const noexcept {
    return active_thread.load(std::memory_order_relaxed) == __builtin_thread_pointer();
  }
};

}  // namespace fastcycle::detail
