#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "base/log.h"
#include "config/description.h"
#include "fastcycle/component.h"
#include "fastcycle/library.h"
#include "host/observer.h"
#include "status/log_line.pb.h"

namespace fastcycle::detail {
class ComponentCore;
}  // namespace fastcycle::detail

namespace fastcycle::host {

class ApplicationHost;
class LogFeed;

/// Publishes the lines of the log on `fastcycle/log`, one a message, at most `kMostLines` in each
/// tenth of a second of the application's time; the others are counted.
///
/// It is the application's last component, created only if there is a subscriber.
///
/// @threads  As a component.
class LogComponent final : public Component {
 public:
  static constexpr std::size_t kMostLines = 100;

  explicit LogComponent(Context& context);

  /// Sets the source of its lines; before it starts.
  void set_feed(LogFeed& feed) noexcept { feed_ = &feed; }
  /// Publishes lines written while the others started.
  void start() override { publish(); }
  /// In its activation: publishes the lines of the feed.
  void publish();

 private:
  LogFeed* feed_ = nullptr;
  Publisher<status::LogLine> lines_;
  Time window_begin_{};
  std::size_t count_ = 0;  ///< Published since then.
  std::uint64_t lost_ = 0;
};

/// Passes lines of the log to the component that publishes them: owns the queued lines.
///
/// Live it takes lines from the printing thread, so writers do not wait. In simulated time it takes
/// them at the end of a round, component by component in the order of the file, so that they are
/// the same for any number of workers; they are published in the next round.
///
/// @threads  As `Observer`.
class LogFeed final : public Observer {
 public:
  LogFeed(ApplicationHost& application, detail::ComponentCore& core);

  /// Takes the waiting lines; in the component's activation.
  [[nodiscard]] detail::LogSource::AllKept take();

  void start(const ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void round_ended(std::uint32_t step) override;
  void stop(const Application& application) override;

 private:
  void add(detail::LogSource::Kept line);
  /// Requests the component to take the waiting lines, if it has started.
  void ask();

  ApplicationHost& application_;
  detail::ComponentCore& core_;

  std::mutex mutex_;
  detail::LogSource::AllKept waiting_;
  bool is_asked_ = false;
};

/// How `LogComponent` is added to an application, as `describe_status`.
[[nodiscard]] config::ComponentDescription describe_log(
    const config::ApplicationDescription& application);
[[nodiscard]] const ComponentClass& log_class();

}  // namespace fastcycle::host
