#include "replay/replay.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <utility>

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include "component/component_core.h"
#include "component/declare.h"
#include "component/service_topics.h"
#include "component/steps.h"
#include "mcap/error.h"
#include "modes/modes.h"
#include "record/recorded_schedule.h"
#include "replay/read_ahead.h"
#include "replay/stand_in.h"

namespace fastcycle::host {
namespace {

config::Place place_of(const std::filesystem::path& file) {
  return {.file = file.string(), .line = 0, .pointer = {}};
}

}  // namespace

Replay::Replay(ReplayOptions options, ComponentClasses& classes)
    : options_(std::move(options)), classes_(classes) {}

Replay::~Replay() {
  stop();
}

std::unique_ptr<Replay> Replay::prepare(ReplayOptions options,
                                        const config::ApplicationDescription& application,
                                        ComponentClasses& classes,
                                        const FindConnections& find_connections,
                                        config::Problems& problems) {
  std::unique_ptr<Replay> replay(new Replay(std::move(options), classes));
  const bool is_ready = replay->open(problems) &&
                        replay->choose(application, find_connections, problems) &&
                        replay->set_range(problems);
  return is_ready ? std::move(replay) : nullptr;
}

bool Replay::open(config::Problems& problems) {
  for (const std::filesystem::path& file : options_.files) {
    std::filesystem::path active = file;
    active += ".active";
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored) && std::filesystem::exists(active, ignored)) {
      problems.add(config::make_error(place_of(file), "there is no such file",
                                      "the recording was not closed: it is " + active.string()));
      return false;
    }
  }
  try {
    reader_ = std::make_unique<record::RecordingReader>(options_.files);
  } catch (const mcap::Error& error) {
    problems.add(config::make_error({}, error.what()));  // The text contains the place.
    return false;
  }
  for (const std::string& note : reader_->notes()) {
    config::Problem problem = config::make_error({}, note);
    problem.warning = true;
    problems.add(std::move(problem));
  }
  return true;
}

bool Replay::choose(const config::ApplicationDescription& application,
                    const FindConnections& find_connections, config::Problems& problems) {
  config::Problems found;
  const std::vector<Connection> connections = find_connections(application, classes_, found);
  if (found.has_errors()) {
    for (const config::Problem& problem : found.all()) {
      problems.add(problem);
    }
    return false;
  }
  plan_ = plan_replay(options_, reader_->streams(), application, connections, problems);
  if (problems.has_errors()) {
    return false;
  }
  if (!are_of_one_time(problems)) {
    return false;
  }
  warn_of_switches(problems);
  description_ = describe_replay(application, plan_);
  make_prototypes();
  return true;
}

/// False after adding an error: two runs at once would feed what no run ever published.
bool Replay::are_of_one_time(config::Problems& problems) const {
  std::vector<record::RecordedStream> fed;
  for (std::size_t i = 0; i < plan_.streams.size(); ++i) {
    if (plan_.streams[i].is_fed()) {
      fed.push_back(reader_->streams()[i]);
    }
  }
  try {
    const std::string overlap = record::find_overlapping_runs(options_.files, fed);
    if (!overlap.empty()) {
      problems.add(config::make_error(place_of(options_.files.front()), overlap,
                                      "replay one of them, or other topics of each"));
    }
    return overlap.empty();
  } catch (const mcap::Error& error) {
    problems.add(config::make_error({}, error.what()));
    return false;
  }
}

/// Components that run repeat their requests of modes; others do not.
void Replay::warn_of_switches(config::Problems& problems) const {
  std::size_t count = 0;
  ModeSwitch first;
  for (const ModeSwitch& made : switches_in(reader_->end_facts())) {
    if (!plan_.runs(made.by) && count++ == 0) {
      first = made;
    }
  }
  if (count == 0) {
    return;
  }
  const double time_s = std::chrono::duration<double>(first.stamp - reader_->begin()).count();
  config::Problem problem = config::make_error(
      place_of(options_.files.front()),
      fmt::format("in the recorded run {} asked for the mode \"{}\" at {:.3f} s, and is not there "
                  "to ask again: {} of its switches {} not repeated",
                  first.by.empty() ? "somebody outside" : "component \"" + first.by + "\"",
                  first.to, time_s, count, count == 1 ? "is" : "are"));
  problem.warning = true;
  problems.add(std::move(problem));
}

void Replay::make_prototypes() {
  auto* factory = google::protobuf::MessageFactory::generated_factory();
  for (const ReplayPlan::Stream& stream : plan_.streams) {
    wanted_.push_back(stream.is_fed());
    prototypes_.push_back(stream.is_fed() ? factory->GetPrototype(stream.type) : nullptr);
  }
  publishers_.resize(wanted_.size());
  fed_.resize(wanted_.size());
  loop_sequences_.resize(wanted_.size());
  last_sequences_.resize(wanted_.size());
}

