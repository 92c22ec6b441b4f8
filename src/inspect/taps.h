#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "broker/inbox.h"
#include "broker/topics.h"
#include "host/application.h"

namespace fastcycle::inspect {

/// Receives the messages of a tap.
///
/// @threads  The server's.
class TapUser {
 public:
  TapUser() = default;
  TapUser(const TapUser&) = delete;
  TapUser& operator=(const TapUser&) = delete;
  virtual ~TapUser() = default;

  /// One message; the envelope belongs to the tap and is valid only during the call.
  virtual void take(const detail::PublisherCore& publisher, const detail::Envelope& envelope) = 0;
};

/// One topic, received once for all its users.
///
/// Connected to running publishers, in addition to their own subscribers: costs them one more queue
/// and wakes no thread. While the size of messages is unknown the queue is short; it grows if they
/// are small.
///
/// @threads  Confined to the server's thread, as are all its members.
class Tap {
 public:
  Tap(host::Application& application, detail::Topic& topic);
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;
  ~Tap();

  /// Queue depth for messages of `bytes` each: 16 MB, at least 4. Fewer without `wants_each`.
  [[nodiscard]] static std::size_t depth_for(std::uint64_t bytes, bool wants_each) noexcept;

  /// `user` receives what is published from now on, and what a latched topic has kept. With
  /// `wants_each` the queue for large messages is longer.
  void add(TapUser& user, bool wants_each);
  void remove(TapUser& user) noexcept;
  [[nodiscard]] bool is_used() const noexcept { return !users_.empty(); }

  /// Passes received messages to all users.
  void take();
  /// Disconnects from the publishers; messages that still arrive are discarded.
  void leave();
  /// Whether no publisher references it any more.
  [[nodiscard]] bool has_left() const noexcept;
  /// The same immediately, once nothing runs any more.
  void cut();

  /// Size in memory of the last message read; 0 before.
  [[nodiscard]] std::uint64_t message_bytes() const noexcept { return message_bytes_; }
  /// Publish time of the last message read, and of the one before it; the epoch: none.
  [[nodiscard]] Time newest() const noexcept { return newest_; }
  [[nodiscard]] Time before_newest() const noexcept { return before_newest_; }

  detail::Topic& topic;

 private:
  /// A subscription and its lanes, one per publisher. The addresses they reference are stable.
  struct Reception;

  struct User {
    TapUser* user;
    bool wants_each;
  };
  struct Kept {
    const detail::PublisherCore* publisher;
    detail::Envelope* envelope;
  };

  void receive(std::size_t depth);
  void take_from(Reception& reception);
  void hand(const detail::PublisherCore& publisher, detail::Envelope& envelope);
  void keep(const detail::PublisherCore& publisher, detail::Envelope& envelope);
  void forget();
  void look_for_depth();

  host::Application& application_;
  std::vector<User> users_;
  std::deque<std::shared_ptr<Reception>> receptions_;  ///< The last one is current.
  std::deque<Kept> kept_;                              ///< Of a latched topic.
  std::uint64_t message_bytes_ = 0;
  std::size_t depth_ = 0;
  Time newest_;
  Time before_newest_;
};

/// The taps of one application: at most one for each topic.
///
/// @threads  Confined to the server's thread; `provide` and `cut` to the control thread.
class Taps {
 public:
  explicit Taps(host::Application& application) : application_(application) {}

  /// Reserves a slot for one tap at all publishers, so that none of them allocates when one
  /// connects.
  void provide();

  /// The tap of `topic`; created if it does not exist.
  Tap& get(detail::Topic& topic);
  /// Passes on received messages; removes taps without users.
  void look();
  [[nodiscard]] bool is_used() const noexcept { return !taps_.empty(); }
  /// Time from `now` to the next poll, about `period`: see `pause.h`, for the topic published last.
  [[nodiscard]] std::chrono::nanoseconds wait_for_pause(Time now,
                                                        std::chrono::nanoseconds period) const;
  /// Observed size of messages of `topic`, in memory; 0: unknown.
  [[nodiscard]] std::uint64_t message_bytes(const detail::Topic& topic) const;

  /// Removes all taps, once nothing runs any more.
  void cut();

 private:
  host::Application& application_;
  std::map<const detail::Topic*, std::unique_ptr<Tap>> taps_;
  std::vector<std::unique_ptr<Tap>> leaving_;
  std::map<const detail::Topic*, std::uint64_t> bytes_;
};

}  // namespace fastcycle::inspect
