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

/// Constructs the components of an application once, and says how they are connected. Mistakes and
/// warnings go to `problems`.
using FindConnections =
    std::function<std::vector<Connection>(const config::ApplicationDescription& application,
                                          ComponentClasses& classes, config::Problems& problems)>;

/// Why a replay has no more to feed.
enum class ReplayEnd : std::uint8_t {
  kOver,    ///< All has come.
  kFailed,  ///< The recording cannot be read on.
};

/// What a recording has, published again in an application, in the place of the components that
/// published it: owns the files, and what is next in them.
///
///     const auto replay = prepare_replay(options, description, libraries, problems);
///     Application application(replay->description(), clock);
///     application.replay(*replay);
///     application.build(*replay, problems, ConstructorFault::kFault);
///
/// The application's clock shows the times of the recording. In simulated time this is a feed of
/// the simulation: each message comes at its time, in its round. Live, a thread publishes each
/// message when its time has come, and another one reads ahead.
///
/// Messages keep sequence, publish time and origin. Where a component does not run, another one of
/// its name stands, which has its publishers and nothing else; so all names and ids are as they
/// were.
///
/// @threads  Confined to the control thread; `next_due_ns`, `next_step` and `put` to that of the
///           simulation. What was fed is told after `stop`.
class Replay final : public ComponentClasses, public detail::Feed {
 public:
  /// Opens the files, and decides who runs. `classes` knows the application's components; it has to
  /// live as long as this. `find_connections` is called once, to see what components subscribe to.
  ///
  /// @errors  Mistakes and warnings go to `problems`; null after a mistake.
  static std::unique_ptr<Replay> prepare(ReplayOptions options,
                                         const config::ApplicationDescription& application,
                                         ComponentClasses& classes,
                                         const FindConnections& find_connections,
                                         config::Problems& problems);
  ~Replay() override;

  /// The application as it is run.
  [[nodiscard]] const config::ApplicationDescription& description() const { return description_; }
  [[nodiscard]] const ReplayOptions& options() const { return options_; }
  [[nodiscard]] const ReplayPlan& plan() const { return plan_; }
  [[nodiscard]] const record::RecordingReader& recording() const { return *reader_; }

  /// The application's time at which it starts.
  [[nodiscard]] Time begin() const { return from_; }
  /// The application's time at which its timers start.
  [[nodiscard]] Time begin_of_timers() const;
  /// The application's time at which all has come; `Time::max()` if it is looped.
  [[nodiscard]] Time end() const { return options_.is_looped ? Time::max() : to_; }
  /// From its beginning to its end, once.
  [[nodiscard]] Duration length() const { return to_ - from_; }

  /// How far behind the beginning of the recorded run the application's time `now` lies.
  [[nodiscard]] Duration position(Time now) const;

  const ComponentClass* find(const config::ComponentDescription& component,
                             config::Problems& problems) override;

  // What the application asks of it.

  /// Declares the publishers of a component that this stands in for.
  void declare(detail::ComponentCore& component);
  /// Says in a log of this run what it repeats.
  void explain(std::map<std::string, std::string>& facts) const;
  /// Begins at `time` instead, with the latched messages of before. Before `start`.
  void skip_to(Time time) { from_ = std::clamp(time, from_, to_); }
  /// Before the first component starts. `clock` and `log` are the application's. `ended` is called
  /// after a failure, and live when all has come; on the thread that feeds.
  void start(const base::Clock& clock, detail::LogSource& log,
             std::function<void(ReplayEnd)> ended);
  /// Live only: from now on messages come.
  void start_thread(std::vector<base::Refusal>& refusals);
  void stop();
  /// Safe.
  [[nodiscard]] bool is_stopping() const { return is_stopping_; }

  [[nodiscard]] std::int64_t next_due_ns() const noexcept override;
  [[nodiscard]] std::uint32_t next_step() const noexcept override;
  void put(Time now, std::uint32_t step) override;

  // What there is to say of it afterwards.

  /// How many messages of each stream were fed.
  [[nodiscard]] const std::vector<std::uint64_t>& fed() const { return fed_; }
  /// Live: how much later than it should the latest message came.
  [[nodiscard]] Duration worst_lateness() const { return worst_lateness_; }

 private:
  Replay(ReplayOptions options, ComponentClasses& classes);

  bool open(config::Problems& problems);
  bool choose(const config::ApplicationDescription& application,
              const FindConnections& find_connections, config::Problems& problems);
  bool set_range(config::Problems& problems);
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

  // The application's; from the start on.
  const base::Clock* clock_ = nullptr;
  detail::LogSource* log_ = nullptr;
  std::function<void(ReplayEnd)> ended_;

  /// By stream; null where nothing is fed.
  std::vector<const google::protobuf::Message*> prototypes_;
  std::vector<detail::PublisherCore*> publishers_;
  std::vector<std::uint64_t> fed_;
  bool has_failed_ = false;

  // What comes next. With what was latched before the beginning it starts.
  std::vector<record::RecordedMessage> latched_;
  std::span<record::RecordedMessage> moment_;
  std::size_t next_ = 0;
  Duration loop_shift_{0};
  std::vector<std::uint64_t> loop_sequences_;  ///< By stream: what was added in earlier loops.
  std::vector<std::uint64_t> last_sequences_;  ///< By stream: of what was fed last.

  // Live.
  std::atomic<bool> is_stopping_{false};
  base::Sleepers sleepers_;
  std::int64_t thread_began_ns_ = 0;
  Duration worst_lateness_{0};
  base::Thread thread_;
  bool has_thread_ = false;
};

}  // namespace fastcycle::host
