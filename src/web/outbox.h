#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fastcycle::web {

/// A message, shared by all clients.
struct SharedMessage {
  std::int64_t time_ns = 0;  ///< When it was published.
  std::string payload;       ///< Serialized.
};

/// One frame of a WebSocket.
struct Frame {
  bool is_text = false;
  std::string head;                              ///< The header before the message.
  std::shared_ptr<const SharedMessage> message;  ///< May be null.

  [[nodiscard]] std::size_t size() const {
    return head.size() + (message == nullptr ? 0 : message->payload.size());
  }
  /// The WebSocket header: RFC 6455, 5.2, from the server, unfragmented.
  [[nodiscard]] std::string wire_head() const;
};

/// The output queue of one client: bounded, and fair between its subscriptions.
///
/// Control frames go first, in order. Messages go round-robin over the subscriptions. Of a
/// subscription with large messages only the newest is kept. Beyond the limit, the subscription
/// with the most waiting bytes loses its oldest message; the last message of a subscription is kept
/// up to four times the limit.
///
/// @threads  Confined.
class Outbox {
 public:
  struct Options {
    std::size_t bytes = std::size_t{8} << 20U;          ///< Limit of waiting messages.
    std::size_t large_bytes = std::size_t{128} << 10U;  ///< A message of this size is large.
    std::size_t control_bytes = std::size_t{4} << 20U;  ///< Limit of waiting control frames.
  };

  /// Messages that a client lost.
  struct Loss {
    std::uint32_t subscription = 0;
    std::uint64_t count = 0;
  };

  explicit Outbox(Options options) : options_(options) {}

  void add(std::uint32_t subscription) { lanes_[subscription]; }
  void remove(std::uint32_t subscription);
  [[nodiscard]] bool has(std::uint32_t subscription) const { return lanes_.contains(subscription); }

  void put_text(std::string text) {
    put({.is_text = true, .head = std::move(text), .message = {}});
  }
  void put_binary(std::string bytes) {
    put({.is_text = false, .head = std::move(bytes), .message = {}});
  }
  [[nodiscard]] bool has_control() const { return !control_.empty(); }
  /// Whether control frames exceed their limit: the client is to be dropped.
  [[nodiscard]] bool is_overrun() const { return control_waiting_ > options_.control_bytes; }

  /// Ignored without that subscription.
  void put(std::uint32_t subscription, std::shared_ptr<const SharedMessage> message);

  /// Discards waiting messages as obsolete; they do not count as lost.
  void forget_messages();

  /// The next frame; that of a message has the protocol's header.
  [[nodiscard]] std::optional<Frame> take();

  /// Messages that were dropped since the last call.
  [[nodiscard]] std::vector<Loss> take_losses();

  /// Waiting bytes.
  [[nodiscard]] std::size_t waiting() const { return waiting_ + control_waiting_; }

 private:
  struct Lane {
    std::deque<std::shared_ptr<const SharedMessage>> messages;
    std::size_t waiting = 0;
    std::uint64_t lost = 0;
  };

  void put(Frame frame);
  void drop_oldest(Lane& lane);
  /// The lane with the most waiting bytes of those with at least `count` messages; null if there is
  /// none.
  [[nodiscard]] Lane* largest(std::size_t count);

  const Options options_;
  std::deque<Frame> control_;
  std::size_t control_waiting_ = 0;
  std::map<std::uint32_t, Lane> lanes_;
  std::uint32_t last_ = 0;  ///< The subscription served last.
  std::size_t waiting_ = 0;
};

}  // namespace fastcycle::web
