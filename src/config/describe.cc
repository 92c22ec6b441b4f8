#include "config/describe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <unordered_set>
#include <utility>

#include "base/log_level.h"
#include "config/main_process.h"
#include "config/merge.h"

namespace fastcycle::config {

namespace {

/// Default of a process with a standby, which takes over when the heartbeat is missing.
constexpr std::chrono::milliseconds kHeartbeatWithStandby{100};

template <typename Integer>
void read_integer(const Value& object, std::string_view key, Integer& result) {
  const Value* value = object.find(key);
  if (value != nullptr && value->type() == Value::Type::kInt &&
      std::in_range<Integer>(value->as_int64())) {
    result = static_cast<Integer>(value->as_int64());
  }
}

void read_size(const Value& object, std::string_view key, std::optional<std::size_t>& result) {
  const Value* value = object.find(key);
  if (value != nullptr && value->type() == Value::Type::kInt && value->as_int64() >= 0) {
    result = static_cast<std::size_t>(value->as_int64());
  }
}

void read_bool(const Value& object, std::string_view key, bool& result) {
  const Value* value = object.find(key);
  if (value != nullptr && value->is_bool()) {
    result = value->as_bool();
  }
}

template <typename Word, std::size_t kCount>
std::optional<Word> find_word(const Value& object, std::string_view key,
                              const std::array<Word, kCount>& words) {
  const std::string text = text_of(object, key);
  const auto found =
      std::ranges::find_if(words, [&](Word word) { return to_string(word) == text; });
  return found == words.end() ? std::nullopt : std::optional<Word>(*found);
}

std::optional<OnFault> find_on_fault(const Value& object) {
  return find_word(object, "on_fault",
                   std::array{OnFault::kStopComponent, OnFault::kStop, OnFault::kRestart});
}

std::optional<LogLevel> find_log_level(const Value& object) {
  const auto& words = detail::kLogLevelWords;
  const auto found = std::ranges::find(words, text_of(object, "log_level"));
  return found == words.end() ? std::nullopt
                              : std::optional(static_cast<LogLevel>(found - words.begin()));
}

/// A time of `unit`s.
std::optional<std::chrono::nanoseconds> find_time(const Value& object, std::string_view key,
                                                  std::chrono::nanoseconds unit) {
  constexpr std::chrono::nanoseconds kMax = std::chrono::days(1);  // The schema's limit.
  const Value* value = object.find(key);
  const auto unit_ns = static_cast<double>(unit.count());
  if (value == nullptr || !value->is_number() ||
      !(std::abs(value->as_double()) * unit_ns <= static_cast<double>(kMax.count()))) {
    return std::nullopt;
  }
  return std::chrono::nanoseconds(std::llround(value->as_double() * unit_ns));
}

std::optional<std::chrono::nanoseconds> find_ms(const Value& object, std::string_view key) {
  return find_time(object, key, std::chrono::milliseconds(1));
}

/// A time above zero; the schema check reports others.
std::optional<std::chrono::nanoseconds> find_span(const Value& object, std::string_view key) {
  const auto span = find_ms(object, key);
  return span && span->count() > 0 ? span : std::nullopt;
}

std::optional<std::chrono::nanoseconds> find_s(const Value& object, std::string_view key) {
  return find_time(object, key, std::chrono::seconds(1));
}

void read_cpus(const Value& object, std::vector<int>& result) {
  if (const Value* cpus = find_array(object, "cpus")) {
    for (const Value& cpu : cpus->items()) {
      if (cpu.type() == Value::Type::kInt && std::in_range<int>(cpu.as_int64())) {
        result.push_back(static_cast<int>(cpu.as_int64()));
      }
    }
  }
}

/// Where and how threads run: an executor's workers, or a component's own thread.
template <typename Description>
void read_scheduling(const Value& value, Description& description) {
  read_integer(value, "priority", description.priority);
  read_integer(value, "slice_us", description.slice_us);
  description.policy =
      find_word(value, "policy", std::array{Policy::kOther, Policy::kFifo, Policy::kRr})
          .value_or(Policy::kOther);
  read_cpus(value, description.cpus);
}

ExecutorDescription describe_executor(const Value& value) {
  ExecutorDescription executor;
  executor.name = text_of(value, "name");
  executor.place = value.place();
  read_integer(value, "threads", executor.threads);
  read_bool(value, "hand_over", executor.hand_over);
  executor.wait = find_word(value, "wait", std::array{Wait::kPark, Wait::kSpin, Wait::kAdaptive})
                      .value_or(Wait::kPark);
  read_scheduling(value, executor);
  return executor;
}

ThreadDescription describe_thread(const Value& value) {
  ThreadDescription thread;
  thread.place = value.place();
  read_scheduling(value, thread);
  return thread;
}

TopicDescription describe_topic(const std::string& name, const Value& value) {
  TopicDescription topic;
  topic.name = without_slash(name);
  topic.place = value.place();
  read_integer(value, "latched", topic.latched);
  read_integer(value, "keep", topic.keep);
  read_bool(value, "ages", topic.ages);
  read_bool(value, "multiple_publishers", topic.multiple_publishers);
  read_bool(value, "external", topic.external);
  read_integer(value, "credits", topic.credits);
  read_size(value, "pool_max", topic.pool_max);
  topic.lifespan = find_span(value, "lifespan_ms");
  return topic;
}

SubscriberDescription describe_subscriber(const Value& value) {
  SubscriberDescription subscriber;
  subscriber.place = value.place();
  read_size(value, "depth", subscriber.depth);
  read_size(value, "history", subscriber.history);
  subscriber.deadline = find_span(value, "deadline_ms");
  subscriber.lifespan = find_span(value, "lifespan_ms");
  subscriber.liveliness = find_span(value, "liveliness_ms");
  subscriber.overflow =
      find_word(value, "overflow", std::array{Overflow::kDropOldest, Overflow::kDropNewest});
  return subscriber;
}

PublisherDescription describe_publisher(const Value& value) {
  PublisherDescription publisher;
  publisher.place = value.place();
  read_size(value, "keep", publisher.keep);
  publisher.deadline = find_span(value, "deadline_ms");
  return publisher;
}

void describe_ends(const Value& value, ComponentDescription& component) {
  if (const Value* remap = find_object(value, "remap")) {
    for (const auto& [name, other] : remap->members()) {
      if (other.is_string()) {
        component.remap[name] = other.as_string();
      }
    }
  }
  if (const Value* subscribers = find_object(value, "subscribers")) {
    for (const auto& [name, subscriber] : subscribers->members()) {
      component.subscribers[name] = describe_subscriber(subscriber);
    }
  }
  if (const Value* publishers = find_object(value, "publishers")) {
    for (const auto& [name, publisher] : publishers->members()) {
      component.publishers[name] = describe_publisher(publisher);
    }
  }
}

void read_texts(const Value& object, std::string_view key, std::vector<std::string>& result) {
  if (const Value* texts = find_array(object, key)) {
    for (const Value& text : texts->items()) {
      if (text.is_string()) {
        result.push_back(text.as_string());
      }
    }
  }
}

/// Reads `"restart"` of `object`, over `defaults`.
RestartDescription describe_restart(const Value& object, RestartDescription defaults) {
  if (const Value* restart = find_object(object, "restart")) {
    read_integer(*restart, "limit", defaults.limit);
    defaults.within = find_s(*restart, "within_s").value_or(defaults.within);
    defaults.back_off = find_ms(*restart, "back_off_ms").value_or(defaults.back_off);
    defaults.back_off_max = find_ms(*restart, "back_off_max_ms").value_or(defaults.back_off_max);
    defaults.then = find_word(*restart, "then",
                              std::array{AfterRestarts::kStay, AfterRestarts::kProcess,
                                         AfterRestarts::kStop, AfterRestarts::kContinue})
                        .value_or(defaults.then);
  }
  return defaults;
}

/// Reads the options for hanging calls of `object`, over `defaults`.
HangDescription describe_hang(const Value& object, HangDescription defaults) {
  defaults.callback_limit = find_ms(object, "callback_limit_ms").value_or(defaults.callback_limit);
  defaults.lifecycle_limit =
      find_ms(object, "lifecycle_limit_ms").value_or(defaults.lifecycle_limit);
  defaults.on_hang =
      find_word(object, "on_hang", std::array{OnHang::kReport, OnHang::kStop, OnHang::kEndProcess})
          .value_or(defaults.on_hang);
  return defaults;
}

/// The application's defaults for its components.
struct ComponentDefaults {
  OnFault on_fault = OnFault::kStopComponent;
  RestartDescription restart;
  std::chrono::nanoseconds start_timeout{0};
  HangDescription hang;
};

ComponentDescription describe_component(const Value& value, const ComponentDefaults& defaults) {
  ComponentDescription component;
  component.name = full_name(value);
  component.name_space = text_of(value, "namespace");
  component.library = text_of(value, "library");
  component.class_name = text_of(value, "class");
  component.executor = text_of(value, "executor");
  component.process = text_of(value, "process");
  if (component.process == kMainProcess) {
    component.process.clear();
  }
  read_bool(value, "standby", component.has_standby);
  if (component.has_standby && component.process.empty()) {
    component.process = component.name;  // A standby follows a process.
  }
  component.serve_period = find_ms(value, "serve_period_ms");
  component.serve_phase = find_ms(value, "serve_phase_ms").value_or(std::chrono::nanoseconds{0});
  component.simulated_cost =
      find_ms(value, "simulated_cost_ms").value_or(std::chrono::nanoseconds{0});
  const Value* params = find_object(value, "params");
  component.params = params == nullptr ? Value::object_at(value) : *params;
  component.on_fault = find_on_fault(value).value_or(defaults.on_fault);
  component.restart = describe_restart(value, defaults.restart);
  component.fault_mode = text_of(value, "fault_mode");
  component.log_level = find_log_level(value);
  component.start_timeout = find_ms(value, "start_timeout_ms").value_or(defaults.start_timeout);
  component.hang = describe_hang(value, defaults.hang);
  read_texts(value, "after", component.after);
  for (std::string& name : component.after) {
    name = without_slash(placed(component.name_space, name));
  }
  component.place = value.place();
  describe_ends(value, component);
  if (const Value* threads = find_object(value, "threads")) {
    for (const auto& [name, thread] : threads->members()) {
      component.threads[name] = describe_thread(thread);
    }
  }
  return component;
}

void describe_library_path(const Value& tree, ApplicationDescription& application) {
  const Value* folders = find_array(tree, "library_path");
  if (folders == nullptr) {
    return;
  }
  std::unordered_set<std::string> known;
  for (const Value& folder : folders->items()) {
    if (folder.is_string() && known.insert(folder.as_path().string()).second) {
      application.library_path.push_back(folder.as_path());
    }
  }
}

LibrariesDescription describe_libraries(const Value& value) {
  LibrariesDescription libraries{.sha256 = {}, .place = value.place()};
  if (const Value* sums = find_object(value, "sha256")) {
    for (const auto& [name, sum] : sums->members()) {
      if (sum.is_string()) {
        libraries.sha256[name] = sum.as_string();
      }
    }
  }
  return libraries;
}

std::optional<Compression> find_compression(const Value& object, std::string_view key) {
  return find_word(object, key,
                   std::array{Compression::kNone, Compression::kLz4, Compression::kZstd});
}

void read_mb(const Value& object, std::string_view key, std::uint64_t& result) {
  constexpr double kMaxMb = 1e9;  // The schema's limit.
  const Value* value = object.find(key);
  if (value != nullptr && value->is_number() && value->as_double() >= 0 &&
      value->as_double() <= kMaxMb) {
    result = static_cast<std::uint64_t>(std::llround(value->as_double() * 1e6));
  }
}

void read_paths(const Value& object, std::string_view key,
                std::vector<std::filesystem::path>& result) {
  if (const Value* paths = find_array(object, key)) {
    for (const Value& path : paths->items()) {
      if (path.is_string()) {
        result.push_back(path.as_path());
      }
    }
  }
}

ProcessDescription describe_process(const Value& value) {
  ProcessDescription process;
  process.name = text_of(value, "name");
  process.place = value.place();
  read_bool(value, "standby", process.has_standby);
  process.on_exit =
      find_word(value, "on_exit", std::array{OnExit::kStop, OnExit::kRestart, OnExit::kContinue})
          .value_or(process.has_standby ? OnExit::kRestart : process.on_exit);
  process.restart = describe_restart(value, {.then = AfterRestarts::kStop});
  process.heartbeat = find_ms(value, "heartbeat_ms").value_or(process.heartbeat);
  read_mb(value, "memory_mb", process.memory_bytes);
  read_cpus(value, process.cpus);
  if (const Value* sandbox = find_object(value, "sandbox")) {
    process.sandbox = Sandbox::kStrict;
    read_paths(*sandbox, "read", process.readable);
    read_paths(*sandbox, "write", process.writable);
  } else {
    process.sandbox = find_word(value, "sandbox", std::array{Sandbox::kNone, Sandbox::kStrict})
                          .value_or(process.sandbox);
  }
  process.user = text_of(value, "user");
  read_bool(value, "trusted", process.is_trusted);
  return process;
}

/// A component with a standby is followed with all of its process.
void add_standbys(ApplicationDescription& application) {
  for (ProcessDescription& process : application.processes) {
    const bool is_asked_for =
        std::ranges::any_of(application.components, [&](const ComponentDescription& component) {
          return component.has_standby && component.process == process.name;
        });
    if (is_asked_for && !process.has_standby) {
      process.has_standby = true;
      process.on_exit = process.on_exit == OnExit::kStop ? OnExit::kRestart : process.on_exit;
    }
    if (process.has_standby && process.heartbeat.count() == 0) {
      process.heartbeat = kHeartbeatWithStandby;
    }
  }
}

/// Those that the tree describes and a component is in, then those that a component is in only.
void add_processes(const Value& tree, ApplicationDescription& application) {
  std::unordered_set<std::string> missing;
  for (const ComponentDescription& component : application.components) {
    missing.insert(component.process);
  }
  missing.erase("");
  for (ProcessDescription& process : described_processes(tree)) {
    if (missing.erase(process.name) > 0) {
      application.processes.push_back(std::move(process));
    }
  }
  for (const Value& component : tree.find("components")->items()) {
    const std::string name = text_of(component, "process");
    if (missing.erase(name) > 0) {
      ProcessDescription process;
      process.name = name;
      process.place = component["process"].place();
      application.processes.push_back(std::move(process));
    }
  }
  for (const ComponentDescription& component : application.components) {
    if (missing.erase(component.process) > 0) {  // It has one only for its standby.
      ProcessDescription process;
      process.name = component.process;
      process.place = component.place;
      application.processes.push_back(std::move(process));
    }
  }
  add_standbys(application);
}

ModeDescription describe_mode(const std::string& name, const Value& value) {
  ModeDescription mode;
  mode.name = name;
  mode.place = value.place();
  read_texts(value, "components", mode.components);
  read_texts(value, "executors", mode.executors);
  return mode;
}

ChainDescription describe_chain(const Value& value) {
  ChainDescription chain;
  chain.place = value.place();
  chain.name = text_of(value, "name");
  chain.from = without_slash(text_of(value, "from"));
  chain.to = without_slash(text_of(value, "to"));
  chain.deadline = find_span(value, "deadline_ms").value_or(std::chrono::nanoseconds{0});
  chain.on_breach = find_word(value, "on_breach",
                              std::array{OnBreach::kCount, OnBreach::kDrop, OnBreach::kDegrade})
                        .value_or(OnBreach::kCount);
  chain.mode = text_of(value, "mode");
  return chain;
}

FaultDescription describe_fault(const Value& value) {
  FaultDescription fault;
  fault.place = value.place();
  fault.kind = find_word(value, "kind",
                         std::array{FaultKind::kDrop, FaultKind::kDelay, FaultKind::kDuplicate,
                                    FaultKind::kFreeze, FaultKind::kCorrupt, FaultKind::kThrow,
                                    FaultKind::kSlow, FaultKind::kHang, FaultKind::kRestart,
                                    FaultKind::kCrash, FaultKind::kLeak, FaultKind::kKill,
                                    FaultKind::kSuspend})
                   .value_or(fault.kind);
  fault.name = text_of(value, "name");
  fault.topic = without_slash(text_of(value, "topic"));
  fault.publisher = text_of(value, "publisher");
  fault.subscriber = text_of(value, "subscriber");
  fault.component = text_of(value, "component");
  fault.process = text_of(value, "process");
  fault.from = find_s(value, "from_s").value_or(fault.from);
  fault.to = find_s(value, "to_s");
  if (const Value* messages = find_array(value, "messages")) {
    for (const Value& one : messages->items()) {
      if (one.type() == Value::Type::kInt && one.as_int64() > 0) {
        fault.messages.push_back(one.as_uint64());
      }
    }
    std::ranges::sort(fault.messages);
  }
  if (const Value* number = value.find("probability"); number != nullptr && number->is_number()) {
    fault.probability = number->as_double();
  }
  fault.by = find_span(value, "by_ms").value_or(fault.by);
  read_integer(value, "by_mb", fault.by_bytes);
  fault.by_bytes *= 1'000'000;
  fault.field = text_of(value, "field");
  fault.corruption = find_word(value, "as",
                               std::array{Corruption::kNan, Corruption::kValue,
                                          Corruption::kBitFlip, Corruption::kStale})
                         .value_or(fault.corruption);
  if (const Value* number = value.find("value"); number != nullptr && number->is_number()) {
    fault.value = number->as_double();
  }
  return fault;
}

std::vector<ShadowDescription> describe_shadows(const Value& list) {
  std::vector<ShadowDescription> shadows;
  for (const Value& value : list.items()) {
    ShadowDescription shadow;
    shadow.of = text_of(value, "of");
    shadow.name = text_of(value, "name");
    if (shadow.name.empty()) {
      shadow.name = list.size() == 1 ? "shadow" : "shadow_" + std::to_string(shadows.size() + 1);
    }
    shadow.library = text_of(value, "library");
    shadow.class_name = text_of(value, "class");
    const Value* params = find_object(value, "params");
    shadow.params = params == nullptr ? Value::object_at(value) : *params;
    shadow.place = value.place();
    shadows.push_back(std::move(shadow));
  }
  return shadows;
}

FaultsDescription describe_faults(const Value& value) {
  FaultsDescription faults;
  faults.place = value.place();
  read_integer(value, "seed", faults.seed);
  if (const Value* list = find_array(value, "list")) {
    for (const Value& fault : list->items()) {
      faults.list.push_back(describe_fault(fault));
    }
  }
  // The draw of a fault depends on its name, and so not on the rest of the list.
  for (std::size_t i = 0; i < faults.list.size(); ++i) {
    FaultDescription& fault = faults.list[i];
    if (fault.name.empty()) {
      fault.name = std::string(to_string(fault.kind)) + '_' + std::to_string(i + 1);
    }
  }
  return faults;
}

RecordDescription describe_record(const Value& value) {
  RecordDescription record;
  record.place = value.place();
  if (const Value* file = find_string(value, "file")) {
    record.file = file->as_path();
  }
  read_texts(value, "topics", record.topics);
  read_texts(value, "except", record.except);
  record.compression = find_compression(value, "compression").value_or(record.compression);
  if (const Value* rules = find_object(value, "compression_by_topic")) {
    for (const auto& [pattern, rule] : rules->members()) {
      if (const auto compression = find_compression(*rules, pattern)) {
        record.compression_by_topic.emplace_back(pattern, *compression);
      }
    }
  }
  read_mb(value, "split_mb", record.split_bytes);
  if (const auto split_s = find_s(value, "split_s")) {
    record.split_time = *split_s;
  }
  record.sync_interval = find_ms(value, "sync_ms").value_or(record.sync_interval);
  read_mb(value, "memory_mb", record.memory_bytes);
  read_bool(value, "activations", record.has_activations);
  read_bool(value, "background", record.is_background);
  return record;
}

FlightRecorderDescription describe_flight_recorder(const Value& value) {
  FlightRecorderDescription flight_recorder;
  flight_recorder.place = value.place();
  if (const Value* file = find_string(value, "file")) {
    flight_recorder.file = file->as_path();
  }
  read_mb(value, "size_mb", flight_recorder.bytes);
  flight_recorder.before = find_s(value, "before_s").value_or(flight_recorder.before);
  flight_recorder.after = find_s(value, "after_s").value_or(flight_recorder.after);
  read_texts(value, "topics", flight_recorder.topics);
  read_texts(value, "except", flight_recorder.except);
  read_bool(value, "on_fault", flight_recorder.on_fault);
  return flight_recorder;
}

TraceDescription describe_trace(const Value& value) {
  TraceDescription trace;
  trace.place = value.place();
  if (const Value* file = find_string(value, "file")) {
    trace.file = file->as_path();
  }
  read_mb(value, "buffer_mb", trace.buffer_bytes);
  return trace;
}

std::optional<InspectDescription> describe_inspect(const Value& value) {
  InspectDescription inspect;
  inspect.place = value.place();
  if (value.is_bool() && !value.as_bool()) {
    return std::nullopt;
  }
  std::vector<std::string> allowed;
  read_texts(value, "allow", allowed);
  const auto allows = [&](const char* word) {
    return std::ranges::find(allowed, word) != allowed.end();
  };
  inspect.allows_params = allows("params");
  inspect.allows_publish = allows("publish");
  inspect.allows_lifecycle = allows("lifecycle");
  inspect.allows_reload = allows("reload");
  return inspect;
}

std::optional<LiveDescription> describe_live(const Value& value) {
  LiveDescription live;
  live.place = value.place();
  if (value.is_bool() && !value.as_bool()) {
    return std::nullopt;
  }
  if (const Value* address = find_string(value, "address")) {
    live.address = address->as_string();
  }
  read_integer(value, "port", live.port);
  read_texts(value, "publish", live.publish);
  read_texts(value, "origins", live.origins);
  const auto read_path = [&](const char* name, std::string& to) {
    if (const Value* text = find_string(value, name)) {
      to = text->as_path().string();
    }
  };
  read_path("token_file", live.token_file);
  read_path("certificate", live.certificate);
  read_path("key", live.key);
  if (const Value* tls = value.find("tls"); tls != nullptr && tls->is_bool()) {
    live.tls = tls->as_bool();
  }
  return live;
}

}  // namespace

std::vector<ProcessDescription> described_processes(const Value& tree) {
  std::vector<ProcessDescription> result;
  if (const Value* processes = find_array(tree, "processes")) {
    for (const Value& process : processes->items()) {
      result.push_back(describe_process(process));
    }
  }
  return result;
}

ApplicationDescription describe(const Value& tree) {
  ApplicationDescription application;
  application.name = text_of(tree, "name");
  application.place = tree.place();
  application.file = application.place.file;
  application.on_fault = find_on_fault(tree).value_or(OnFault::kStopComponent);
  application.log_level = find_log_level(tree).value_or(application.log_level);
  application.status_period = find_ms(tree, "status_period_ms").value_or(application.status_period);
  application.state_period = find_s(tree, "state_period_s").value_or(application.state_period);
  describe_library_path(tree, application);
  if (const Value* executors = find_array(tree, "executors")) {
    for (const Value& executor : executors->items()) {
      application.executors.push_back(describe_executor(executor));
    }
  }
  if (const Value* topics = find_object(tree, "topics")) {
    for (const auto& [name, topic] : topics->members()) {
      application.topics.push_back(describe_topic(name, topic));
    }
  }
  const ComponentDefaults defaults{
      .on_fault = application.on_fault,
      .restart = describe_restart(tree, {}),
      .start_timeout = find_ms(tree, "start_timeout_ms").value_or(std::chrono::nanoseconds{0}),
      .hang = describe_hang(tree, {})};
  if (const Value* components = find_array(tree, "components")) {
    for (const Value& component : components->items()) {
      application.components.push_back(describe_component(component, defaults));
    }
    add_processes(tree, application);
  }
  if (const Value* modes = find_object(tree, "modes")) {
    for (const auto& [name, mode] : modes->members()) {
      application.modes.push_back(describe_mode(name, mode));
    }
  }
  application.initial_mode = text_of(tree, "initial_mode");
  if (const Value* chains = find_array(tree, "chains")) {
    for (const Value& chain : chains->items()) {
      application.chains.push_back(describe_chain(chain));
    }
  }
  if (const Value* shadows = find_array(tree, "shadow")) {
    application.shadows = describe_shadows(*shadows);
  }
  if (const Value* faults = find_object(tree, "faults")) {
    application.faults = describe_faults(*faults);
  }
  const Value* shared = find_object(tree, "shared_params");
  application.shared_params = shared == nullptr ? Value::object_at(tree) : *shared;
  if (const Value* libraries = find_object(tree, "libraries")) {
    application.libraries = describe_libraries(*libraries);
  }
  if (const Value* record = find_object(tree, "record")) {
    application.record = describe_record(*record);
  }
  if (const Value* flight_recorder = find_object(tree, "flight_recorder")) {
    application.flight_recorder = describe_flight_recorder(*flight_recorder);
  }
  if (const Value* trace = find_object(tree, "trace")) {
    application.trace = describe_trace(*trace);
  }
  if (const Value* inspect = tree.find("inspect")) {
    application.inspect = describe_inspect(*inspect);
  }
  if (const Value* live = tree.find("live")) {
    application.live = describe_live(*live);
  }
  application.effective = tree;
  return application;
}

}  // namespace fastcycle::config
