#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "broker/read_ring.h"
#include "broker/trail.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

class PublisherCore;

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
  Stage* stage = nullptr;         ///< In simulated time; null when live.
  bool has_subscribers = false;   ///< Then its messages inherit their origin.
  bool is_in_activation = false;  ///< Only then it may publish,
  const void* thread = nullptr;   ///< and only on the thread of its activation,
  bool is_muted = false;          ///< unless it is muted: then nobody receives it.
  Time now{};                     ///< The activation's time.
  Duration simulated_cost{0};     ///< In simulated time: how much later it publishes.
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

  /// An activation begins on the calling thread.
  void enter() noexcept {
    is_in_activation = true;
    thread = __builtin_thread_pointer();
  }
  void leave() noexcept { is_in_activation = false; }
  /// Whether the calling thread is in an activation of this component.
  [[nodiscard]] bool is_active_here() const noexcept {
    return is_in_activation && thread == __builtin_thread_pointer();
  }
};

}  // namespace fastcycle::detail
