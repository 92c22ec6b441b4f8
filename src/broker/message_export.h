#pragma once

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
