#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fastcycle/message.h"

namespace fastcycle::detail {

/// Of what kind a read is.
enum class ReadKind : std::uint8_t {
  kTaken,        ///< A view took over a message: whose, and its sequence.
  kCredits,      ///< A publisher was asked for credits: which, and how many there were.
  kSubscribers,  ///< A publisher was asked for its subscribers: which, and how many there were.
  kMode,         ///< The application's mode was asked for: its place in the application file.
  kQosEvent,     ///< An event of `Watch::place`: a text, see `WrittenEvent`.
  kBegan,        ///< When the application's timers started, ns since 1970.
  kLateStart,    ///< Whether `start()` has taken too long: 0 or 1.
  kThreads,      ///< Threads of an old object: 0 ended, 1 waited for, 2 too late.
  kParams,       ///< New values of params: a text.
  kResult,       ///< What became of a change of params: a text.
  kObserved,     ///< What `observe()` found: a text.
  kKeyFrame,     ///< A key frame of declared state: its publisher, the message, which state.
  kSequence,     ///< Of a key frame: a publisher, and its last message.
  kHeld,         ///< Of a key frame: a message that a view holds.
  kFrameNumber,  ///< Of a key frame: see `DeclaredStates::FrameNumber`.
  kFrameParams,  ///< Of a key frame: all params that were changed: a text.
  kPublished,    ///< When the message before it was published, ns since 1970; not in the log else.
  kMadeWith,     ///< Params that a new object began with before it was told of them: a text.
  kRefused,      ///< A call that a limit refused: a text, what call and why.
  kThrew,        ///< What a thread of its own threw: a text.
  kText = 255,   ///< The next 1 to 8 bytes of the text before it; `place`: how many.
};

/// One thing that an activation learned, and that follows neither from its cause nor from what the
/// component knew before: with the causes, all that a component can know of the run that it is in.
struct Read {
  std::uint64_t activation = 0;  ///< Its number.
  ReadKind kind{};
  std::uint32_t place = 0;  ///< Which of the component's views, in the order of their declaration.
  PublisherId publisher = 0;  ///< Whom it is about; 0 if that is no publisher.
  std::uint64_t value = 0;    ///< Of a text: its bytes.
};

/// The last reads of one component, for who records what its activations saw.
///
/// @threads  `begin` and `add` by the worker that serves the component; `read` by any thread: what
///           is written over meanwhile is left out, and counted.
/// @realtime No lock, no allocation.
class ReadRing {
 public:
  /// For a component with views, each of which may take over many messages at once.
  static constexpr std::size_t kForViews = 4096;
  static constexpr std::size_t kWithoutViews = 256;

  /// In memory of its own.
  explicit ReadRing(std::size_t capacity);
  /// In `memory`, `bytes_of(capacity)` that outlive it, which other processes may read. Where all
  /// of that is zero, the ring is empty. One that is constant reads only.
  ReadRing(void* memory, std::size_t capacity) noexcept;
  [[nodiscard]] static std::size_t bytes_of(std::size_t capacity) noexcept;

  /// What is added from now on belongs to `activation`.
  void begin(std::uint64_t activation) noexcept { activation_ = activation; }
  void add(ReadKind kind, std::uint32_t place, PublisherId publisher, std::uint64_t value) noexcept;
  /// The same of a text.
  void add(ReadKind kind, std::uint32_t place, std::string_view text) noexcept;

  /// Appends to `reads` those from the place `next` on, and moves `next` behind them. Returns how
  /// many were lost, since they were written over before. Whatever the ring says, it appends as
  /// many as fit into it at most.
  std::uint64_t read(std::uint64_t& next, std::vector<Read>& reads) const;

 private:
  // As in `ActivationRing`: the version says which place the slot holds, and is odd while it is
  // being written.
  struct Slot {
    std::atomic<std::uint64_t> version{0};
    std::atomic<std::uint64_t> activation{0};
    std::atomic<std::uint64_t> kind{0};  ///< With the place above its lowest byte.
    std::atomic<std::uint64_t> publisher{0};
    std::atomic<std::uint64_t> value{0};
  };

  /// Where the reads lie: this, and behind it the slots.
  struct alignas(64) Words {
    std::atomic<std::uint64_t> next{0};  ///< Released after the read: who sees it, sees that.
  };

  [[nodiscard]] Slot& slot_at(std::uint64_t place) const noexcept {
    return reinterpret_cast<Slot*>(&words_ + 1)[place % capacity_];
  }
  [[nodiscard]] bool read_at(std::uint64_t place, Read& found) const noexcept;

  const std::size_t capacity_;
  std::unique_ptr<Words[]> own_;  ///< Null if others own its memory.
  Words& words_;
  std::uint64_t activation_ = 0;
};

/// What a recorded activation learned, given again where that activation is executed again.
///
/// @threads  Confined to the component's activations, and to who executes them, between them.
class ToldReads {
 public:
  /// One read; of a text, all of it.
  struct Entry {
    Read read;
    std::string text = {};
  };

  /// From now on gives `entries`, which live until the next call.
  void begin(std::span<const Entry> entries);
  /// The first of this kind, about this publisher or place, that was not given yet. None if there
  /// is none: the activation asks for something that it did not ask for when it was recorded.
  [[nodiscard]] const Entry* take(ReadKind kind, PublisherId about = 0, std::uint32_t place = 0);
  /// What follows `name` and a zero byte in the first text of this kind that begins so and was not
  /// given yet; none if there is none, which an activation may well ask for.
  [[nodiscard]] std::optional<std::string> take_text(ReadKind kind, std::string_view name);
  /// Whether there is one of this kind, given or not.
  [[nodiscard]] bool has(ReadKind kind) const noexcept;
  /// Whether it was asked for something that was not recorded.
  [[nodiscard]] bool has_missed() const noexcept { return has_missed_; }

 private:
  std::span<const Entry> entries_;
  std::vector<bool> is_taken_;
  bool has_missed_ = false;
};

}  // namespace fastcycle::detail
