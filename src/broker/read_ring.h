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

/// The kind of a read.
enum class ReadKind : std::uint8_t {
  kTaken,        ///< A view took over a message: its publisher and sequence.
  kCredits,      ///< `credits` was called: the publisher, and the result.
  kSubscribers,  ///< `subscriber_count` was called: the publisher, and the result.
  kMode,         ///< `mode` was called: the mode's index in the application file.
  kQosEvent,     ///< An event of `Watch::place`: a text, see `WrittenEvent`.
  kBegan,        ///< When the application's timers started, ns since 1970.
  kLateStart,    ///< Whether `start()` exceeded its limit: 0 or 1.
  kThreads,      ///< Threads of an old object: 0 ended, 1 waited for, 2 too late.
  kParams,       ///< New values of params: a text.
  kResult,       ///< The result of a change of params: a text.
  kObserved,     ///< The result of `observe()`: a text.
  kKeyFrame,     ///< A key frame of declared state: its publisher, the message, the state's number.
  kSequence,     ///< Of a key frame: a publisher, and its last message.
  kHeld,         ///< Of a key frame: a message that a view holds.
  kFrameNumber,  ///< Of a key frame: see `DeclaredStates::FrameNumber`.
  kFrameParams,  ///< Of a key frame: all changed params: a text.
  kPublished,    ///< When the message before it was published, ns since 1970, if the log does not
                 ///< have it.
  kMadeWith,     ///< Params that a new object began with before their change was announced: a text.
  kRefused,      ///< A call that a limit refused: a text, the call and the reason.
  kThrew,        ///< An exception of a thread of its own: a text.
  kText = 255,   ///< The next 1 to 8 bytes of the preceding text; `place`: how many.
};

/// A value that an activation read, and that follows neither from its cause nor from the
/// component's earlier reads: causes and reads together are all inputs of a component.
struct Read {
  std::uint64_t activation = 0;  ///< Its number.
  ReadKind kind{};
  std::uint32_t place = 0;    ///< Number of the component's view, in the order of declaration.
  PublisherId publisher = 0;  ///< The publisher concerned; 0 if none.
  std::uint64_t value = 0;    ///< Of a text: its bytes.
};

/// The last reads of one component, for recorders.
///
/// @threads  `begin` and `add` by the worker that serves the component; `read` by any thread: reads
///           that are overwritten meanwhile are skipped, and counted.
/// @realtime No lock, no allocation.
class ReadRing {
 public:
  /// For a component with views, each of which may take over many messages at once.
  static constexpr std::size_t kForViews = 4096;
  static constexpr std::size_t kWithoutViews = 256;

  /// In memory of its own.
  explicit ReadRing(std::size_t capacity);
  /// In `memory`, `bytes_of(capacity)` that outlive it, which other processes may read. If all of
  /// it is zero, the ring is empty. A constant ring only reads.
  ReadRing(void* memory, std::size_t capacity) noexcept;
  [[nodiscard]] static std::size_t bytes_of(std::size_t capacity) noexcept;

  /// Further reads belong to `activation`.
  void begin(std::uint64_t activation) noexcept { activation_ = activation; }
  void add(ReadKind kind, std::uint32_t place, PublisherId publisher, std::uint64_t value) noexcept;
  /// The same for a text.
  void add(ReadKind kind, std::uint32_t place, std::string_view text) noexcept;

  /// Appends to `reads` those from position `next` on, and advances `next`. Returns how many were
  /// lost because they were overwritten. Regardless of the ring's content, it appends at most its
  /// capacity.
  std::uint64_t read(std::uint64_t& next, std::vector<Read>& reads) const;

 private:
  // As in `ActivationRing`: the version has the position that the slot holds, and is odd while it
  // is being written.
  struct Slot {
    std::atomic<std::uint64_t> version{0};
    std::atomic<std::uint64_t> activation{0};
    std::atomic<std::uint64_t> kind{0};  ///< With the place above its lowest byte.
    std::atomic<std::uint64_t> publisher{0};
    std::atomic<std::uint64_t> value{0};
  };

  /// The memory of the ring: this, followed by the slots.
  struct alignas(64) Words {
    std::atomic<std::uint64_t> next{0};  ///< Released after the read.
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

/// The reads of a recorded activation, returned again in its replay.
///
/// @threads  Confined to the component's activations, and between them to the thread that executes
///           them.
class ReplayedReads {
 public:
  /// One read; of a text, all of it.
  struct Entry {
    Read read;
    std::string text = {};
  };

  /// Sets the `entries` to return, which are valid until the next call.
  void begin(std::span<const Entry> entries);
  /// The first of this kind, for this publisher or place, that was not returned yet. Null if there
  /// is none: the activation reads something that the recorded one did not.
  [[nodiscard]] const Entry* take(ReadKind kind, PublisherId about = 0, std::uint32_t place = 0);
  /// The rest of the first text of this kind that begins with `name` and a zero byte and was not
  /// returned yet; none if there is none, which does not count as missed.
  [[nodiscard]] std::optional<std::string> take_text(ReadKind kind, std::string_view name);
  /// Whether there is one of this kind, returned or not.
  [[nodiscard]] bool has(ReadKind kind) const noexcept;
  /// Whether a read was requested that was not recorded.
  [[nodiscard]] bool has_missed() const noexcept { return has_missed_; }

 private:
  std::span<const Entry> entries_;
  std::vector<bool> is_taken_;
  bool has_missed_ = false;
};

}  // namespace fastcycle::detail
