#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "estimate/model.h"

namespace fastcycle::estimate {

/// Runs a `System` in virtual time by the rules of `src/executor`: turns, passes over ready
/// components, one worker a component, sleepers that are woken, timers, queues; on CPUs that take
/// turns at threads as badly as they like without idling. Knows nothing of the analysis.
class Simulator {
 public:
  struct Options {
    std::uint64_t seed = 0;
    bool is_worst = false;        ///< Run times and wake-ups as long as they may be.
    bool begins_at_once = false;  ///< All sources and timers at the same moment.
  };

  Simulator(const System& system, const Options& options)
      : system_(system), options_(options), random_(options.seed) {
    for (std::size_t e = 0; e < system.executors.size(); ++e) {
      for (unsigned i = 0; i < system.executors[e].threads; ++i) {
        workers_.push_back({.executor = e});
      }
    }
    components_.resize(system.components.size());
    lanes_.resize(system.callbacks.size());
    held_sets_.resize(system.callbacks.size());
    oldest_.resize(system.chains.size());
    for (std::size_t c = 0; c < system.callbacks.size(); ++c) {
      if (system.callbacks[c].inputs.empty()) {
        const Ns period = system.callbacks[c].arrivals->period.count();
        timers_.push_back({c, begin_of(period)});
      }
    }
    for (std::size_t s = 0; s < system.sources.size(); ++s) {
      const Arrivals& arrivals = *system.sources[s].arrivals;
      sources_.push_back({.regular = begin_of(arrivals.period.count())});
      plan(s);
    }
  }

  void run(Duration length) {
    const Ns end = length.count();
    while (now_ < end) {
      release();
      // Whoever can go on goes on, until all wait for time.
      for (bool goes = true; goes;) {
        goes = false;
        for (Worker& worker : workers_) {
          goes |= step(worker);
        }
      }
      assign_cpus();
      advance();
    }
  }

