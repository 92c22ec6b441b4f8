#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fastcycle/time.h"

namespace fastcycle::estimate {

/// How often something happens at most: `burst` events at a time, one such time in each `period`,
/// each up to `jitter` late. In every span of length t, its ends included, there are at most
/// `burst * (floor((t + jitter) / period) + 1)` events.
struct Arrivals {
  Duration period{};  ///< Above zero.
  Duration jitter{};
  std::uint64_t burst = 1;

  [[nodiscard]] std::uint64_t at_most_in(Duration span) const noexcept {
    return burst * static_cast<std::uint64_t>((span + jitter) / period + 1);
  }
};

/// Timing model of an executor.
struct Executor {
  std::string name;
  unsigned threads = 1;
  std::vector<int> cpus = {};  ///< CPUs of its workers; empty: all of the machine.
  int priority = 0;            ///< Real-time priority; 0: the kernel's usual policy.
  bool hand_over = false;      ///< A publish by one of its workers wakes no other of them.
  bool is_spinning = false;
  Duration looks_for{};  ///< How long a worker polls before it sleeps.
};

struct Component {
  std::string name;
  std::size_t executor = 0;  ///< Its index in `System::executors`.
};

/// A topic that messages of one callback go to.
struct Publication {
  std::size_t topic = 0;
  std::uint64_t messages = 1;  ///< At most, in one call.
};

/// The queue of a topic's messages to a callback.
struct Input {
  std::size_t topic = 0;
  std::uint64_t depth = 16;  ///< Queue depth, per publisher.
  /// Whether its age counts for messages that the component's timers publish.
  bool ages = true;
};

/// How the callback of several inputs is called.
enum class Joining : std::uint8_t {
  kEach,           ///< With every message.
  kSets,           ///< When the last member of a set has arrived, by their taken times.
  kPublishedSets,  ///< The same, by their publish times.
  kLatest,         ///< With every message of the first input, and the newest of the others.
};

/// A callback of a component.
struct Callback {
  std::string name;  ///< `its timer`, `"planning/speed"`.
  std::size_t component = 0;
  std::optional<Duration> run_time;  ///< The longest; none: not known.
  std::vector<Input> inputs;         ///< Empty: a timer.
  Joining joining = Joining::kEach;
  Duration max_difference{};         ///< Of a set's members.
  std::optional<Arrivals> arrivals;  ///< Of a timer, or of another cause.
  std::vector<Publication> publishes;
  /// It publishes all of `publishes` in each call; only then held messages of it have a maximum
  /// age.
  bool always_publishes = true;
};

/// A component reads the last messages of a topic when it is called for another cause.
struct View {
  std::size_t component = 0;
  std::size_t topic = 0;
  bool ages = true;
};

/// Messages from outside of all callbacks.
struct Source {
  std::string name;
  std::size_t topic = 0;
  std::optional<Arrivals> arrivals;  ///< None: not known.
  /// Whether they also arrive at least that often; only then held messages of it have a maximum
  /// age.
  bool keeps_coming = true;
  Duration age{};  ///< When they are published, at most.
};

/// A path of messages through the application with a maximum age.
struct Chain {
  std::string name;
  std::size_t from = 0;
  std::size_t to = 0;
  Duration deadline{};
};

/// Timing model of an application.
struct System {
  unsigned cpus = 1;   ///< Of the machine.
  Duration wake_up{};  ///< Maximum latency of the machine until a woken worker runs.
  std::vector<Executor> executors;
  std::vector<Component> components;
  std::vector<std::string> topics;
  std::vector<Callback> callbacks;
  std::vector<View> views;
  std::vector<Source> sources;
  std::vector<Chain> chains;
};

}  // namespace fastcycle::estimate
