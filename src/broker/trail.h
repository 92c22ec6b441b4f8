#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <span>

#include "fastcycle/message.h"
#include "fastcycle/time.h"

namespace fastcycle::detail {

/// One publish on the path from a root to here.
struct Hop {
  PublisherId publisher = 0;
  Time begin{};  ///< Of the activation that published; of the first hop: the taken time.
  Time published{};
};

/// The path of a measurement: when it was taken, and every publish since. Each message has one for
/// each root, a topic where chains begin.
///
/// Its spans add up: from the taken time to the last publish, nothing is counted twice or omitted.
/// Beyond `kMaxHops` the last hop represents all further ones, such as in a cycle.
///
/// @threads  Compatible.
/// @realtime No allocation; the cost of a copy depends on the number of hops, not on the capacity.
class Trail {
 public:
  static constexpr std::size_t kMaxHops = 16;

  Trail() = default;
  Trail(const Trail& other) noexcept { *this = other; }
  Trail& operator=(const Trail& other) noexcept {
    if (this != &other) {
      taken_ = other.taken_;
      count_ = other.count_;
      std::copy_n(other.hops_.begin(), count_, hops_.begin());
    }
    return *this;
  }
  ~Trail() = default;

  /// A copy of what a process that is not trusted writes, at any time; unknown if it is no trail.
  [[nodiscard]] static Trail read_untrusted(const Trail& shared) noexcept {
    Trail trail;
    std::memcpy(static_cast<void*>(&trail), &shared, sizeof(Trail));
    std::atomic_signal_fence(std::memory_order_seq_cst);  // It is not read a second time.
    trail.count_ = trail.count_ <= kMaxHops ? trail.count_ : 0;
    return trail;
  }

  /// Whether it has a measurement of this root.
  [[nodiscard]] bool is_known() const noexcept { return count_ > 0; }
  [[nodiscard]] Time taken() const noexcept { return taken_; }
  [[nodiscard]] std::span<const Hop> hops() const noexcept { return {hops_.data(), count_}; }

  void forget() noexcept { count_ = 0; }

  /// A message of the root itself.
  void begin(Time taken, PublisherId publisher, Time published) noexcept {
    taken_ = taken;
    hops_[0] = {.publisher = publisher, .begin = taken, .published = published};
    count_ = 1;
  }

  /// Adds one hop. @pre `is_known()`
  void add(const Hop& hop) noexcept {
    if (count_ < kMaxHops) {
      hops_[count_++] = hop;
    } else {
      hops_.back().published = hop.published;
    }
  }

 private:
  Time taken_{};
  std::size_t count_ = 0;
  std::array<Hop, kMaxHops> hops_{};
};

}  // namespace fastcycle::detail
