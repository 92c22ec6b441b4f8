#pragma once

#include <utility>

#include "fastcycle/assert.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle {

template <Message T>
class Sample;

namespace detail {
template <Message T>
Sample<T> share(Envelope& envelope, Holder holder = kNobody);
template <Message T>
Envelope* envelope_of(const Sample<T>& sample);
template <Message T>
Holder holder_of(const Sample<T>& sample);
}  // namespace detail

/// A received message: shared by all holders, and const.
///
/// A callback that takes `const Sample<T>&` may copy it to keep the message; no byte is copied, and
/// the message returns to its publisher when the last sample is destroyed. A component declares the
/// number of samples that it keeps beyond its callbacks as `SubscriberOptions::keep`, so that the
/// publisher's pool is large enough. A subscriber that keeps more than its share receives no
/// further message until it releases one, and is named in the log; the other subscribers are
/// served.
///
/// @threads  Compatible; copies may live on different threads.
/// @realtime Copying and destroying take at most three atomic steps; nothing is allocated or freed.
template <Message T>
class Sample {
 public:
  Sample() = default;
  /// Holds the same message.
  Sample(const Sample& other) noexcept
      : envelope_(other.envelope_), holder_(other.holder_), is_lent_(false) {
    if (envelope_ != nullptr) {
      detail::retain(*envelope_);
      note_kept();
    }
  }
  /// Takes the message over.
  Sample(Sample&& other) noexcept
      : envelope_(std::exchange(other.envelope_, nullptr)),
        holder_(other.holder_),
        is_lent_(other.is_lent_) {
    stop_being_lent();
  }
  /// Releases its message, and takes that of `other`.
  Sample& operator=(Sample other) noexcept {
    std::swap(envelope_, other.envelope_);
    std::swap(holder_, other.holder_);
    std::swap(is_lent_, other.is_lent_);
    stop_being_lent();
    return *this;
  }
  ~Sample() {
    if (envelope_ != nullptr) {
      if (!is_lent_ && holder_ != detail::kNobody) {
        detail::let_go(*envelope_, holder_);
      }
      detail::release(envelope_);
    }
  }

  /// False for a sample that holds no message.
  [[nodiscard]] explicit operator bool() const noexcept { return envelope_ != nullptr; }

  /// The message. @pre It holds one.
  [[nodiscard]] const T& operator*() const {
    FASTCYCLE_ASSERT(envelope_ != nullptr, "a sample that is read holds a message");
    return static_cast<const T&>(*envelope_->payload);
  }
  /// As `*`.
  [[nodiscard]] const T* operator->() const { return &**this; }
  /// The message; null for a sample that holds none.
  [[nodiscard]] const T* get() const noexcept { return envelope_ == nullptr ? nullptr : &**this; }

  /// Sequence, publish time, publisher and origin. @pre It holds a message.
  [[nodiscard]] const MessageInfo& info() const {
    FASTCYCLE_ASSERT(envelope_ != nullptr, "a sample that is asked for its info holds a message");
    return envelope_->info;
  }

 private:
  friend Sample detail::share<T>(detail::Envelope& envelope, detail::Holder holder);
  friend detail::Envelope* detail::envelope_of<T>(const Sample& sample);
  friend detail::Holder detail::holder_of<T>(const Sample& sample);

  Sample(detail::Envelope& envelope, detail::Holder holder) noexcept
      : envelope_(&envelope), holder_(holder), is_lent_(true) {}

  void note_kept() const noexcept {
    if (holder_ != detail::kNobody) {
      detail::keep(*envelope_, holder_);
    }
  }
  void stop_being_lent() noexcept {
    if (envelope_ != nullptr && is_lent_) {
      note_kept();
    }
    is_lent_ = false;
  }

  detail::Envelope* envelope_ = nullptr;
  detail::Holder holder_ = detail::kNobody;
  /// A sample that FastCycle passes to a callback ends with it; only if it is copied or moved from
  /// it counts as kept.
  bool is_lent_ = false;
};

namespace detail {

/// A sample for the duration of a callback of `holder`.
template <Message T>
Sample<T> share(Envelope& envelope, Holder holder) {
  retain(envelope);
  return Sample<T>(envelope, holder);
}

template <Message T>
Envelope* envelope_of(const Sample<T>& sample) {
  return sample.envelope_;
}

template <Message T>
Holder holder_of(const Sample<T>& sample) {
  return sample.holder_;
}

}  // namespace detail
}  // namespace fastcycle