bool Replay::set_range(config::Problems& problems) {
  const Time begin = reader_->begin();
  from_ = begin + options_.start.value_or(Duration(0));
  to_ = options_.end ? std::min(begin + *options_.end, reader_->end()) : reader_->end();
  try {
    rewind();
    load();
  } catch (const mcap::Error& error) {
    problems.add(config::make_error({}, error.what()));
    return false;
  }
  if (moment_.empty() || from_ > to_) {
    const auto seconds = [](Duration span) { return std::chrono::duration<double>(span).count(); };
    problems.add(config::make_error(
        place_of(options_.files.front()),
        fmt::format("there is nothing to feed from {} s to {} s: the recording has {} s",
                    seconds(from_ - begin), seconds(to_ - begin),
                    seconds(reader_->end() - begin))));
    return false;
  }
  return true;
}

Time Replay::begin_of_timers() const {
  // A part starts its timers at its own beginning.
  return from_ == reader_->begin() ? reader_->begin_of_timers() : from_;
}

Duration Replay::position(Time now) const {
  const Duration passed = now - from_;
  const bool goes_round = options_.is_looped && length() > Duration(0);
  return from_ - reader_->begin() + (goes_round ? passed % length() : passed);
}

const ComponentClass* Replay::find(const config::ComponentDescription& component,
                                   config::Problems& problems) {
  return plan_.runs(component.name) ? classes_.find(component, problems) : &stand_in_class();
}

void Replay::declare(detail::ComponentCore& component) {
  for (std::size_t i = 0; i < plan_.streams.size(); ++i) {
    const ReplayPlan::Stream& stream = plan_.streams[i];
    if (stream.component == component.name) {
      if (stream.topic.ends_with(detail::kRequestTopic)) {
        component.application.wiring().topics().set_options(stream.topic,
                                                            detail::kRequestTopicOptions);
      }
      publishers_[i] = &fastcycle::detail::declare_publisher(component, stream.topic,
                                                             *prototypes_[i], nullptr, true);
    }
  }
}

void Replay::explain(std::map<std::string, std::string>& facts) const {
  // Live, the clock is running already; the messages fed first keep their times.
  facts["start_ns"] = std::to_string(base::to_ns(from_));
  for (std::size_t i = 0; i < options_.files.size(); ++i) {
    facts[fmt::format("replay.{}", i)] = options_.files[i].string();
  }
}

// ---- Next messages ----

void Replay::rewind() {
  reader_->rewind({.wanted = wanted_, .from = from_, .to = to_});
  moment_ = {};
  next_ = 0;
}

/// Keeps latched messages that were published before the beginning and still valid then.
void Replay::keep_latched() {
  latched_.clear();
  std::vector<std::size_t> counts(wanted_.size());
  std::vector<bool> wanted(wanted_.size());
  for (std::size_t i = 0; i < wanted_.size(); ++i) {
    counts[i] = wanted_[i] ? publishers_[i]->options.latched : 0;
    wanted[i] = counts[i] > 0;
  }
  if (from_ <= reader_->begin() || std::ranges::find(wanted, true) == wanted.end()) {
    return;
  }
  std::vector<std::deque<record::RecordedMessage>> kept(wanted_.size());
  reader_->rewind({.wanted = wanted, .from = reader_->begin(), .to = from_ - Duration(1)});
  for (auto moment = reader_->next(); !moment.empty(); moment = reader_->next()) {
    for (record::RecordedMessage& message : moment) {
      auto& last = kept[message.stream];
      last.push_back(std::move(message));
      if (last.size() > counts[last.back().stream]) {
        last.pop_front();
      }
    }
  }
  for (auto& last : kept) {
    for (record::RecordedMessage& message : last) {
      message.due = from_;
      message.step = 0;
      latched_.push_back(std::move(message));
    }
  }
}

std::span<record::RecordedMessage> Replay::read_moment() {
  const auto moment = reader_->next();
  // Without a message since its beginning a loop would never end.
  const bool had_any = last_sequences_ != loop_sequences_;
  if (!moment.empty() || !options_.is_looped || !had_any) {
    return moment;
  }
  loop_shift_ += length();
  loop_sequences_ = last_sequences_;
  rewind();
  return reader_->next();
}

void Replay::load() {
  bool is_passed_over_whole = false;
  do {
    next_ = 0;
    moment_ = read_moment();
    const auto passed_over = std::ranges::remove_if(
        moment_, [this](const auto& message) { return is_passed_over(message); });
    is_passed_over_whole = !moment_.empty() && passed_over.size() == moment_.size();
    moment_ = moment_.first(moment_.size() - passed_over.size());
  } while (is_passed_over_whole);
  for (record::RecordedMessage& message : moment_) {
    shift(message);
  }
}

