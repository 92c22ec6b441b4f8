#pragma once

#include <utility>

#include "fastcycle/assert.h"
#include "fastcycle/detail/envelope.h"

namespace fastcycle {

template <Message T>
class Sample;

namespace detail {
template <Message T>
Sample<T> share(Envelope& envelope);
template <Message T>
Envelope* envelope_of(const Sample<T>& sample);
}  // namespace detail

/// A received message: shared by all who hold it, and const.
///
/// A callback that takes `const Sample<T>&` may copy it to keep the message; no byte is copied, and
/// the message goes back to its publisher when the last sample lets go. What a component keeps
/// longer than its callback lasts is declared as `"keep"` of the subscription, so that the
/// publisher's pool is large enough.
///
/// @threads  Compatible; copies may live on different threads.
/// @realtime Copying and letting go is one atomic step; nothing is allocated or freed.
template <Message T>
class Sample {
 public:
  Sample() = default;
  /// Holds the same message.
  Sample(const Sample& other) noexcept : envelope_(other.envelope_) {
    if (envelope_ != nullptr) {
      detail::retain(*envelope_);
    }
  }
  /// Takes the message over.
  Sample(Sample&& other) noexcept : envelope_(std::exchange(other.envelope_, nullptr)) {}
  /// Lets go of what it held, and holds that of `other`.
  Sample& operator=(Sample other) noexcept {
    std::swap(envelope_, other.envelope_);
    return *this;
  }
  ~Sample() {
    if (envelope_ != nullptr) {
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
  friend Sample detail::share<T>(detail::Envelope& envelope);
  friend detail::Envelope* detail::envelope_of<T>(const Sample& sample);

  detail::Envelope* envelope_ = nullptr;
};

namespace detail {

template <Message T>
Sample<T> share(Envelope& envelope) {
  retain(envelope);
  Sample<T> sample;
  sample.envelope_ = &envelope;
  return sample;
}

template <Message T>
Envelope* envelope_of(const Sample<T>& sample) {
  return sample.envelope_;
}

}  // namespace detail
}  // namespace fastcycle
