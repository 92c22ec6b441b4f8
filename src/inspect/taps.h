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

/// Who is given what a tap took.
///
/// @threads  The server's.
class TapUser {
 public:
  TapUser() = default;
  TapUser(const TapUser&) = delete;
  TapUser& operator=(const TapUser&) = delete;
  virtual ~TapUser() = default;

  /// One message; its envelope is the tap's, and only good during the call.
  virtual void take(const detail::PublisherCore& publisher, const detail::Envelope& envelope) = 0;
};

/// One topic, received once for all who look at it.
///
/// Connected to publishers that run, beside what they do: they pay for one more queue and wake
/// nobody. Messages whose size nobody knows begin with a short queue; it becomes as long as they
/// are small.
///
/// @threads  Confined to the server's thread, as are all its members.
class Tap {
 public:
  Tap(host::Application& application, detail::Topic& topic);
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;
  ~Tap();

  /// How many messages of `bytes` each may wait: 16 MB, at least 4. Fewer if nobody wants each.
  [[nodiscard]] static std::size_t depth_for(std::uint64_t bytes, bool wants_each) noexcept;

  /// `user` is given what is published from now on, and what a latched topic has kept. With
  /// `wants_each` more of large messages may wait.
  void add(TapUser& user, bool wants_each);
  void remove(TapUser& user) noexcept;
  [[nodiscard]] bool is_used() const noexcept { return !users_.empty(); }

  /// Gives what came to all users.
  void take();
  /// Leaves the publishers; what still comes is let go.
  void leave();
  /// Whether nobody can reach it any more.
  [[nodiscard]] bool has_left() const noexcept;
  /// The same at once, when nothing runs any more.
  void cut();

  /// Of the last message that was looked at, in memory; 0 before.
  [[nodiscard]] std::uint64_t message_bytes() const noexcept { return message_bytes_; }
  /// When the last message that was looked at was published, and the one before it; the epoch:
  /// never.
  [[nodiscard]] Time newest() const noexcept { return newest_; }
  [[nodiscard]] Time before_newest() const noexcept { return before_newest_; }

  detail::Topic& topic;

 private:
  /// A subscription and its lanes, one for each publisher. What they point to each other stays.
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
  std::deque<std::shared_ptr<Reception>> receptions_;  ///< The last one is the present one.
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

  /// Makes room at all publishers for one tap, so that none of them allocates when one comes.
  void provide();

  /// The tap of `topic`, made if it is new.
  Tap& get(detail::Topic& topic);
  /// Gives what came; ends taps without users.
  void look();
  [[nodiscard]] bool is_used() const noexcept { return !taps_.empty(); }
  /// From `now` to the next look, about `period`: see `pause.h`, for the topic published last.
  [[nodiscard]] std::chrono::nanoseconds wait_for_pause(Time now,
                                                        std::chrono::nanoseconds period) const;
  /// What was seen of the size of messages of `topic`, in memory; 0: nothing.
  [[nodiscard]] std::uint64_t message_bytes(const detail::Topic& topic) const;

  /// Ends all of them, when nothing runs any more.
  void cut();

 private:
  host::Application& application_;
  std::map<const detail::Topic*, std::unique_ptr<Tap>> taps_;
  std::vector<std::unique_ptr<Tap>> leaving_;
  std::map<const detail::Topic*, std::uint64_t> bytes_;
};

}  // namespace fastcycle::inspect