/// Messages published while the run stopped are fed only if this run stops too.
bool Replay::is_passed_over(const record::RecordedMessage& message) const {
  const bool stops_alike = clock_ == nullptr || clock_->is_simulated();
  return message.step >= kStopSteps && (options_.is_looped || !stops_alike);
}

/// Renumbers a message of a later loop after those of the loops before.
void Replay::shift(record::RecordedMessage& message) const {
  message.due += loop_shift_;
  message.info.sequence += loop_sequences_[message.stream];
  message.info.publish_time += loop_shift_;
  message.info.origin.taken += loop_shift_;
}

void Replay::start(const base::Clock& clock, detail::LogSource& log,
                   std::function<void(ReplayEnd)> ended) {
  clock_ = &clock;
  log_ = &log;
  ended_ = std::move(ended);
  try {
    keep_latched();
    rewind();
    if (!clock.is_simulated()) {
      return;
    }
    if (latched_.empty()) {
      load();
    } else {
      moment_ = latched_;
    }
  } catch (const mcap::Error& error) {
    fail(error.what());
  }
}

detail::Envelope* Replay::make(const record::RecordedMessage& message) {
  detail::PublisherCore& publisher = *publishers_[message.stream];
  detail::Envelope* loan = fastcycle::detail::take_external_loan(publisher, false);
  if (loan->own->ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    return loan;
  }
  fastcycle::detail::return_external_loan(publisher, loan);
  fail(fmt::format("topic \"{}\", message {}: expected a {}, found {} bytes that are none",
                   publisher.topic.name, message.info.sequence, publisher.topic.type,
                   message.data.size()));
  return nullptr;
}

void Replay::publish(const record::RecordedMessage& message) {
  if (detail::Envelope* loan = make(message)) {
    send(message, loan);
  }
}

void Replay::send(const record::RecordedMessage& message, detail::Envelope* loan) {
  publishers_[message.stream]->publish_again(loan, message.info);
  last_sequences_[message.stream] = message.info.sequence;
  ++fed_[message.stream];
}

void Replay::fail(const std::string& what) {
  has_failed_ = true;
  moment_ = {};
  log_->write(LogLevel::kError, "replay", what);
  ended_(ReplayEnd::kFailed);
}

// ---- Simulated time ----

std::int64_t Replay::next_due_ns() const noexcept {
  return moment_.empty() ? base::kNever : base::to_ns(moment_[next_].due);
}

std::uint32_t Replay::next_step() const noexcept {
  return moment_.empty() ? 0 : moment_[next_].step;
}

void Replay::put(Time now, std::uint32_t step) {
  const auto is_due = [&] {
    return !moment_.empty() &&
           (moment_[next_].due < now || (moment_[next_].due == now && moment_[next_].step <= step));
  };
  try {
    while (is_due()) {
      publish(moment_[next_]);
      if (++next_ >= moment_.size() && !has_failed_) {
        load();
      }
    }
  } catch (const mcap::Error& error) {
    fail(error.what());
  }
}

// ---- Live ----

void Replay::start_thread(std::vector<base::Refusal>& refusals) {
  if (has_failed_) {
    return;
  }
  thread_ = base::Thread({.name = "replay", .cpus = {}}, [this] { play_live(); }, refusals);
  has_thread_ = true;
}

void Replay::stop() {
  is_stopping_ = true;
  sleepers_.wake(0);
  if (std::exchange(has_thread_, false)) {
    thread_.join();
  }
}

bool Replay::wait_until(Time time) {
  const std::int64_t until_ns = clock_->monotonic_at(time);
  while (!is_stopping_ && base::monotonic_ns() < until_ns) {
    sleepers_.announce(0);
    if (is_stopping_) {
      sleepers_.withdraw(0);
    } else {
      sleepers_.sleep(0, until_ns);
    }
  }
  return !is_stopping_;
}

void Replay::play_on_time(const record::RecordedMessage& message) {
  // Built before its time has come: that may take long.
  detail::Envelope* loan = make(message);
  if (loan == nullptr) {
    return;
  }
  if (!wait_until(message.due)) {
    fastcycle::detail::return_external_loan(*publishers_[message.stream], loan);
    return;
  }
  send(message, loan);
  const Time should = std::max(message.due, clock_->at_monotonic(thread_began_ns_));
  worst_lateness_ = std::max(worst_lateness_, clock_->now() - should);
}

void Replay::play_live() {
  thread_began_ns_ = base::monotonic_ns();
  try {
    for (const record::RecordedMessage& message : latched_) {
      play_on_time(message);
    }
    ReadAhead ahead(*reader_);
    for (auto message = ahead.next(); message && !is_stopping_ && !has_failed_;
         message = ahead.next()) {
      if (!is_passed_over(*message)) {
        play_on_time(*message);
      }
    }
  } catch (const mcap::Error& error) {
    fail(error.what());
  }
  if (!has_failed_ && wait_until(to_)) {
    ended_(ReplayEnd::kOver);
  }
}

}  // namespace fastcycle::host
