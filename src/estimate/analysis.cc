#include "estimate/analysis.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "estimate/duration_text.h"
#include "estimate/load.h"

namespace fastcycle::estimate {
namespace {

/// Largest first.
void sort_by_time(std::vector<Hindrance>& hindrances) {
  std::ranges::sort(hindrances, [](const Hindrance& a, const Hindrance& b) {
    return std::pair(b.time, a.component) < std::pair(a.time, b.component);
  });
}

/// Beyond so many streams into one callback, those of equal period are looked at as one.
constexpr std::size_t kManyStreams = 16;
/// Beyond so many rounds, what still grows is taken to grow without end.
constexpr int kMaxRounds = 100;
/// Ways from one topic to another that are looked at.
constexpr std::size_t kMaxWays = 20'000;

using Streams = std::vector<Arrivals>;

/// Puts streams of equal period together where there are many; the result allows what they did.
void merge(Streams& streams) {
  if (streams.size() <= kManyStreams) {
    return;
  }
  std::map<Duration, Arrivals> by_period;
  for (const Arrivals& stream : streams) {
    auto& merged =
        by_period.try_emplace(stream.period, Arrivals{stream.period, {}, 0}).first->second;
    merged.jitter = std::max(merged.jitter, stream.jitter);
    merged.burst += stream.burst;
  }
  streams.clear();
  for (const auto& [period, stream] : by_period) {
    streams.push_back(stream);
  }
}

/// The system's graph, and bounds of the response of each component.
class Analysis {
 public:
  explicit Analysis(const System& system) : system_(system) {
    find_graph();
    find_order();
    find_responses();
  }

  [[nodiscard]] ChainEstimate judge(const Chain& chain) const;
  [[nodiscard]] Estimate estimate() const;

 private:
  /// A way that is walked: how old a message is there.
  struct Way {
    Duration age{};
    Duration running{};
    /// Longest time from one message to the next, where the age last began; none: not known.
    std::optional<Duration> gap = {};
    std::string no_gap = {};
    /// Each message comes from where the chain begins: no other takes its place in a view.
    bool is_pure = true;
    std::vector<Hop> hops = {};
  };
  /// Of one chain, while its ways are walked.
  struct Walk {
    const Chain& chain;
    ChainEstimate result;
    std::vector<bool> is_visited;
    std::vector<bool> is_sampled;      ///< Visited by messages that its component holds.
    std::vector<bool> always_carries;  ///< Topics whose messages all carry the root by themselves.
    std::size_t ways = 0;
    std::set<std::string> obstacles = {};
  };

  void find_graph();
  void find_order();
  void visit(std::size_t callback, std::vector<int>& marks, std::vector<std::size_t>& way);
  void find_responses();
  void find_streams();
  void forget(std::size_t component, const std::string& why);
  [[nodiscard]] std::string why_unbounded(std::size_t callback) const;

  [[nodiscard]] Duration run_time(std::size_t callback) const {
    return system_.callbacks[callback].run_time.value_or(Duration());
  }
  [[nodiscard]] Duration response(std::size_t callback) const {
    return responses_[system_.callbacks[callback].component];
  }
  [[nodiscard]] bool is_bounded(std::size_t callback) const {
    return is_bounded_[system_.callbacks[callback].component];
  }
  [[nodiscard]] std::optional<Duration> gap_of(std::size_t callback) const;
  [[nodiscard]] bool has_input(std::size_t component) const;
  [[nodiscard]] std::optional<Duration> topic_age(std::size_t topic,
                                                  std::vector<bool>& visited) const;

  void walk_topic(Walk& walk, const Way& way, std::size_t topic) const;
  void walk_into(Walk& walk, Way way, std::size_t callback, std::size_t input) const;
  void walk_on(Walk& walk, const Way& way, std::size_t callback) const;
  [[nodiscard]] std::vector<bool> find_carriers(std::size_t root) const;
  [[nodiscard]] bool inherits(std::size_t callback, const std::vector<bool>& carries) const;
  void sample(Walk& walk, const Way& way, std::size_t component) const;
  void end_in_view(Walk& walk, Way way, std::size_t component) const;
  void end(Walk& walk, const Way& way) const;
  bool add_hop(Walk& walk, Way& way, std::size_t callback, Duration held) const;
  void check_queue(Walk& walk, std::size_t callback, std::size_t input) const;
  void conclude(Walk& walk) const;

