#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/clock.h"
#include "component/application_host.h"
#include "component/component_core.h"
#include "record/recorded_schedule.h"
#include "record/recording_reader.h"
#include "record/serializer.h"
#include "replay/output_listener.h"
#include "replay/recorded_driver.h"

namespace fastcycle::host {

/// Options for executing a recorded run again.
struct ExactReplayOptions {
  std::vector<std::filesystem::path> files = {};
  /// The components to execute, in addition to those that published unrecorded inputs of theirs.
  /// Empty: all whose inputs are recorded.
  std::vector<std::string> components = {};
  unsigned workers = 1;
  /// Which message of another executed component a component receives: the recorded or the new one.
  enum class Input : std::uint8_t { kRecorded, kNew };
  Input input = Input::kRecorded;
  /// Start, relative to the beginning of the run: each component at its last key frame before, one
  /// without key frames at the beginning of the log.
  std::optional<Duration> start = {};
};

/// The first output of a component that differs from the recording.
struct OutputDifference {
  std::uint64_t activation = 0;
  std::string cause = {};    ///< Of the activation, in words.
  std::int64_t time_ns = 0;  ///< Of the activation, since the run began.
  std::string topic = {};    ///< Empty if no single message is concerned.
  std::uint64_t sequence = 0;
  std::string field = {};
  std::string recorded = {};
  std::string now = {};
};

/// Result for one component.
struct ExactReplayResult {
  std::string component = {};
  bool is_component = true;  ///< Of the application; else its messages come from the log.
  bool is_executed = false;
  bool is_source = false;      ///< Executed since another one needs its unrecorded messages.
  std::string why = {};        ///< Why it was not, or not completely, executed; else empty.
  std::uint64_t recorded = 0;  ///< Activations in the log.
  /// The activation after which it began, at a key frame of its state; 0: it began at the first.
  std::uint64_t began_after = 0;
  std::int64_t began_ns = 0;      ///< When that was, since the run began.
  std::uint64_t activations = 0;  ///< Of these, executed.
  std::uint64_t outputs = 0;      ///< Compared.
  std::uint64_t equal = 0;
  std::uint64_t not_recorded = 0;  ///< Published, but not in the log.
  std::uint64_t differences = 0;   ///< Outputs and activations that differ from the recording.
  std::optional<OutputDifference> first_difference = {};

  [[nodiscard]] bool is_equal() const noexcept { return differences == 0; }
};

/// Executes the recorded activations of components again, each component in its own order, and
/// compares what they publish with what was recorded, byte by byte.
///
/// A component is an actor: its behavior follows from its construction, its parameters, and the
/// sequence of its activations with what each of them read. The log has that sequence. An
/// activation may be executed when the previous one has finished and its messages exist; so
/// components are ordered only by their messages, and any number of workers gives the same result.
///
///     ExactReplay replay(application, driver, schedule, options);
///     replay.run([](const ExactReplay::Progress& progress) { … });
///     for (const ExactReplayResult& result : replay.results()) { … }
///
/// Memory: the schedule, and the messages between the slowest and the fastest component.
///
/// @threads  Confined to the control thread, which waits in `run` for the workers.
class ExactReplay {
 public:
  /// The application is built, and was never started. All arguments must outlive this.
  ///
  /// @errors  Errors go to `problems`: components that do not exist, nothing to execute, an
  ///          incomplete log.
  ExactReplay(ApplicationHost& application, RecordedDriver& driver,
              const record::RecordedSchedule& schedule, ExactReplayOptions options,
              config::Problems& problems);
  ExactReplay(const ExactReplay&) = delete;
  ExactReplay& operator=(const ExactReplay&) = delete;
  ~ExactReplay();

  struct Progress {
    std::uint64_t done = 0;
    std::uint64_t total = 0;
  };
  /// Called regularly on the thread of `run`. False ends the run early.
  using Watcher = std::function<bool(const Progress& progress)>;

  /// @errors  `mcap::Error` if reading the recording fails.
  void run(const Watcher& watcher);

  /// When the recorded run began, ns since 1970.
  [[nodiscard]] std::int64_t begin_ns() const { return base::to_ns(reader_.begin()); }

  /// By component, in the order of the application file; includes those not executed.
  [[nodiscard]] std::vector<ExactReplayResult> results() const;

  /// Receives all messages of the executed components; null: none.
  OutputListener* listener = nullptr;

  /// Called before each activation, by the worker that executes it.
  std::function<void(const detail::ComponentCore& component, std::uint64_t activation)>
      before_activation;

 private:
  struct Key {
    PublisherId publisher = 0;
    std::uint64_t sequence = 0;
    bool operator==(const Key&) const = default;
  };
  struct HashOfKey {
    std::size_t operator()(const Key& key) const noexcept {
      return static_cast<std::size_t>(key.publisher ^ (key.sequence * 0x9e3779b97f4a7c15ULL));
    }
  };

