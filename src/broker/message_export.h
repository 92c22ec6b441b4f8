#pragma once

#include <cstddef>
#include <cstdint>

#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

/// Forwards the messages of one publisher to another process, besides the lanes.
///
/// @threads  As the publisher.
/// @realtime As `publish` is.
class MessageExport {
 public:
  MessageExport() = default;
  MessageExport(const MessageExport&) = delete;
  MessageExport& operator=(const MessageExport&) = delete;
  virtual ~MessageExport() = default;

  /// Hands over a message that was numbered, and takes one reference to it, which it releases when
  /// the message was returned, or at once if it is not sent.
  virtual void put(Envelope& envelope) noexcept = 0;
  /// Releases returned messages.
  virtual void collect() noexcept = 0;
  /// Makes `message` and all its parts readable for other processes; if that is impossible, returns
  /// a copy that replaces it. The thread is in a scope of shared memory.
  [[nodiscard]] virtual google::protobuf::Message* share(
      google::protobuf::Message* message) noexcept = 0;
  /// How many messages may be in transit, and held, there.
  [[nodiscard]] virtual std::size_t capacity() const noexcept = 0;

  /// Whether the receivers there return credits.
  [[nodiscard]] virtual bool returns_credits() const noexcept { return false; }
  /// Messages that the slowest of them has not finished. Safe.
  [[nodiscard]] virtual std::uint64_t unfinished() const noexcept { return 0; }
  /// Whether they notify this process of each returned credit. Safe.
  virtual void set_awaited(bool) noexcept {}
};

/// Receives the released envelopes of a pool without messages: their creator.
///
/// @threads  Safe.
class ReturnSink {
 public:
  ReturnSink() = default;
  ReturnSink(const ReturnSink&) = delete;
  ReturnSink& operator=(const ReturnSink&) = delete;
  virtual ~ReturnSink() = default;

  virtual void came_back(Envelope& envelope) noexcept = 0;
};

}  // namespace fastcycle::detail
