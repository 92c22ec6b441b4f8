#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/log.h"
#include "base/sleepers.h"
#include "base/thread.h"
#include "broker/publisher_core.h"
#include "component/component_host.h"
#include "config/description.h"
#include "config/problem.h"
#include "executor/simulation.h"
#include "loading/component_classes.h"
#include "record/recording_reader.h"
#include "replay/replay_plan.h"

namespace fastcycle::host {

/// Constructs the components of an application once, and returns their connections. Errors and
/// warnings go to `problems`.
using FindConnections =
    std::function<std::vector<Connection>(const config::ApplicationDescription& application,
                                          ComponentClasses& classes, config::Problems& problems)>;

/// Why a replay has ended.
enum class ReplayEnd : std::uint8_t {
  kOver,    ///< Everything was fed.
  kFailed,  ///< Reading the recording failed.
};

/// Publishes a recording again in an application, in place of the components that published it:
/// owns the files, and the messages that are next.
///
///     const auto replay = prepare_replay(options, description, libraries, problems);
///     Application application(replay->description(), clock);
///     application.replay(*replay);
///     application.build(*replay, problems, ConstructorFault::kFault);
///
/// The application's clock shows the times of the recording. In simulated time this feeds the
/// simulation: each message comes at its time, in its round. Live, a thread publishes each message
/// at its time, and another one reads ahead.
///
/// Messages keep sequence, publish time and origin. A component that does not run is replaced by a
/// stand-in of its name, which has only its publishers; so all names and ids are preserved.
///
/// @threads  Confined to the control thread; `next_due_ns`, `next_step` and `put` to that of the
///           simulation. Statistics are valid after `stop`.
class Replay final : public ComponentClasses, public detail::Feed {
 public:
  /// Opens the files, and decides which components run. `classes` provides the application's
  /// components; it has to outlive this. `find_connections` is called once, to find subscriptions.
  ///
  /// @errors  Errors and warnings go to `problems`; null after an error.
  static std::unique_ptr<Replay> prepare(ReplayOptions options,
                                         const config::ApplicationDescription& application,
                                         ComponentClasses& classes,
                                         const FindConnections& find_connections,
                                         config::Problems& problems);
  ~Replay() override;

  /// The application to run.
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }
  [[nodiscard]] const ReplayOptions& options() const { return options_; }
  [[nodiscard]] const ReplayPlan& plan() const { return plan_; }
  [[nodiscard]] const record::RecordingReader& recording() const { return *reader_; }

  /// The application's time at which it starts.
  [[nodiscard]] Time begin() const { return from_; }
  /// The application's time at which its timers start.
  [[nodiscard]] Time begin_of_timers() const;
  /// The application's time at which everything was fed; `Time::max()` if it is looped.
  [[nodiscard]] Time end() const { return options_.is_looped ? Time::max() : to_; }
  /// Length of one pass.
  [[nodiscard]] Duration length() const { return to_ - from_; }

  /// Time from the beginning of the recorded run to the application's time `now`.
  [[nodiscard]] Duration position(Time now) const;

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  // Called by the application.

  /// Declares the publishers of a component that is replaced.
  void declare(detail::ComponentCore& component);
  /// Adds to the facts of this run's log what it replays.
  void explain(std::map<std::string, std::string>& facts) const;
  /// Begins at `time` instead, with the latched messages from before. Before `start`.
  void skip_to(Time time) { from_ = std::clamp(time, from_, to_); }
  /// Before the first component starts. `clock` and `log` are the application's. `ended` is called
  /// after a failure, and live at the end; on the feeding thread.
  void start(const base::Clock& clock, detail::LogSource& log,
             std::function<void(ReplayEnd)> ended);
  /// Live only: starts feeding.
  void start_thread(std::vector<base::Refusal>& refusals);
  void stop();
  /// Safe.
  [[nodiscard]] bool is_stopping() const { return is_stopping_; }

  [[nodiscard]] std::int64_t next_due_ns() const noexcept override;
  [[nodiscard]] std::uint32_t next_step() const noexcept override;
  void put(Time now, std::uint32_t step) override;

  // Statistics.

  /// Number of messages fed, by stream.
  [[nodiscard]] const std::vector<std::uint64_t>& fed() const { return fed_; }
  /// Live: delay of the latest message.
  [[nodiscard]] Duration worst_lateness() const { return worst_lateness_; }

 private:
  Replay(ReplayOptions options, ComponentClasses& classes);

  bool open(config::Problems& problems);
  bool choose(const config::ApplicationDescription& application,
              const FindConnections& find_connections, config::Problems& problems);
  bool set_range(config::Problems& problems);
  bool are_of_one_time(config::Problems& problems) const;
  void warn_of_switches(config::Problems& problems) const;
  void make_prototypes();
  void rewind();
  void keep_latched();
  /// Reads the next moment.
  void load();
  [[nodiscard]] std::span<record::RecordedMessage> read_moment();
  void shift(record::RecordedMessage& message) const;
  [[nodiscard]] bool is_passed_over(const record::RecordedMessage& message) const;
  [[nodiscard]] detail::Envelope* make(const record::RecordedMessage& message);
  void publish(const record::RecordedMessage& message);
  void send(const record::RecordedMessage& message, detail::Envelope* loan);
  void fail(const std::string& what);
  void play_live();
  void play_on_time(const record::RecordedMessage& message);
  bool wait_until(Time time);

  // Constant once prepared.
  const ReplayOptions options_;
  ComponentClasses& classes_;
  std::unique_ptr<record::RecordingReader> reader_;
  ReplayPlan plan_;
  config::ApplicationDescription description_;
  std::vector<bool> wanted_;  ///< By stream.
  Time from_{};
  Time to_{};

  // Of the application; set by `start`.
  const base::Clock* clock_ = nullptr;
  detail::LogSource* log_ = nullptr;
  std::function<void(ReplayEnd)> ended_;

  /// By stream; null if it is not fed.
  std::vector<const google::protobuf::Message*> prototypes_;
  std::vector<detail::PublisherCore*> publishers_;
  std::vector<std::uint64_t> fed_;
  bool has_failed_ = false;

  // Next messages, beginning with those latched before the start.
  std::vector<record::RecordedMessage> latched_;
  std::span<record::RecordedMessage> moment_;
  std::size_t next_ = 0;
  Duration loop_shift_{0};
  std::vector<std::uint64_t> loop_sequences_;  ///< By stream: offset from earlier loops.
  std::vector<std::uint64_t> last_sequences_;  ///< By stream: of the last message fed.

  // Live.
  std::atomic<bool> is_stopping_{false};
  base::Sleepers sleepers_;
  std::int64_t thread_began_ns_ = 0;
  Duration worst_lateness_{0};
  base::Thread thread_;
  bool has_thread_ = false;
};

}  // namespace fastcycle::host
