#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "fastcycle/message.h"

namespace fastcycle::detail {

/// Of what kind a read is.
enum class ReadKind : std::uint8_t {
  kTaken,        ///< A view took over a message: whose, and its sequence.
  kCredits,      ///< A publisher was asked for credits: which, and how many there were.
  kSubscribers,  ///< A publisher was asked for its subscribers: which, and how many there were.
  kMode,         ///< The application's mode was asked for: its place in the application file.
};

/// One thing that an activation learned, and that follows neither from its cause nor from what the
/// component knew before: with the causes, all that a component can know of the run that it is in.
struct Read {
  std::uint64_t activation = 0;  ///< Its number.
  ReadKind kind{};
  std::uint32_t place = 0;  ///< Which of the component's views, in the order of their declaration.
  PublisherId publisher = 0;  ///< Whom it is about; 0 if that is no publisher.
  std::uint64_t value = 0;
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
  static constexpr std::size_t kWithoutViews = 64;

  explicit ReadRing(std::size_t capacity);

  /// What is added from now on belongs to `activation`.
  void begin(std::uint64_t activation) noexcept { activation_ = activation; }
  void add(ReadKind kind, std::uint32_t place, PublisherId publisher, std::uint64_t value) noexcept;

  /// Appends to `reads` those from the place `next` on, and moves `next` behind them. Returns how
  /// many were lost, since they were written over before.
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

  [[nodiscard]] bool read_at(std::uint64_t place, Read& found) const noexcept;

  std::uint64_t activation_ = 0;
  std::vector<Slot> slots_;
  std::atomic<std::uint64_t> next_{0};  ///< Released after the read: who sees it, sees that.
};

}  // namespace fastcycle::detail
