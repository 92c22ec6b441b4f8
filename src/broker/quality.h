#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "broker/lane.h"
#include "fastcycle/qos.h"
#include "fastcycle/subscriber.h"

namespace fastcycle::detail {

struct PublishingComponent;
class TimerCore;
class Topic;

/// A timeout: causes an event if something did not happen in time.
///
/// @threads  Confined to its component's activations, and to the control thread before the start.
class Watch {
 public:
  Watch() = default;
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  virtual ~Watch() = default;

  /// Watches from `now_ns` on, as if a message had arrived then.
  virtual void begin(std::int64_t now_ns) noexcept = 0;
  /// The next event to report at `now_ns`; none if there is none.
  [[nodiscard]] virtual std::optional<QosEvent> look(std::int64_t now_ns) noexcept = 0;
  /// When to look next; `base::kNever` if nothing is watched.
  [[nodiscard]] virtual std::int64_t next_look_ns() const noexcept = 0;

  /// Shared with its caller, since a callback may replace itself.
  [[nodiscard]] const std::shared_ptr<const QosCallback>& callback() const noexcept {
    return callback_;
  }
  void set_callback(const QosCallback& callback);

  /// Its number within the component: that of a subscription, or `kOffered` and that of a publisher
  /// which offers a deadline.
  std::uint32_t place = 0;
  static constexpr std::uint32_t kOffered = std::uint32_t{1} << 31U;
  /// Records `event` among the reads of the present activation of `component`.
  void keep(const PublishingComponent& component, const QosEvent& event) const noexcept;
  /// Whether it has a callback. Safe.
  [[nodiscard]] bool has_callback() const noexcept { return has_callback_.load(); }

 private:
  std::shared_ptr<const QosCallback> callback_;
  std::atomic<bool> has_callback_{false};
};

/// An event in its log format; `read` parses it into strings that refer to `text`.
///
///     2 17 1700000000123456789\nsilent\nlidar_driver
struct WrittenEvent {
  [[nodiscard]] static std::string write(const QosEvent& event);
  [[nodiscard]] static std::optional<QosEvent> read(std::string_view text, std::string_view topic);
};

/// Counts the whole periods that pass without a message.
///
/// A period ends after its last nanosecond: a publisher with exactly that period misses none.
class Deadline {
 public:
  void set_period(std::optional<Duration> period) noexcept;
  [[nodiscard]] std::optional<Duration> period() const noexcept { return period_; }
  [[nodiscard]] std::int64_t last_ns() const noexcept { return last_ns_; }

  void begin(std::int64_t now_ns) noexcept;
  /// How many more periods have passed at `now_ns`, if the newest message is of `newest_ns`.
  std::uint64_t look(std::int64_t newest_ns, std::int64_t now_ns) noexcept;
  [[nodiscard]] std::int64_t next_look_ns() const noexcept;

 private:
  std::optional<Duration> period_;
  std::int64_t last_ns_ = 0;
  std::uint64_t missed_in_a_row_ = 0;
};

/// The quality of service that a subscription requests beyond depth and overflow, and its state.
///
/// A deadline and a lease cost nothing on the hot path: when they are checked, the lanes still have
/// the time of their newest message. Lanes whose messages must be checked one by one are marked as
/// such.
class Quality final : public Watch {
 public:
  /// What to do with the next message.
  enum class Verdict : std::uint8_t {
    kDeliver,
    kReport,   ///< Report the event first; then judge again.
    kExpired,  ///< It is dropped, and the event reported.
  };

  Quality(const Topic& topic, const SubscriberOptions& options);

  /// Whether a subscription to `topic` with `options` has a quality of service at all.
  [[nodiscard]] static bool is_asked_for(const Topic& topic,
                                         const SubscriberOptions& options) noexcept;

  /// Applies `options`; the counters continue.
  void set(const SubscriberOptions& options);

  /// Adds a lane of the subscription, and the component that publishes into it; `end` removes them
  /// all, and ends the watch.
  void add(std::shared_ptr<const Lane> lane, std::string_view component);
  void end() noexcept;

  void begin(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::optional<QosEvent> look(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t next_look_ns() const noexcept override;

  /// Whether it needs a timer.
  [[nodiscard]] bool is_timed() const noexcept {
    return deadline_.period().has_value() || lease_.has_value();
  }
  /// Whether its messages must be checked one by one.
  [[nodiscard]] bool is_judging() const noexcept {
    return lifespan_.has_value() || lease_.has_value() || has_callback();
  }
  [[nodiscard]] Verdict judge(const Lane& lane, const Lane::Head& head, std::int64_t now_ns,
                              QosEvent& event) noexcept;
  /// The message that was judged last was taken.
  void took(const Lane& lane, const Lane::Head& head) noexcept;
  /// Messages not received until now do not count as missing: the component was not active.
  void forget_gaps() noexcept;
  [[nodiscard]] bool is_expired(std::int64_t published_ns, std::int64_t now_ns) const noexcept;

  /// The component of `publisher` has ended, or is back; returns the event to report.
  [[nodiscard]] std::optional<QosEvent> on_liveliness(PublisherId publisher, bool is_alive,
                                                      std::string_view reason,
                                                      std::int64_t now_ns) noexcept;

  [[nodiscard]] std::optional<Duration> deadline() const noexcept { return deadline_.period(); }
  [[nodiscard]] std::optional<Duration> lifespan() const noexcept { return lifespan_; }

  TimerCore* timer = nullptr;  ///< The timer that checks it; the receiving component's.

  // Written by the receiving component's worker.
  Counter expired;
  Counter deadlines_missed;
  Counter liveliness_lost;
  Counter liveliness_gained;
  Counter messages_lost;

 private:
  /// A subscriber's view of one publisher.
  struct Source {
    std::shared_ptr<const Lane> lane;
    std::string_view component;
    std::uint64_t sequence = 0;  ///< Of the last received message.
    bool is_lost = false;
    std::int64_t lost_ns = 0;   ///< A message published after this shows that it is back.
    std::int64_t alive_ns = 0;  ///< When something else than a message showed that it is back.
  };

  [[nodiscard]] Source* find(const Lane& lane) noexcept;
  [[nodiscard]] std::int64_t newest_ns(std::int64_t now_ns) noexcept;
  [[nodiscard]] std::int64_t last_alive_ns(const Source& source) const noexcept;
  [[nodiscard]] QosEvent lose(Source& source, std::string_view reason, std::int64_t lost_ns,
                              std::int64_t since_ns) noexcept;
  [[nodiscard]] QosEvent gain(Source& source, std::string_view reason,
                              std::int64_t since_ns) noexcept;

  const Topic& topic_;
  Deadline deadline_;
  std::optional<Duration> lifespan_;
  std::optional<Duration> lease_;
  std::vector<Source> sources_;
  std::int64_t begin_ns_ = 0;
  std::uint64_t refused_ = 0;  ///< Messages that full queues had refused at the last check.
};

}  // namespace fastcycle::detail
