#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

class PublisherCore;

/// Compares the messages of a component on standby with those of the one that it follows.
///
/// @threads  By one thread at a time for each publisher.
class OutputComparer {
 public:
  OutputComparer() = default;
  OutputComparer(const OutputComparer&) = delete;
  OutputComparer& operator=(const OutputComparer&) = delete;
  virtual ~OutputComparer() = default;

  /// Two messages of the same sequence.
  virtual void compare(const PublisherCore& publisher, const Envelope& theirs,
                       const Envelope& own) noexcept = 0;
  /// A message that only one side has published.
  virtual void unmatched(const PublisherCore& publisher, bool is_theirs) noexcept = 0;
  /// A message that waited while `FollowedOutputs::kMost` later ones came.
  virtual void not_compared(const PublisherCore& publisher) noexcept = 0;
};

/// The outputs of one publisher on standby: its own, and those of the publisher that it follows,
/// each kept until its counterpart arrives. At most `kMost` of each wait; older ones are not
/// compared.
///
/// @threads  Under the publisher's mutex.
class FollowedOutputs {
 public:
  static constexpr std::size_t kMost = 32;

  FollowedOutputs(const PublisherCore& publisher, OutputComparer& comparer)
      : publisher_(publisher), comparer_(comparer) {}
  FollowedOutputs(const FollowedOutputs&) = delete;
  FollowedOutputs& operator=(const FollowedOutputs&) = delete;
  ~FollowedOutputs();

  /// These take over a reference.
  void add_theirs(Envelope* envelope) noexcept { add(envelope, theirs_, own_, true); }
  void add_own(Envelope* envelope) noexcept { add(envelope, own_, theirs_, false); }
  /// The followed publisher's message of this sequence; null if it is not here. It is not removed.
  [[nodiscard]] const Envelope* find_theirs(std::uint64_t sequence) const noexcept;
  /// Whether it cannot arrive any more.
  [[nodiscard]] bool is_past(std::uint64_t sequence) const noexcept {
    return !theirs_.empty() && theirs_.back()->info.sequence > sequence;
  }
  /// Releases all that wait, or its own.
  void clear() noexcept;
  void clear_own() noexcept;

  bool is_following = true;  ///< Else it replaces the followed one.
  std::uint64_t made = 0;    ///< The sequence of its own last message.

 private:
  void add(Envelope* envelope, std::deque<Envelope*>& here, std::deque<Envelope*>& there,
           bool is_theirs) noexcept;

  const PublisherCore& publisher_;
  OutputComparer& comparer_;
  std::deque<Envelope*> theirs_;  ///< By sequence.
  std::deque<Envelope*> own_;
};

}  // namespace fastcycle::detail