  const System& system_;
  std::vector<std::vector<std::size_t>> publishers_;  ///< Of each topic: callbacks.
  std::vector<std::vector<std::size_t>> callbacks_;   ///< Of each component.
  std::vector<std::size_t> place_;                    ///< Of a callback in its component.
  std::vector<std::size_t> order_;                    ///< Callbacks, each after those that call it.
  std::vector<std::string> unknown_;      ///< Why nothing bounds how often a callback is called.
  std::vector<Streams> streams_;          ///< By callback.
  std::vector<Demand> demands_;           ///< By component.
  std::vector<bool> is_known_;            ///< By component: its demand is bounded.
  std::vector<bool> is_bounded_;          ///< By component: its response is.
  std::vector<std::string> obstacles_;    ///< By component: why its response is not bounded.
  std::vector<Duration> responses_;       ///< By component.
  std::vector<Waiting::Result> details_;  ///< By component.
};

void Analysis::find_graph() {
  publishers_.resize(system_.topics.size());
  callbacks_.resize(system_.components.size());
  for (std::size_t i = 0; i < system_.callbacks.size(); ++i) {
    const Callback& callback = system_.callbacks[i];
    place_.push_back(callbacks_[callback.component].size());
    callbacks_[callback.component].push_back(i);
    for (const Publication& publication : callback.publishes) {
      publishers_[publication.topic].push_back(i);
    }
  }
}

void Analysis::visit(std::size_t callback, std::vector<int>& marks, std::vector<std::size_t>& way) {
  if (marks[callback] == 2) {
    return;
  }
  way.push_back(callback);
  if (marks[callback] == 1) {
    std::string circle;
    for (auto it = std::ranges::find(way, callback); it != way.end(); ++it) {
      circle +=
          (circle.empty() ? "" : " → ") + system_.components[system_.callbacks[*it].component].name;
    }
    // Against the way of the messages.
    unknown_[callback] = "messages go round in a circle (" + circle + ", backwards)";
    way.pop_back();
    return;
  }
  marks[callback] = 1;
  for (const Input& input : system_.callbacks[callback].inputs) {
    for (const std::size_t publisher : publishers_[input.topic]) {
      visit(publisher, marks, way);
    }
  }
  way.pop_back();
  marks[callback] = 2;
  order_.push_back(callback);
}

void Analysis::find_order() {
  unknown_.resize(system_.callbacks.size());
  std::vector<int> marks(system_.callbacks.size());
  std::vector<std::size_t> way;
  for (std::size_t i = 0; i < system_.callbacks.size(); ++i) {
    visit(i, marks, way);
  }
  for (std::size_t i = 0; i < system_.callbacks.size(); ++i) {
    const Callback& callback = system_.callbacks[i];
    if (callback.inputs.empty() && !callback.arrivals && unknown_[i].empty()) {
      unknown_[i] = "the rate of " + callback.name + " of \"" +
                    system_.components[callback.component].name + "\" is unknown";
    }
    for (const Input& input : callback.inputs) {
      for (const Source& source : system_.sources) {
        if (source.topic == input.topic && !source.arrivals && unknown_[i].empty()) {
          unknown_[i] = "the rate of \"" + system_.topics[input.topic] + "\" from " + source.name +
                        " is unknown";
        }
      }
    }
  }
  // Callbacks with unknown causes are unknown themselves. Twice, since cycles have no order.
  for (int pass = 0; pass < 2; ++pass) {
    for (const std::size_t i : order_) {
      for (const Input& input : system_.callbacks[i].inputs) {
        for (const std::size_t publisher : publishers_[input.topic]) {
          if (unknown_[i].empty()) {
            unknown_[i] = unknown_[publisher];
          }
        }
      }
    }
  }
}

void Analysis::find_streams() {
  for (const std::size_t i : order_) {
    const Callback& callback = system_.callbacks[i];
    if (!is_known_[callback.component]) {
      continue;
    }
    Streams streams;
    if (callback.arrivals) {
      streams.push_back(*callback.arrivals);
    }
    for (const Input& input : callback.inputs) {
      for (const Source& source : system_.sources) {
        if (source.topic == input.topic && source.arrivals) {
          streams.push_back(*source.arrivals);
        }
      }
      for (const std::size_t publisher : publishers_[input.topic]) {
        for (const Publication& publication : system_.callbacks[publisher].publishes) {
          if (publication.topic != input.topic) {
            continue;
          }
          for (Arrivals stream : streams_[publisher]) {
            // Published at any time from the cause to the end of the callback.
            stream.jitter += response(publisher);
            stream.burst *= publication.messages;
            streams.push_back(stream);
          }
        }
      }
    }
    merge(streams);
    streams_[i] = streams;
    demands_[callback.component].arrivals[place_[i]] = std::move(streams);
  }
}

void Analysis::forget(std::size_t component, const std::string& why) {
  if (!is_bounded_[component]) {
    return;
  }
  is_bounded_[component] = false;
  is_known_[component] = false;  // Its backlog when another component begins to wait is unbounded.
  obstacles_[component] = why;
  // How far apart the messages are that follow from it is not known any more.
  for (const std::size_t i : callbacks_[component]) {
    for (const Publication& publication : system_.callbacks[i].publishes) {
      for (std::size_t k = 0; k < system_.callbacks.size(); ++k) {
        const Callback& called = system_.callbacks[k];
        const bool is_called = std::ranges::any_of(
            called.inputs, [&](const Input& input) { return input.topic == publication.topic; });
        if (is_called && unknown_[k].empty()) {
          unknown_[k] = why;
          forget(called.component, why);
        }
      }
    }
  }
}

void Analysis::find_responses() {
  const std::size_t count = system_.components.size();
  streams_.resize(system_.callbacks.size());
  demands_.resize(count);
  responses_.resize(count);
  details_.resize(count);
  obstacles_.resize(count);
  is_known_.assign(count, true);
  is_bounded_.assign(count, true);
  for (std::size_t c = 0; c < count; ++c) {
    demands_[c].arrivals.resize(callbacks_[c].size());
    for (const std::size_t i : callbacks_[c]) {
      demands_[c].run_times.push_back(run_time(i));
      if (!unknown_[i].empty()) {
        is_known_[c] = false;
      }
    }
  }
  // Without a run time a turn is unbounded, and so are components that may wait for it.
  for (std::size_t i = 0; i < system_.callbacks.size(); ++i) {
    const Callback& callback = system_.callbacks[i];
    if (callback.run_time) {
      continue;
    }
    const std::string why = "the run time of " + callback.name + " of \"" +
                            system_.components[callback.component].name + "\" is unknown";
    is_known_[callback.component] = false;
    for (std::size_t c = 0; c < count; ++c) {
      if (system_.components[c].executor == system_.components[callback.component].executor) {
        forget(c, why);
      }
    }
  }
  for (std::size_t c = 0; c < count; ++c) {
    for (const std::size_t i : callbacks_[c]) {
      if (!unknown_[i].empty()) {
        forget(c, unknown_[i]);
      }
    }
  }
  for (std::size_t c = 0; c < count; ++c) {
    find_streams();
    if (is_known_[c] && demands_[c].utilization() > 1.0) {
      forget(c, fmt::format("\"{}\" has work for {:.0f} % of the time of one worker",
                            system_.components[c].name, demands_[c].utilization() * 100));
    }
  }
  // Responses make jitters, and jitters make responses: they grow until nothing changes.
  for (int round = 0;; ++round) {
    find_streams();
    const Waiting waiting(system_, demands_, is_known_, responses_);
    bool has_changed = false;
    std::vector<Duration> next = responses_;
    for (std::size_t c = 0; c < count; ++c) {
      if (!is_bounded_[c] || callbacks_[c].empty()) {
        continue;
      }
      std::string obstacle = waiting.obstacle(c);
      if (obstacle.empty()) {
        details_[c] = waiting.of(c);
        if (details_[c].is_bounded && round < kMaxRounds) {
          next[c] = std::max(details_[c].response, responses_[c]);
          has_changed |= next[c] != responses_[c];
          continue;
        }
        if (details_[c].is_bounded && details_[c].response == responses_[c]) {
          continue;
        }
        obstacle = "what waits for \"" + system_.components[c].name + "\" grows without bound";
      }
      forget(c, obstacle);
      has_changed = true;
    }
    responses_ = std::move(next);
    if (!has_changed) {
      return;
    }
  }
}

std::string Analysis::why_unbounded(std::size_t callback) const {
  return obstacles_[system_.callbacks[callback].component];
}

/// Longest time from one call of `callback` to the next.
std::optional<Duration> Analysis::gap_of(std::size_t callback) const {
  const Callback& its = system_.callbacks[callback];
  if (!is_bounded(callback)) {
    return std::nullopt;
  }
  const Duration late = response(callback);
  if (its.inputs.empty()) {
    if (!its.arrivals) {
      return std::nullopt;
    }
    // A tick that is a period late replaces those that it missed.
    return its.arrivals->period * (1 + late / its.arrivals->period) + its.arrivals->jitter + late;
  }
  std::optional<Duration> shortest;
  const auto offer = [&](std::optional<Duration> gap) {
    if (gap && (!shortest || *gap < *shortest)) {
      shortest = *gap;
    }
  };
  if (its.joining == Joining::kSets || its.joining == Joining::kPublishedSets) {
    return std::nullopt;  // A set may find no partner.
  }
  for (const Input& input : its.inputs) {
    for (const Source& source : system_.sources) {
      if (source.topic == input.topic && source.arrivals && source.keeps_coming) {
        offer(source.arrivals->period + source.arrivals->jitter);
      }
    }
    for (const std::size_t publisher : publishers_[input.topic]) {
      if (system_.callbacks[publisher].always_publishes &&
          !system_.callbacks[publisher].inputs.empty()) {
        continue;  // Rather none than a circle.
      }
      if (system_.callbacks[publisher].always_publishes) {
        offer(gap_of(publisher));
      }
    }
    if (its.joining == Joining::kLatest) {
      break;
    }
  }
  return shortest ? std::optional(*shortest + late) : std::nullopt;
}

/// Whether `component` subscribes to anything.
bool Analysis::has_input(std::size_t component) const {
  return std::ranges::any_of(callbacks_[component],
                             [&](std::size_t i) { return !system_.callbacks[i].inputs.empty(); }) ||
         std::ranges::find(system_.views, component, &View::component) != system_.views.end();
}

/// The largest age, of the oldest measurement that led to it, that a message of `topic` has when it
/// is published.
std::optional<Duration> Analysis::topic_age(std::size_t topic, std::vector<bool>& visited) const {
  Duration oldest{};
  for (const Source& source : system_.sources) {
    if (source.topic == topic) {
      oldest = std::max(oldest, source.age);
    }
  }
  for (const std::size_t publisher : publishers_[topic]) {
    const Callback& its = system_.callbacks[publisher];
    if (visited[publisher] || !is_bounded(publisher)) {
      return std::nullopt;
    }
    if (its.inputs.empty()) {
      if (has_input(its.component)) {
        return std::nullopt;  // Held messages may have any age: such sets are unbounded.
      }
      oldest = std::max(oldest, run_time(publisher));
      continue;
    }
    visited[publisher] = true;
    for (const Input& input : its.inputs) {
      const auto age = topic_age(input.topic, visited);
      if (!age) {
        return std::nullopt;
      }
      oldest = std::max(oldest, *age + its.max_difference + response(publisher));
    }
    visited[publisher] = false;
  }
  return oldest;
}

bool Analysis::add_hop(Walk& walk, Way& way, std::size_t callback, Duration held) const {
  if (!is_bounded(callback)) {
    walk.obstacles.insert(why_unbounded(callback));
    return false;
  }
  const std::size_t component = system_.callbacks[callback].component;
  Hop hop{.callback = callback,
          .held = held,
          .waiting = std::max(response(callback) - run_time(callback), Duration()),
          .running = run_time(callback),
          .hindrances = {}};
  for (std::size_t c = 0; c < system_.components.size(); ++c) {
    if (!details_[component].hindrance.empty() && details_[component].hindrance[c] > Duration()) {
      hop.hindrances.push_back({c, details_[component].hindrance[c]});
    }
  }
  sort_by_time(hop.hindrances);
  way.age += hop.held + hop.waiting;
  way.hops.push_back(std::move(hop));
  return true;
}

void Analysis::check_queue(Walk& walk, std::size_t callback, std::size_t input) const {
  const Input& its = system_.callbacks[callback].inputs[input];
  const Duration waits = std::max(response(callback) - run_time(callback), Duration());
  const auto check = [&](const Streams& streams, Duration late, std::uint64_t messages) {
    std::uint64_t most = 0;
    for (Arrivals stream : streams) {
      stream.jitter += late;
      most += stream.at_most_in(waits) * messages;
    }
    if (most > its.depth) {
      walk.result.reasons.push_back(fmt::format(
          "up to {} messages of \"{}\" may wait for \"{}\", whose queue has a depth of {}: the "
          "others are lost",
          most, system_.topics[its.topic],
          system_.components[system_.callbacks[callback].component].name, its.depth));
    }
  };
  for (const Source& source : system_.sources) {
    if (source.topic == its.topic && source.arrivals) {
      check({*source.arrivals}, {}, 1);
    }
  }
  for (const std::size_t publisher : publishers_[its.topic]) {
    for (const Publication& publication : system_.callbacks[publisher].publishes) {
      if (publication.topic == its.topic) {
        check(streams_[publisher], response(publisher), publication.messages);
      }
    }
  }
}

void Analysis::end(Walk& walk, const Way& way) const {
  ++walk.ways;
  if (!walk.result.bound || way.age > *walk.result.bound) {
    walk.result.bound = way.age;
    walk.result.hops = way.hops;
  }
  walk.result.running = std::max(walk.result.running, way.running);
}

void Analysis::walk_topic(Walk& walk, const Way& way, std::size_t topic) const {
  if (walk.ways > kMaxWays) {
    walk.obstacles.insert(fmt::format("there are more than {} ways", kMaxWays));
    return;
  }
  const bool is_end = topic == walk.chain.to;
  bool is_called = false;
  for (std::size_t i = 0; i < system_.callbacks.size(); ++i) {
    const auto& inputs = system_.callbacks[i].inputs;
    for (std::size_t k = 0; k < inputs.size(); ++k) {
      if (inputs[k].topic == topic && !walk.is_visited[i]) {
        is_called = true;
        walk_into(walk, way, i, k);
      }
    }
  }
  for (const View& view : system_.views) {
    if (view.topic == topic && is_end) {
      is_called = true;
      end_in_view(walk, way, view.component);
    }
    if (view.topic != topic || !view.ages || is_end) {
      continue;
    }
    Way seen = way;
    const auto sources = std::ranges::count(system_.sources, topic, &Source::topic);
    if (seen.gap &&
        (!way.is_pure || publishers_[topic].size() + static_cast<std::size_t>(sources) > 1)) {
      seen.gap.reset();
      seen.no_gap = "\"" + system_.components[view.component].name + "\" looks at the last of \"" +
                    system_.topics[topic] +
                    "\", which may always be one that follows from something else";
    }
    sample(walk, seen, view.component);
  }
  if (is_end && !is_called) {
    end(walk, way);
  }
}

void Analysis::walk_into(Walk& walk, Way way, std::size_t callback, std::size_t input) const {
  const Callback& its = system_.callbacks[callback];
  const bool is_end = its.inputs[input].topic == walk.chain.to;
  Duration held{};
  // At the end a message is judged before it is put to others.
  if (its.joining == Joining::kPublishedSets && !is_end) {
    held = its.max_difference;
  } else if (its.joining == Joining::kSets && !is_end) {
    for (std::size_t k = 0; k < its.inputs.size(); ++k) {
      std::vector<bool> visited(system_.callbacks.size());
      const auto age =
          k == input ? std::optional(way.age) : topic_age(its.inputs[k].topic, visited);
      if (!age) {
        walk.obstacles.insert("nothing bounds how late \"" + system_.topics[its.inputs[k].topic] +
                              "\" comes to the sets of \"" +
                              system_.components[its.component].name + "\"");
        return;
      }
      held = std::max(held, *age + its.max_difference - way.age);
    }
  } else if (its.joining == Joining::kLatest && input != 0 && !is_end) {
    if (!way.gap) {
      walk.obstacles.insert(way.no_gap);
      return;
    }
    held = *way.gap;
  }
  if (!add_hop(walk, way, callback, held)) {
    return;
  }
  check_queue(walk, callback, input);
  if (is_end) {
    end(walk, way);
    return;
  }
  way.age += run_time(callback);
  way.running += run_time(callback);
  way.is_pure = way.is_pure && (its.inputs.size() == 1 || its.joining != Joining::kEach);
  if (its.joining != Joining::kEach && way.gap) {
    way.gap.reset();
    way.no_gap = "the rate at which \"" + system_.components[its.component].name +
                 "\" finds a set is unknown";
  }
  walk.is_visited[callback] = true;
  if (its.inputs[input].ages) {
    sample(walk, way, its.component);
  }
  if (!its.always_publishes && way.gap) {
    way.gap.reset();
    way.no_gap = "nothing says that \"" + system_.components[its.component].name +
                 "\" publishes each time that " + its.name + " is called";
  }
  walk_on(walk, way, callback);
  walk.is_visited[callback] = false;
}

/// To all that `callback` publishes to.
void Analysis::walk_on(Walk& walk, const Way& way, std::size_t callback) const {
  for (const Publication& publication : system_.callbacks[callback].publishes) {
    walk_topic(walk, way, publication.topic);
  }
}

/// The topics of which each message follows from one of `root`, as a cause and not by held
/// messages.
std::vector<bool> Analysis::find_carriers(std::size_t root) const {
  std::vector<bool> carries(system_.topics.size());
  carries[root] = true;
  for (const std::size_t i : order_) {  // Each callback after those that call it.
    for (const Publication& publication : system_.callbacks[i].publishes) {
      if (publication.topic == root) {
        continue;
      }
      const bool has_source = std::ranges::find(system_.sources, publication.topic,
                                                &Source::topic) != system_.sources.end();
      carries[publication.topic] =
          !has_source && std::ranges::all_of(publishers_[publication.topic],
                                             [&](std::size_t p) { return inherits(p, carries); });
    }
  }
  return carries;
}

/// Whether what `callback` publishes always has the root of its cause.
bool Analysis::inherits(std::size_t callback, const std::vector<bool>& carries) const {
  const Callback& its = system_.callbacks[callback];
  const auto is_carried = [&](const Input& input) { return carries[input.topic]; };
  return !its.inputs.empty() &&
         (its.joining == Joining::kEach ? std::ranges::all_of(its.inputs, is_carried)
                                        : std::ranges::any_of(its.inputs, is_carried));
}

/// A message to `component` is inherited by activations without that root of their own: its timers,
/// and callbacks for other messages.
void Analysis::sample(Walk& walk, const Way& way, std::size_t component) const {
  for (const std::size_t i : callbacks_[component]) {
    const Callback& its = system_.callbacks[i];
    if (its.publishes.empty() || walk.is_sampled[i] || inherits(i, walk.always_carries)) {
      continue;
    }
    if (!way.gap) {
      walk.obstacles.insert(way.no_gap);
      continue;
    }
    // The newest that it holds is older by what the next one takes to come.
    Way on = way;
    if (!add_hop(walk, on, i, *way.gap)) {
      continue;
    }
    on.age += run_time(i);
    on.is_pure = true;
    on.running = run_time(i);  // Earlier callbacks may have ended long ago.
    on.gap = its.always_publishes ? gap_of(i) : std::nullopt;
    if (!on.gap) {
      on.no_gap = "the rate at which \"" + system_.components[component].name + "\" publishes in " +
                  its.name + " is unknown";
    }
    walk.is_sampled[i] = true;
    walk_on(walk, on, i);
    walk.is_sampled[i] = false;
  }
}

/// A component takes what it only looks at when it is called for something else.
void Analysis::end_in_view(Walk& walk, Way way, std::size_t component) const {
  std::optional<Duration> shortest;
  std::size_t its_callback = 0;
  for (const std::size_t i : callbacks_[component]) {
    if (const auto gap = gap_of(i); gap && (!shortest || *gap < *shortest)) {
      shortest = gap;
      its_callback = i;
    }
  }
  if (!shortest) {
    walk.obstacles.insert("the rate at which \"" + system_.components[component].name +
                          "\" reads \"" + system_.topics[walk.chain.to] + "\" is unknown");
  } else if (add_hop(walk, way, its_callback, *shortest)) {
    end(walk, way);
  }
}

ChainEstimate Analysis::judge(const Chain& chain) const {
  Walk walk{.chain = chain,
            .result = {},
            .is_visited = std::vector<bool>(system_.callbacks.size()),
            .is_sampled = std::vector<bool>(system_.callbacks.size()),
            .always_carries = find_carriers(chain.from)};
  for (const Source& source : system_.sources) {
    if (source.topic != chain.from) {
      continue;
    }
    Way way{.age = source.age,
            .no_gap = "nothing says that \"" + system_.topics[chain.from] +
                      "\" comes at least every so often"};
    if (source.arrivals && source.keeps_coming) {
      way.gap = source.arrivals->period + source.arrivals->jitter;
    }
    walk_topic(walk, way, chain.from);
  }
  for (const std::size_t publisher : publishers_[chain.from]) {
    const Callback& its = system_.callbacks[publisher];
    if (!is_bounded(publisher)) {
      walk.obstacles.insert(why_unbounded(publisher));
      continue;
    }
    // Messages of a component with inputs have the age of their causes.
    std::vector<bool> visited(system_.callbacks.size());
    const std::optional<Duration> age =
        has_input(its.component) ? topic_age(chain.from, visited) : run_time(publisher);
    if (!age) {
      walk.obstacles.insert("nothing bounds how old what led to \"" + system_.topics[chain.from] +
                            "\" is when it is published");
      continue;
    }
    Way way{.age = *age,
            .no_gap = "nothing says that \"" + system_.topics[chain.from] +
                      "\" comes at least every so often"};
    if (its.always_publishes) {
      way.gap = gap_of(publisher);
    }
    walk.is_visited[publisher] = true;
    walk_topic(walk, way, chain.from);
    walk.is_visited[publisher] = false;
  }
  conclude(walk);
  return std::move(walk.result);
}

void Analysis::conclude(Walk& walk) const {
  ChainEstimate& result = walk.result;
  if (walk.ways == 0 && walk.obstacles.empty()) {
    walk.obstacles.insert("no message gets from \"" + system_.topics[walk.chain.from] + "\" to \"" +
                          system_.topics[walk.chain.to] + "\"");
  }
  std::vector<std::string> reasons(walk.obstacles.begin(), walk.obstacles.end());
  std::ranges::sort(result.reasons);
  const auto same = std::ranges::unique(result.reasons);
  result.reasons.erase(same.begin(), same.end());
  if (!walk.obstacles.empty()) {
    result.bound.reset();
  }
  const Duration deadline = walk.chain.deadline;
  if (result.running > deadline) {
    result.verdict = Verdict::kCannotHold;
    reasons.push_back("the callbacks on the way take " + text_of(result.running) +
                      " by themselves, the deadline is " + text_of(deadline));
  } else if (result.bound && *result.bound <= deadline && result.reasons.empty()) {
    result.verdict = Verdict::kHolds;
  } else if (result.bound && *result.bound > deadline) {
    const Hop& worst = *std::ranges::max_element(
        result.hops, {}, [](const Hop& hop) { return hop.held + hop.waiting; });
    const std::string name = system_.components[system_.callbacks[worst.callback].component].name;
    std::string reason = "a message may be " + text_of(*result.bound) + " old, the deadline is " +
                         text_of(deadline) + "; the longest wait is that for \"" + name + "\": ";
    reason += worst.held > worst.waiting ? text_of(worst.held) + " until it looks at what came"
                                         : text_of(worst.waiting) + " for its turn";
    if (!worst.hindrances.empty() && worst.held <= worst.waiting) {
      reason += ", of which up to " + text_of(worst.hindrances.front().time) + " while \"" +
                system_.components[worst.hindrances.front().component].name + "\" runs";
    }
    reasons.push_back(std::move(reason));
  }
  result.reasons.insert(result.reasons.begin(), reasons.begin(), reasons.end());
}

Estimate Analysis::estimate() const {
  Estimate result;
  result.executors.resize(system_.executors.size());
  for (std::size_t c = 0; c < system_.components.size(); ++c) {
    ComponentEstimate component{.utilization = demands_[c].utilization(), .response = {}};
    if (is_bounded_[c]) {
      component.response = responses_[c];
    }
    result.executors[system_.components[c].executor] += component.utilization;
    result.components.push_back(component);
  }
  for (const Chain& chain : system_.chains) {
    result.chains.push_back(judge(chain));
    ChainEstimate& judged = result.chains.back();
    if (judged.verdict != Verdict::kNotShown || judged.bound) {
      continue;
    }
    // Which of the components that the chain needs has more to do than there is time for?
    for (std::size_t c = 0; c < system_.components.size(); ++c) {
      const bool is_named = std::ranges::any_of(judged.reasons, [&](const std::string& reason) {
        return reason == obstacles_[c] && reason.find("grows") != std::string::npos;
      });
      const std::size_t executor = system_.components[c].executor;
      if (result.components[c].utilization > 1.0 &&
          std::ranges::find(judged.reasons, obstacles_[c]) != judged.reasons.end()) {
        judged.verdict = Verdict::kCannotHold;
      } else if (is_named && result.executors[executor] > system_.executors[executor].threads) {
        judged.verdict = Verdict::kCannotHold;
        judged.reasons.push_back(
            fmt::format("executor \"{}\" has work for {:.0f} % of the time of its {}",
                        system_.executors[executor].name, result.executors[executor] * 100,
                        system_.executors[executor].threads == 1
                            ? "worker"
                            : fmt::format("{} workers", system_.executors[executor].threads)));
        break;
      }
    }
  }
  return result;
}

// ---- Remedies ----

/// `system` where all callbacks of `component` take `share` of what they took.
System with_share(const System& system, std::size_t component, double share) {
  System changed = system;
  for (Callback& callback : changed.callbacks) {
    if (callback.component == component && callback.run_time) {
      callback.run_time = Duration(
          static_cast<std::int64_t>(share * static_cast<double>(callback.run_time->count())));
    }
  }
  return changed;
}

bool would_hold(const System& system, std::size_t chain) {
  return Analysis(system).judge(system.chains[chain]).verdict == Verdict::kHolds;
}

void add_remedies(const System& system, std::size_t chain, ChainEstimate& judged) {
  if (judged.verdict == Verdict::kHolds || !judged.bound ||
      *judged.bound <= system.chains[chain].deadline) {
    return;
  }
  std::vector<Hindrance> hindrances;
  for (const Hop& hop : judged.hops) {
    for (const Hindrance& hindrance : hop.hindrances) {
      const auto known = std::ranges::find(hindrances, hindrance.component, &Hindrance::component);
      if (known == hindrances.end()) {
        hindrances.push_back(hindrance);
      } else {
        known->time += hindrance.time;
      }
    }
  }
  sort_by_time(hindrances);
  hindrances.resize(std::min<std::size_t>(hindrances.size(), 3));
  for (const Hindrance& hindrance : hindrances) {
    const std::size_t component = hindrance.component;
    const std::string name = "\"" + system.components[component].name + "\"";
    if (would_hold(with_share(system, component, 0), chain)) {
      double holds = 0;
      double fails = 1;
      for (int i = 0; i < 10; ++i) {
        const double middle = (holds + fails) / 2;
        (would_hold(with_share(system, component, middle), chain) ? holds : fails) = middle;
      }
      Duration longest{};
      for (const Callback& callback : system.callbacks) {
        if (callback.component == component) {
          longest = std::max(longest, callback.run_time.value_or(Duration()));
        }
      }
      judged.remedies.push_back(fmt::format(
          "it would hold if {} took at most {} at a time, instead of {}", name,
          text_of(
              Duration(static_cast<std::int64_t>(holds * static_cast<double>(longest.count())))),
          text_of(longest)));
    }
    System apart = system;
    apart.executors.push_back({.name = "its own"});
    apart.components[component].executor = apart.executors.size() - 1;
    if (would_hold(apart, chain)) {
      judged.remedies.push_back("it would hold if " + name + " had an executor of its own");
    }
  }
  judged.remedies.push_back("it would hold with a deadline of " + text_of(*judged.bound));
}

}  // namespace

const char* to_word(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kHolds:
      return "holds";
    case Verdict::kNotShown:
      return "not shown";
    case Verdict::kCannotHold:
      return "cannot hold";
  }
  return "?";
}

Estimate analyze(const System& system) {
  Estimate result = Analysis(system).estimate();
  for (std::size_t i = 0; i < result.chains.size(); ++i) {
    add_remedies(system, i, result.chains[i]);
  }
  return result;
}

}  // namespace fastcycle::estimate
