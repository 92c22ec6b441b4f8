#pragma once

#include "fastcycle/detail/envelope.h"

namespace fastcycle::detail {

/// Where messages of one publisher go besides the lanes: to another process.
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
  /// the message has come back, or at once if it goes nowhere.
  virtual void put(Envelope& envelope) noexcept = 0;
  /// Releases what has come back.
  virtual void collect() noexcept = 0;
  /// Makes `message` readable for other processes, all that it consists of included; copies into a
  /// new one, which it returns and which takes its place, where it cannot be. The thread is in a
  /// scope of shared memory.
  [[nodiscard]] virtual google::protobuf::Message* share(
      google::protobuf::Message* message) noexcept = 0;
  /// How many messages may be on their way, and held, there.
  [[nodiscard]] virtual std::size_t capacity() const noexcept = 0;
};

/// Where envelopes of a pool without messages go when they are released: to who made them.
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
