#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/value.h"
#include "fastcycle/log.h"

namespace fastcycle::config {

/// What happens when a component faults.
enum class OnFault : std::uint8_t {
  kStopComponent,  ///< That component stops, the others go on.
  kStop,           ///< The application stops, exit code 1.
  kRestart,        ///< That component is made anew.
};

/// What happens when a call of a component does not return.
enum class OnHang : std::uint8_t {
  kTell,        ///< It is told, and the run goes on.
  kStop,        ///< The application stops, exit code 1.
  kEndProcess,  ///< Its process is ended, and what follows is what that process's `on_exit` says.
};

/// The kernel's scheduling policy of an executor's workers.
enum class Policy : std::uint8_t { kOther, kFifo, kRr };

/// What a worker without work does.
enum class Wait : std::uint8_t {
  kPark,      ///< Sleeps.
  kSpin,      ///< Looks for work without pause; for a CPU of its own.
  kAdaptive,  ///< Looks for a short while, then sleeps.
};

/// What a full inbox lane does with one more message.
enum class Overflow : std::uint8_t {
  kDropOldest,  ///< For state: only the newest matters.
  kDropNewest,  ///< For events: what came first is kept.
};

/// How a recording is compressed.
enum class Compression : std::uint8_t { kNone, kLz4, kZstd };

/// What is recorded, and where to.
struct RecordDescription {
  std::filesystem::path file;
  std::vector<std::string> topics;  ///< Patterns, see `mcap::matches`; empty: all.
  std::vector<std::string> except;  ///< Patterns of topics that are not recorded.
  Compression compression = Compression::kLz4;
  /// For topics that the pattern means; the first that does counts.
  std::vector<std::pair<std::string, Compression>> compression_by_topic;
  std::uint64_t split_bytes = 0;                          ///< 0: not by size.
  std::chrono::nanoseconds split_time{0};                 ///< 0: not by time.
  std::chrono::nanoseconds sync_interval{1'000'000'000};  ///< 0: only at the end of a file.
  std::uint64_t memory_bytes = 256'000'000;               ///< That may wait to be written.
  bool has_activations = true;
  bool is_background = false;  ///< Its threads run only where nothing else wants a CPU.
  Place place;
};

/// What the flight recorder keeps, and what of it goes into a dump.
struct FlightRecorderDescription {
  std::filesystem::path file;                       ///< Of the ring; empty: the application's name.
  std::uint64_t bytes = 256'000'000;                ///< Of the ring.
  std::chrono::nanoseconds before{20'000'000'000};  ///< A trigger.
  std::chrono::nanoseconds after{5'000'000'000};    ///< A trigger.
  std::vector<std::string> topics;  ///< Patterns, see `record::matches`; empty: all.
  std::vector<std::string> except;  ///< Patterns of topics that are not kept.
  bool on_fault = true;             ///< A fault of a component is a trigger.
  Place place;
};

/// Where a trace of what the components do goes.
struct TraceDescription {
  std::filesystem::path file = {};          ///< What it held before is gone; empty: by the name.
  std::uint64_t buffer_bytes = 16'000'000;  ///< That may wait to be written.
  Place place = {};
};

/// Who may look at a run over a socket, and what they may change.
struct InspectDescription {
  bool allows_params = false;     ///< Parameters.
  bool allows_publish = false;    ///< Messages of their own, and calls of services.
  bool allows_lifecycle = false;  ///< Modes, and components that stop, start, or are made anew.
  bool allows_reload = false;     ///< Components that are made of another library.
  Place place;
};

/// Where browsers and Foxglove are shown a run, and what more they may do than look.
struct LiveDescription {
  std::string address = "127.0.0.1";  ///< An IP address.
  std::uint16_t port = 8765;          ///< 0: any that is free.
  std::vector<std::string> publish;   ///< Patterns of topics that clients may publish on.
  /// Pages of others that may ask: "https://app.foxglove.dev".
  std::vector<std::string> origins;
  std::string token_file;   ///< Has the token; empty: each run makes one.
  std::string certificate;  ///< A file in PEM, for TLS; empty: made by the run where TLS is wanted.
  std::string key;          ///< The file with its private key.
  bool tls = false;         ///< TLS on the own machine too.
  Place place;
};

/// A pool of workers that serves components.
struct ExecutorDescription {
  std::string name;
  int threads = 1;        ///< 1 to 64.
  std::vector<int> cpus;  ///< CPUs that the workers may run on; empty: all.
  Policy policy = Policy::kOther;
  int priority = 0;  ///< 1 to 99 with `kFifo` and `kRr`, otherwise 0.
  Wait wait = Wait::kPark;
  bool hand_over = false;
  Place place;
};

/// What happens when a process of the application ends without being asked to.
enum class OnExit : std::uint8_t {
  kStop,      ///< The application stops, exit code 1.
  kRestart,   ///< The process is made anew, with all its components.
  kContinue,  ///< The others go on without it.
};

/// What the code of a process may ask of the kernel.
enum class Sandbox : std::uint8_t {
  kNone,    ///< Whatever its user may.
  kStrict,  ///< What computing needs: no network, no programs, no files but those that it names.
};

/// Where and how a thread that a component makes runs.
struct ThreadDescription {
  std::vector<int> cpus;  ///< CPUs that it may run on; empty: all.
  Policy policy = Policy::kOther;
  int priority = 0;  ///< 1 to 99 with `kFifo` and `kRr`, otherwise 0.
  Place place;
};

/// What belongs to a topic and not to one of its ends.
struct TopicDescription {
  std::string name;  ///< Full, without a leading slash.
  int latched = 0;   ///< Messages kept for later subscribers, 0 to 1024.
  bool ages = true;  ///< Whether its messages count for the origin of what follows from them.
  std::optional<std::size_t> pool_max;  ///< Messages that the pool may have at most.
  std::size_t keep = 0;                 ///< Samples that components retain.
  bool multiple_publishers = false;
  bool external = false;  ///< Its messages may come from outside of the application.
  std::optional<std::chrono::nanoseconds> lifespan;  ///< Older messages are not delivered.
  std::size_t credits = 0;  ///< Messages on their way to a subscriber; 0: what the code says.
  Place place;
};

/// What the application says about one subscription of a component; unset: what the code says.
struct SubscriberDescription {
  std::optional<std::size_t> depth;  ///< 1 to 65536, per publisher.
  std::optional<Overflow> overflow;
  std::optional<std::size_t> history;  ///< Latched messages that it is given, 0 to 1024.
  std::optional<std::chrono::nanoseconds> deadline;
  std::optional<std::chrono::nanoseconds> lifespan;
  std::optional<std::chrono::nanoseconds> liveliness;
  Place place;
};

/// What the application says about one publisher of a component; unset: what the code says.
struct PublisherDescription {
  std::optional<std::size_t> keep;  ///< Of its messages, those that components retain; else the
                                    ///< topic's number.
  std::optional<std::chrono::nanoseconds> deadline;  ///< That it promises.
  Place place;
};

/// What follows when the restarts of a component or a process are used up.
enum class AfterRestarts : std::uint8_t {
  kStay,      ///< It stays stopped.
  kProcess,   ///< Of a component: its process is restarted, if that is one of its own; else as
              ///< before.
  kStop,      ///< The application stops.
  kContinue,  ///< Of a process: the others go on without it.
};

/// How often, and how fast, a component that faults is made anew.
struct RestartDescription {
  std::uint32_t limit = 3;  ///< Restarts within `within`; one more fault is the end.
  std::chrono::nanoseconds within{10'000'000'000};
  std::chrono::nanoseconds back_off{0};  ///< Before the first of them; doubled each time,
  std::chrono::nanoseconds back_off_max{5'000'000'000};  ///< up to this.
  AfterRestarts then = AfterRestarts::kStay;
};

/// A process of its own for some components of an application.
struct ProcessDescription {
  std::string name;
  OnExit on_exit = OnExit::kStop;
  RestartDescription restart;  ///< With `OnExit::kRestart`.
  /// Without a sign of life for so long it is ended; 0: never.
  std::chrono::nanoseconds heartbeat{0};
  std::uint64_t memory_bytes = 0;  ///< Private memory that it may have; 0: no limit.
  std::vector<int> cpus;           ///< CPUs that its threads may run on; empty: all.
  Sandbox sandbox = Sandbox::kNone;
  std::vector<std::filesystem::path> readable;  ///< In a sandbox: files and folders to read,
  std::vector<std::filesystem::path> writable;  ///< and those to write as well.
  std::string user;        ///< The user that it runs as; empty: the one who started the run.
  bool is_trusted = true;  ///< Others read its messages in its memory; else they get copies.
  /// A second process follows it, and takes its place when it ends.
  bool has_standby = false;
  Place place;
};

/// How long the calls of a component may take by the machine's clock before that is told.
struct HangDescription {
  std::chrono::nanoseconds callback_limit{750'000'000};     ///< Of a callback; 0: none.
  std::chrono::nanoseconds lifecycle_limit{5'000'000'000};  ///< Of constructor, start(), ...; 0:
                                                            ///< none.
  OnHang on_hang = OnHang::kTell;
};

/// One mode of the application: who is active in it, of those that some mode names.
struct ModeDescription {
  std::string name;
  std::vector<std::string> components;  ///< Full names, or patterns of them.
  std::vector<std::string> executors;   ///< All components that they serve.
  Place place;
};

/// What happens when a chain's message is delivered too late.
enum class OnBreach : std::uint8_t {
  kCount,    ///< It is counted.
  kDrop,     ///< It is counted, and not delivered.
  kDegrade,  ///< It is counted and delivered, and the mode is switched.
};

/// How old what is made of one topic's messages may be where another topic is delivered.
struct ChainDescription {
  std::string name;
  std::string from;  ///< The topic where it begins: full, without a leading slash.
  std::string to;    ///< The topic on whose delivery it is judged; the same.
  std::chrono::nanoseconds deadline{0};
  OnBreach on_breach = OnBreach::kCount;
  std::string mode;  ///< With `OnBreach::kDegrade`.
  Place place;
};

/// Where chains may begin: so many different topics, each of which every message knows.
inline constexpr std::size_t kMaxChainRoots = 8;

/// What a fault does: to messages of a topic, up to `kCorrupt`, to a component, or to a process.
enum class FaultKind : std::uint8_t {
  kDrop,       ///< The message does not come.
  kDelay,      ///< It comes later; those behind it wait for it.
  kDuplicate,  ///< It comes twice.
  kFreeze,     ///< The last message before the fault comes in its place.
  kCorrupt,    ///< A field of it is changed.
  kThrow,      ///< The component throws.
  kSlow,       ///< In simulated time: what it computes takes longer.
  kHang,       ///< Live: a callback does not return for a while.
  kRestart,    ///< It is made anew.
  kKill,       ///< The process ends as by SIGKILL.
};
[[nodiscard]] constexpr bool is_of_topic(FaultKind kind) noexcept {
  return kind <= FaultKind::kCorrupt;
}

/// What a field becomes in a corrupt message.
enum class Corruption : std::uint8_t {
  kNan,      ///< Not a number.
  kValue,    ///< A number that the file gives.
  kBitFlip,  ///< What it is, but for one bit.
  kStale,    ///< What it was in the message before.
};

/// One fault that is injected into a run.
struct FaultDescription {
  std::string name;
  FaultKind kind = FaultKind::kDrop;
  std::string topic;       ///< Full, without a leading slash.
  std::string publisher;   ///< The component; empty: all.
  std::string subscriber;  ///< The component; empty: all.
  std::string component;
  std::string process;
  std::chrono::nanoseconds from{0};            ///< Since the start of the timers.
  std::optional<std::chrono::nanoseconds> to;  ///< The same; none: to the end of the run.
  std::vector<std::uint64_t> messages;         ///< Sorted sequences of a publisher; empty: all.
  double probability = 1.0;                    ///< Of a message.
  std::chrono::nanoseconds by{0};              ///< Of `kDelay`, `kSlow`, `kHang`.
  std::string field;                           ///< Dotted, of `kCorrupt`.
  Corruption corruption = Corruption::kNan;
  double value = 0;  ///< Of `Corruption::kValue`.
  Place place;
};

/// What is injected into a run, to see what becomes of it.
struct FaultsDescription {
  std::uint64_t seed = 0;  ///< Of what is drawn.
  std::vector<FaultDescription> list;
  Place place;
};

/// One component of the application, with all that its file, overlays and options say of it.
struct ComponentDescription {
  std::string name;          ///< Full: `front/limiter` for `limiter` in the namespace `front`.
  std::string name_space;    ///< `front`, or empty; `"namespace"` in JSON.
  std::string library;       ///< `speed_limiter` for the file `libspeed_limiter.so`.
  std::string class_name;    ///< Which class of the library; empty: its only one. `"class"`.
  std::string executor;      ///< Empty: the one of all who name none.
  std::string process;       ///< One of the application's `processes`; empty: the main process.
  bool has_standby = false;  ///< Its process has one.
  std::optional<std::chrono::nanoseconds> serve_period;  ///< None: `serve()` is never called.
  std::chrono::nanoseconds serve_phase{0};
  std::chrono::nanoseconds simulated_cost{0};  ///< In simulated time, of each of its turns.
  Value params;                                ///< Always an object.
  std::map<std::string, std::string> remap;    ///< Name in code → topic; see `resolve_topic`.
  OnFault on_fault = OnFault::kStopComponent;
  RestartDescription restart;  ///< With `OnFault::kRestart`.
  HangDescription hang;
  std::string fault_mode;          ///< The mode that follows its end by a fault; or none.
  std::vector<std::string> after;  ///< Full names of those that start before it.
  std::chrono::nanoseconds start_timeout{0};                 ///< For its `start()`, live; 0: none.
  std::optional<LogLevel> log_level;                         ///< None: the application's.
  std::map<std::string, SubscriberDescription> subscribers;  ///< By the topic's name in code.
  std::map<std::string, PublisherDescription> publishers;    ///< By the topic's name in code.
  std::map<std::string, ThreadDescription> threads;          ///< By the thread's name in code.
  Place place;
};

/// Which libraries may be loaded: these, and only with these contents.
struct LibrariesDescription {
  /// SHA-256 in 64 hexadecimal digits, by the name of a component library, or by the name of the
  /// file of a library that such ones need.
  std::map<std::string, std::string> sha256;
  Place place;
};

/// A component that is executed once more beside the one that it follows.
struct ShadowDescription {
  std::string name;  ///< Of it and its process.
  std::string of;
  std::string library;     ///< Empty: that of the component.
  std::string class_name;  ///< Empty: the library's only one; without a library the component's.
  Value params;            ///< An object: in what it differs from the component.
  Place place;
};

/// A checked application: plain values, complete, no file is needed any more.
struct ApplicationDescription {
  std::string name;
  std::filesystem::path file;
  std::vector<std::filesystem::path> library_path;  ///< Folders to look for libraries in, first one
                                                    ///< first.
  std::optional<LibrariesDescription> libraries;    ///< None: all that are found may be loaded.
  std::vector<ExecutorDescription> executors;
  /// All that components name, the main process left out: in the order of the file, then of the
  /// components that name one which is not described.
  std::vector<ProcessDescription> processes;
  std::vector<TopicDescription> topics;
  std::vector<ComponentDescription> components;  ///< Included ones first, then in file order.
  std::vector<ModeDescription> modes;            ///< In file order.
  std::string initial_mode;                      ///< Empty where there are no modes.
  std::vector<ChainDescription> chains;          ///< In file order.
  FaultsDescription faults;                      ///< Empty in all but a trial of faults.
  std::vector<ShadowDescription> shadows;        ///< In file order.
  Value shared_params;                           ///< Always an object.
  std::optional<RecordDescription> record;       ///< None: nothing is recorded.
  std::optional<FlightRecorderDescription> flight_recorder;  ///< None: there is none.
  std::optional<TraceDescription> trace;                     ///< None: nothing is traced.
  std::optional<InspectDescription> inspect;                 ///< None: nobody may look.
  std::optional<LiveDescription> live;                       ///< None: nobody is shown it.
  OnFault on_fault = OnFault::kStopComponent;                ///< The default of its components.
  std::chrono::nanoseconds status_period{1'000'000'000};     ///< Of "fastcycle/status".
  std::chrono::nanoseconds state_period{1'000'000'000};      ///< Of key frames; 0: none.
  LogLevel log_level = LogLevel::kInfo;  ///< Of its own lines; the default of its components.
  Place place;
  Value effective;  ///< The tree that all of this was read from; what `print` shows.
};

/// The order in which components start, as places in `application.components`: that of the file,
/// but each after those that it names under `"after"`. Names that do not exist count for nothing;
/// of a circle, which `check_sense` reports, the first in the file goes first.
[[nodiscard]] std::vector<std::size_t> start_order(const ApplicationDescription& application);

/// The full name of the topic that `component` calls `name_in_code`.
///
/// A remapped name is replaced first. A name that begins with a slash is full already, and only
/// loses the slash; any other is placed in the component's namespace:
///
///     namespace "front", remap {"goal": "mission/goal", "map": "/map"}
///     "speed" → "front/speed"   "goal" → "front/mission/goal"   "map" → "map"
[[nodiscard]] std::string resolve_topic(const ComponentDescription& component,
                                        std::string_view name_in_code);

/// The words of the enums as JSON has them: `drop_oldest`, `stop_component`.
[[nodiscard]] std::string_view to_string(OnFault on_fault);
[[nodiscard]] std::string_view to_string(OnHang on_hang);
[[nodiscard]] std::string_view to_string(AfterRestarts then);
[[nodiscard]] std::string_view to_string(Policy policy);
[[nodiscard]] std::string_view to_string(Wait wait);
[[nodiscard]] std::string_view to_string(Overflow overflow);
[[nodiscard]] std::string_view to_string(Compression compression);
[[nodiscard]] std::string_view to_string(OnBreach on_breach);
[[nodiscard]] std::string_view to_string(OnExit on_exit);
[[nodiscard]] std::string_view to_string(Sandbox sandbox);
[[nodiscard]] std::string_view to_string(FaultKind kind);
[[nodiscard]] std::string_view to_string(Corruption corruption);

}  // namespace fastcycle::config