  /// Origin of an output.
  struct Source {
    std::uint64_t activation = 0;
    std::string cause;
    std::int64_t time_ns = 0;
  };
  struct Produced {
    Source source;
    std::string bytes;
  };
  /// State of one message.
  struct Entry {
    std::uint32_t uses = 0;  ///< By pending activations.
    detail::Envelope* envelope = nullptr;
    /// A new message that is passed on once the recording gives its publish time.
    detail::Envelope* unstamped = nullptr;
    std::optional<MessageInfo> info = {};  ///< As recorded, for `unstamped`.
    /// For a message not in the log: its publish time as its receivers saw it.
    std::optional<Time> published = {};
    bool is_recorded = false;  ///< `recorded` waits for comparison.
    std::string recorded = {};
    std::optional<Produced> produced = {};  ///< The new message, waiting for the recorded one.
  };

  class Outputs;
  struct Player;
  class StorePool;

  [[nodiscard]] Player* find_player(const std::string& component);
  [[nodiscard]] detail::PublisherCore* publisher(PublisherId id) const;
  [[nodiscard]] bool comes_from_log(PublisherId id) const;
  void choose(config::Problems& problems);
  [[nodiscard]] std::string why_not(const Player& player) const;
  /// Adds the components that published unrecorded inputs.
  void add_sources();
  void note_publish_times(const record::RecordedActivation& activation);
  /// Chooses key frames to begin at, if requested or needed.
  void choose_frames();
  [[nodiscard]] static std::string find_gap(const record::RecordedSchedule::Component& recorded,
                                            std::size_t first);
  void count_uses();
  [[nodiscard]] static std::vector<Key> inputs_of(const record::RecordedActivation& activation);
  /// The inputs of the next step of `player`: of an activation, or of a key frame.
  [[nodiscard]] static std::vector<Key> inputs_of(const Player& player);
  [[nodiscard]] bool comes_from_log(const Key& key) const;

  void work(unsigned worker);
  bool execute_next(std::unique_lock<std::mutex>& lock);
  [[nodiscard]] Player* next_ready();
  [[nodiscard]] bool load();
  static void stamp(Entry& entry);
  void take(record::RecordedMessage& message);
  [[nodiscard]] detail::Envelope* parse(PublisherId id, const record::RecordedMessage& message);
  void give_up(Player& player, std::string why);
  void end_waiting();

  void begin_at(Player& player, const record::RecordedActivation& frame);
  void execute(Player& player, const record::RecordedActivation& activation);
  void call(Player& player, const record::RecordedActivation& activation);
  void call_lifecycle(Player& player, const record::RecordedActivation& activation);
  void note_params(Player& player, const record::RecordedActivation& activation,
                   const std::string& recorded, const config::Problems& problems);
  void call_params(Player& player, const record::RecordedActivation& activation);
  void call_message(Player& player, const record::RecordedActivation& activation);
  void call_fault_of_thread(Player& player, const record::RecordedActivation& activation);
  void call_posted(Player& player, const record::RecordedActivation& activation, const char* what);
  void show_views(Player& player, const record::RecordedActivation& activation,
                  detail::ReadKind kind);
  [[nodiscard]] detail::Envelope* envelope_of(const Key& key);
  void check_end(Player& player, const record::RecordedActivation& activation);
  static void note(Player& player, Source source, OutputDifference difference);
  void finish(Player& player, const record::RecordedActivation& activation);
  void compare(Player& player, const Source& source, const detail::PublisherCore& publisher,
               std::uint64_t sequence, const std::string& recorded, const std::string& now);
  void differ(Player& player, const Source& source, OutputDifference difference);
  [[nodiscard]] std::string cause_in_words(const Player& player,
                                           const record::RecordedActivation& activation) const;

  ApplicationHost& application_;
  RecordedDriver& driver_;
  const record::RecordedSchedule& schedule_;
  const ExactReplayOptions options_;
  record::RecordingReader reader_;
  std::vector<std::unique_ptr<Player>> players_;  ///< One a component, in the order of the file.
  std::map<PublisherId, detail::PublisherCore*> publishers_;
  std::map<PublisherId, Player*> producers_;  ///< Of publishers whose component is executed.
  std::set<PublisherId> recorded_publishers_;
  std::map<PublisherId, std::unique_ptr<StorePool>> pools_;

  // Shared by the workers.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::unordered_map<Key, Entry, HashOfKey> entries_;
  bool is_loaded_ = false;  ///< The whole recording was read.
  bool is_stopped_ = false;
  unsigned at_work_ = 0;  ///< Workers that are executing something.
  std::exception_ptr error_;
  std::atomic<std::uint64_t> done_{0};
  std::uint64_t total_ = 0;
};

}  // namespace fastcycle::host
