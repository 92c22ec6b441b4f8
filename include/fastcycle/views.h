#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "fastcycle/sample.h"
#include "fastcycle/time.h"

namespace fastcycle {

/// How much a `History` holds: at most `depth` messages, none older than `span`.
struct HistoryOptions {
  /// Above zero.
  std::size_t depth = 64;
  std::optional<Duration> span =
      {};  ///< Measured from the newest activation's time; no limit if absent.
};

namespace detail {

class View;

std::size_t view_size(const View& view) noexcept;
/// The envelope at `index`, counted from the oldest. @pre `index < view_size(view)`
Envelope& view_at(const View& view, std::size_t index) noexcept;
Time view_now(const View& view) noexcept;
Holder view_holder(const View& view) noexcept;

}  // namespace detail

/// The newest message of a topic, for components that work at their own pace.
///
/// It causes no activation and no wake-up. Its content is frozen when an activation starts: two
/// calls in one callback return the same message.
///
/// @threads  Confined to its component's activations: a call elsewhere ends the process with a
///           message.
/// @realtime No lock, no allocation.
template <Message T>
class Latest {
 public:
  /// Constructed by `Context::create_latest`.
  explicit Latest(detail::View& view) : view_(&view) {}

  /// The newest message, or an empty sample if none was received yet.
  [[nodiscard]] Sample<T> get() const {
    const auto size = detail::view_size(*view_);
    return size == 0
               ? Sample<T>()
               : detail::share<T>(detail::view_at(*view_, size - 1), detail::view_holder(*view_));
  }

  /// How old the newest message is, from its publish time to now; none if there is none.
  [[nodiscard]] std::optional<Duration> age() const {
    const auto newest = get();
    return newest ? std::optional<Duration>(detail::view_now(*view_) - newest.info().publish_time)
                  : std::nullopt;
  }

 private:
  detail::View* view_;
};

/// The last messages of a topic, for components that look back in time.
///
/// As with `Latest`, it causes no activation, and its content is frozen when one starts.
///
/// @threads  As `Latest`.
/// @realtime No lock; `range` allocates the vector that it returns.
template <Message T>
class History {
 public:
  /// Constructed by `Context::create_history`.
  explicit History(detail::View& view) : view_(&view) {}

  /// The number of messages.
  [[nodiscard]] std::size_t size() const { return detail::view_size(*view_); }

  /// The message at `index`, counted from the oldest. @pre `index < size()`
  [[nodiscard]] Sample<T> operator[](std::size_t index) const {
    FASTCYCLE_ASSERT(index < size(), "an index of a history is below its size");
    return detail::share<T>(detail::view_at(*view_, index), detail::view_holder(*view_));
  }

  /// The newest message published at or before `time`; an empty sample if there is none.
  [[nodiscard]] Sample<T> at(Time time) const {
    for (std::size_t index = size(); index > 0; --index) {
      if (detail::view_at(*view_, index - 1).info.publish_time <= time) {
        return (*this)[index - 1];
      }
    }
    return {};
  }

  /// All messages published from `first` to `last`, both included, oldest first.
  [[nodiscard]] std::vector<Sample<T>> range(Time first, Time last) const {
    std::vector<Sample<T>> found;
    for (std::size_t index = 0; index < size(); ++index) {
      const Time published = detail::view_at(*view_, index).info.publish_time;
      if (published >= first && published <= last) {
        found.push_back((*this)[index]);
      }
    }
    return found;
  }

 private:
  detail::View* view_;
};

}  // namespace fastcycle