  /// Of each chain: the largest age at the begin of a callback of its last topic.
  [[nodiscard]] std::optional<Duration> oldest(std::size_t chain) const { return oldest_[chain]; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  using Ns = std::int64_t;
  static constexpr Ns kNever = INT64_MAX;

  struct Message {
    Ns published = 0;
    Ns taken = 0;                          ///< Of the oldest measurement.
    std::map<std::size_t, Ns> roots = {};  ///< Topic where a chain begins → when it was taken.
  };
  struct Lane {
    std::size_t publisher = 0;
    std::size_t input = 0;
    std::deque<Message> waiting = {};
  };
  struct Timer {
    std::size_t callback;
    Ns due;
  };
  struct SourceState {
    Ns regular = 0;
    Ns next = 0;
  };
  struct ComponentState {
    bool is_ready = false;   ///< Its bit in the ready mask.
    bool is_marked = false;  ///< Its state word is not 0, beside running.
    bool is_running = false;
    std::map<std::size_t, Ns> held = {};
    std::map<std::size_t, std::map<std::size_t, Ns>> views = {};  ///< Topic → roots, not seen yet.
  };
  struct Call {
    std::size_t callback = 0;
    Message cause = {};
    bool has_cause = false;
    Ns begin = 0;
    Ns left = 0;        ///< CPU time until it returns.
    Ns publish_at = 0;  ///< Of CPU time left, when it publishes.
    bool has_published = false;
    std::map<std::size_t, Ns> own = {};  ///< Roots of the cause itself.
    bool is_silent = false;              ///< A member of a set that is not complete.
  };
  enum class State { kAsleep, kWaking, kAwake, kTurn };
  struct Worker {
    std::size_t executor = 0;
    State state = State::kAwake;
    Ns wakes_at = 0;
    std::deque<std::size_t> pass = {};
    bool has_run = false;
    std::size_t component = 0;
    int count = 0;
    Ns turn_began = 0;
    std::optional<Call> call = {};
    bool has_cpu = false;
  };

  Ns upto(Ns limit) {
    return limit <= 0 ? 0 : std::uniform_int_distribution<Ns>(0, limit)(random_);
  }
  bool often() { return upto(3) != 0; }
  Ns begin_of(Ns period) { return options_.begins_at_once ? 1'000'000 : 1'000'000 + upto(period); }
  Ns wake_time() {
    return options_.is_worst ? system_.wake_up.count() : upto(system_.wake_up.count());
  }

  void plan(std::size_t s) {
    const Ns jitter = system_.sources[s].arrivals->jitter.count();
    // As late as may be, then in time, is how they come closest together.
    const Ns late = upto(2) == 0 ? jitter : upto(1) == 0 ? 0 : upto(jitter);
    sources_[s].next = std::max(sources_[s].next, sources_[s].regular + late);
  }

  /// What happens at the present time without any worker.
  void release() {
    for (std::size_t s = 0; s < sources_.size(); ++s) {
      while (sources_[s].next <= now_) {
        const Source& source = system_.sources[s];
        for (std::uint64_t i = 0; i < source.arrivals->burst; ++i) {
          const Ns taken =
              now_ - (options_.is_worst ? source.age.count() : upto(source.age.count()));
          Message message{.published = now_, .taken = taken};
          message.roots[source.topic] = taken;
          deliver(source.topic, system_.callbacks.size() + s, message, nullptr);
        }
        sources_[s].regular += source.arrivals->period.count();
        plan(s);
      }
    }
    for (const Timer& timer : timers_) {
      const std::size_t component = system_.callbacks[timer.callback].component;
      const ComponentState& state = components_[component];
      if (timer.due <= now_ && !state.is_marked && !state.is_running) {
        // Who sleeps and watches the timers wakes for it.
        const std::size_t executor = system_.components[component].executor;
        Worker* sleeper = sleeping(executor);
        const bool is_awaited = std::ranges::any_of(workers_, [&](const Worker& worker) {
          return worker.executor == executor && worker.state == State::kWaking;
        });
        if (sleeper != nullptr && !is_awaited) {
          wake(*sleeper, wake_time() * (system_.executors[executor].threads > 1 ? 2 : 1));
        }
      }
    }
  }

  Worker* sleeping(std::size_t executor) {
    for (Worker& worker : workers_) {
      if (worker.executor == executor && worker.state == State::kAsleep) {
        return &worker;
      }
    }
    return nullptr;
  }
  void wake(Worker& worker, Ns time) {
    worker.state = State::kWaking;
    worker.wakes_at = now_ + time;
  }
  void wake_one(std::size_t executor) {
    if (Worker* sleeper = sleeping(executor)) {
      wake(*sleeper, wake_time());
    }
  }
  bool has_ready(std::size_t executor) const {
    for (std::size_t c = 0; c < components_.size(); ++c) {
      if (components_[c].is_ready && system_.components[c].executor == executor) {
        return true;
      }
    }
    return false;
  }

  void mark(std::size_t component, const Worker* by) {
    ComponentState& state = components_[component];
    if (state.is_marked || state.is_running) {
      state.is_marked = true;
      return;
    }
    state.is_marked = true;
    state.is_ready = true;
    const std::size_t executor = system_.components[component].executor;
    if (by == nullptr || by->executor != executor || !system_.executors[executor].hand_over) {
      wake_one(executor);
    }
  }

  void deliver(std::size_t topic, std::size_t publisher, const Message& message, const Worker* by) {
    for (std::size_t c = 0; c < system_.callbacks.size(); ++c) {
      const Callback& callback = system_.callbacks[c];
      for (std::size_t k = 0; k < callback.inputs.size(); ++k) {
        if (callback.inputs[k].topic != topic) {
          continue;
        }
        Lane* lane = nullptr;
        for (Lane& other : lanes_[c]) {
          if (other.publisher == publisher && other.input == k) {
            lane = &other;
          }
        }
        if (lane == nullptr) {
          lane = &lanes_[c].emplace_back(Lane{publisher, k});
        }
        lane->waiting.push_back(message);
        if (lane->waiting.size() > callback.inputs[k].depth) {
          lane->waiting.pop_front();
          ++lost_;
        }
        mark(callback.component, by);
      }
    }
    for (const View& view : system_.views) {
      if (view.topic == topic && view.ages) {
        components_[view.component].views[topic] = message.roots;
      }
    }
  }

  /// Sets the bits of components with due timers, as workers do between turns; wakes nobody.
  void fire_timers(std::size_t executor) {
    for (const Timer& timer : timers_) {
      const std::size_t component = system_.callbacks[timer.callback].component;
      ComponentState& state = components_[component];
      if (timer.due <= now_ && system_.components[component].executor == executor &&
          !state.is_marked) {
        state.is_ready = !state.is_running;
        state.is_marked = true;
      }
    }
  }

  /// One step that takes no time; false if the worker waits for time.
  bool step(Worker& worker) {
    switch (worker.state) {
      case State::kAsleep:
        return false;
      case State::kWaking:
        if (worker.wakes_at > now_) {
          return false;
        }
        worker.state = State::kAwake;
        worker.pass.clear();
        worker.has_run = true;  // It looks once before it sleeps again.
        fire_timers(worker.executor);
        return true;
      case State::kAwake:
        return look(worker);
      case State::kTurn:
        return serve(worker);
    }
    return false;
  }

  bool look(Worker& worker) {
    while (!worker.pass.empty()) {
      const std::size_t component = worker.pass.front();
      worker.pass.pop_front();
      ComponentState& state = components_[component];
      if (!state.is_ready) {
        continue;
      }
      state.is_ready = false;
      if (system_.executors[worker.executor].threads > 1 && has_ready(worker.executor)) {
        wake_one(worker.executor);
      }
      state.is_running = true;
      state.is_marked = false;
      worker.state = State::kTurn;
      worker.component = component;
      worker.count = 0;
      worker.turn_began = now_;
      worker.has_run = true;
      return true;
    }
    fire_timers(worker.executor);
    if (has_ready(worker.executor)) {
      for (std::size_t c = 0; c < components_.size(); ++c) {
        if (components_[c].is_ready && system_.components[c].executor == worker.executor) {
          worker.pass.push_back(c);
        }
      }
      worker.has_run = false;
      return true;
    }
    worker.state = State::kAsleep;
    worker.has_cpu = false;
    return true;
  }

  bool serve(Worker& worker) {
    if (worker.call) {
      Call& call = *worker.call;
      if (!call.has_published && call.left <= call.publish_at) {
        call.has_published = true;
        publish(worker);
        return true;
      }
      if (call.left > 0) {
        return false;
      }
      finish(worker);
      return true;
    }
    ComponentState& state = components_[worker.component];
    if (worker.count == 16 || now_ - worker.turn_began > 1'000'000) {
      state.is_running = false;
      state.is_marked = has_something(worker.component);
      state.is_ready = state.is_marked;
      end_turn(worker);
      return true;
    }
    if (take_next(worker)) {
      ++worker.count;
      return true;
    }
    state.is_running = false;
    state.is_marked = false;
    end_turn(worker);
    return true;
  }

  void end_turn(Worker& worker) {
    worker.state = State::kAwake;
    fire_timers(worker.executor);
  }

  bool has_something(std::size_t component) const {
    for (std::size_t c = 0; c < system_.callbacks.size(); ++c) {
      if (system_.callbacks[c].component == component) {
        for (const Lane& lane : lanes_[c]) {
          if (!lane.waiting.empty()) {
            return true;
          }
        }
      }
    }
    return std::ranges::any_of(timers_, [&](const Timer& timer) {
      return system_.callbacks[timer.callback].component == component && timer.due <= now_;
    });
  }

  /// Begins the oldest of what waits for the worker's component.
  bool take_next(Worker& worker) {
    Ns oldest = kNever;
    std::size_t its_callback = 0;
    Lane* its_lane = nullptr;
    for (std::size_t c = 0; c < system_.callbacks.size(); ++c) {
      if (system_.callbacks[c].component != worker.component) {
        continue;
      }
      for (Lane& lane : lanes_[c]) {
        if (!lane.waiting.empty() && lane.waiting.front().published < oldest) {
          oldest = lane.waiting.front().published;
          its_callback = c;
          its_lane = &lane;
        }
      }
    }
    for (Timer& timer : timers_) {
      if (system_.callbacks[timer.callback].component == worker.component && timer.due <= now_ &&
          timer.due <= oldest) {
        begin(worker, timer.callback, nullptr, 0);
        const Ns period = system_.callbacks[timer.callback].arrivals->period.count();
        timer.due += ((now_ - timer.due) / period + 1) * period;
        return true;
      }
    }
    if (its_lane == nullptr) {
      return false;
    }
    const Message message = its_lane->waiting.front();
    its_lane->waiting.pop_front();
    begin(worker, its_callback, &message, its_lane->input);
    return true;
  }

  void begin(Worker& worker, std::size_t callback, const Message* message, std::size_t input) {
    const Callback& its = system_.callbacks[callback];
    Call call{.callback = callback, .begin = now_};
    ComponentState& state = components_[its.component];
    for (const auto& [topic, roots] : state.views) {
      hold(state, roots);
    }
    state.views.clear();
    if (message != nullptr) {
      for (std::size_t i = 0; i < system_.chains.size(); ++i) {
        const Chain& chain = system_.chains[i];
        const auto root = message->roots.find(chain.from);
        if (its.inputs[input].topic == chain.to && root != message->roots.end()) {
          const Duration age(now_ - root->second);
          oldest_[i] = std::max(oldest_[i].value_or(Duration()), age);
        }
      }
      call.cause = *message;
      call.has_cause = true;
      if (its.joining != Joining::kEach) {
        call.is_silent = !complete(callback, input, call.cause);
      }
      // What it does not know it inherits from what was received before.
      call.own = call.cause.roots;
      for (const auto& [root, taken] : state.held) {
        call.cause.roots.try_emplace(root, taken);
      }
    } else {
      call.cause.roots = state.held;
      call.cause.taken = now_;
      for (const auto& [root, taken] : state.held) {
        call.cause.taken = std::min(call.cause.taken, taken);
      }
    }
    const Ns longest = its.run_time->count();
    call.left = options_.is_worst || often() ? longest : upto(longest);
    call.publish_at = options_.is_worst || often() ? 0 : upto(call.left);
    worker.call = call;
  }

  /// Exact sets by the time when they were taken. The cause becomes that of the set.
  bool complete(std::size_t callback, std::size_t input, Message& cause) {
    const std::size_t members = system_.callbacks[callback].inputs.size();
    auto& sets = held_sets_[callback][cause.taken];
    sets.resize(members);
    sets[input] = cause;
    if (!std::ranges::all_of(sets, [](const auto& member) { return member.has_value(); })) {
      return false;
    }
    for (const auto& member : sets) {
      for (const auto& [root, taken] : member->roots) {
        const auto known = cause.roots.find(root);
        cause.roots[root] = known == cause.roots.end() ? taken : std::min(known->second, taken);
      }
    }
    const Ns taken = cause.taken;
    held_sets_[callback].erase(taken);
    return true;
  }

  static void hold(ComponentState& state, const std::map<std::size_t, Ns>& roots) {
    for (const auto& [root, taken] : roots) {
      const auto known = state.held.find(root);
      state.held[root] = known == state.held.end() ? taken : std::max(known->second, taken);
    }
  }

  void publish(const Worker& worker) {
    const Call& call = *worker.call;
    if (call.is_silent) {
      return;
    }
    for (const Publication& publication : system_.callbacks[call.callback].publishes) {
      for (std::uint64_t i = 0; i < publication.messages; ++i) {
        Message message{.published = now_, .taken = call.cause.taken, .roots = call.cause.roots};
        if (std::ranges::any_of(system_.chains, [&](const Chain& chain) {
              return chain.from == publication.topic;
            })) {
          message.roots[publication.topic] = call.begin;
        }
        deliver(publication.topic, call.callback, message, &worker);
      }
    }
  }

  void finish(Worker& worker) {
    const Call& call = *worker.call;
    if (call.has_cause && !call.is_silent) {
      hold(components_[worker.component], call.own);
    }
    worker.call.reset();
  }

  // ---- CPUs ----

  bool may_use(const Worker& worker, int cpu) const {
    const std::vector<int>& cpus = system_.executors[worker.executor].cpus;
    return cpus.empty() || std::ranges::find(cpus, cpu) != cpus.end();
  }

  /// Gives each CPU to somebody who may use it, higher priorities first, others by luck: no CPU is
  /// idle that somebody waits for.
  void assign_cpus() {
    const bool is_new_slice = now_ >= slice_end_;
    if (is_new_slice) {
      slice_end_ = now_ + 100'000 + upto(4'000'000);
    }
    std::vector<Worker*> wanting;
    for (Worker& worker : workers_) {
      if (worker.state == State::kTurn) {
        wanting.push_back(&worker);
      } else {
        worker.has_cpu = false;
      }
    }
    std::ranges::shuffle(wanting, random_);
    std::ranges::sort(wanting, [&](const Worker* a, const Worker* b) {
      const int its_a = system_.executors[a->executor].priority;
      const int its_b = system_.executors[b->executor].priority;
      // Within a slice who has a CPU keeps it.
      return its_a != its_b ? its_a > its_b : !is_new_slice && a->has_cpu && !b->has_cpu;
    });
    std::vector<bool> is_taken(system_.cpus);
    for (Worker* worker : wanting) {
      worker->has_cpu = false;
      for (int cpu = 0; cpu < static_cast<int>(system_.cpus); ++cpu) {
        if (!is_taken[static_cast<std::size_t>(cpu)] && may_use(*worker, cpu)) {
          is_taken[static_cast<std::size_t>(cpu)] = true;
          worker->has_cpu = true;
          break;
        }
      }
    }
  }

  /// To the next moment at which anything happens.
  void advance() {
    Ns next = kNever;
    for (const SourceState& source : sources_) {
      next = std::min(next, source.next);
    }
    for (const Timer& timer : timers_) {
      if (timer.due > now_) {
        next = std::min(next, timer.due);
      }
    }
    bool is_crowded = false;
    for (const Worker& worker : workers_) {
      if (worker.state == State::kWaking) {
        next = std::min(next, worker.wakes_at);
      } else if (worker.state == State::kTurn && worker.call) {
        is_crowded |= !worker.has_cpu;
        if (worker.has_cpu) {
          const Call& call = *worker.call;
          const Ns target = call.has_published ? 0 : call.publish_at;
          next = std::min(next, now_ + call.left - target);
        }
      }
    }
    if (is_crowded) {
      next = std::min(next, slice_end_);
    }
    for (Worker& worker : workers_) {
      if (worker.state == State::kTurn && worker.has_cpu && worker.call) {
        worker.call->left -= next - now_;
      }
    }
    now_ = next;
  }

  const System& system_;
  const Options options_;
  std::mt19937_64 random_;
  Ns now_ = 0;
  Ns slice_end_ = 0;
  std::vector<Worker> workers_;
  std::vector<ComponentState> components_;
  std::vector<std::vector<Lane>> lanes_;
  std::vector<Timer> timers_;
  std::vector<SourceState> sources_;
  std::vector<std::map<Ns, std::vector<std::optional<Message>>>> held_sets_;
  std::vector<std::optional<Duration>> oldest_;
  std::uint64_t lost_ = 0;
};

}  // namespace fastcycle::estimate
