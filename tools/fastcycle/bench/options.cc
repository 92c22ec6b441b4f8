#include "bench/options.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include <CLI/CLI.hpp>
#include <sched.h>
#include <unistd.h>

#include "config/nearest.h"
#include "config/problem.h"
#include "duration.h"
#include "report_file.h"

namespace fastcycle::tool::bench {
namespace {

using Numbers = std::vector<std::int64_t>;

constexpr std::int64_t kKiB = 1024;
constexpr std::int64_t kMaxSize = 1 << 30;  // As the component's param.
constexpr std::int64_t kMaxCount = 100'000'000;
/// The maximum number of components in an application file, including source and sink.
constexpr std::int64_t kMaxComponents = 1000;

/// The defaults of a mode.
struct Defaults {
  std::set<std::string> options;  ///< Of those that not every mode has.
  Numbers sizes;
  std::int64_t count = 0;
  std::int64_t warmup = 0;
  std::int64_t interval_us = 1000;
};

const std::map<std::string, Defaults>& modes() {
  static const Numbers kLarge = {32 * kKiB, 128 * kKiB, 512 * kKiB, 1024 * kKiB, 4096 * kKiB};
  static const std::map<std::string, Defaults> kModes = {
      {"latency",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--wait", "--floors",
         "--processes", "--slice-us"},
        kLarge,
        5000,
        200}},
      {"rtt",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--wait", "--floors"},
        kLarge,
        5000,
        200}},
      {"flood",
       {{"--size", "--count", "--window", "--no-credits", "--wait", "--floors"},
        {64},
        1'000'000,
        0}},
      {"fanout",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--subs", "--wait"},
        {64},
        2000,
        200}},
      {"timer",
       {{"--count", "--warmup", "--interval-us", "--raw", "--clock", "--wait", "--floors"},
        {0},
        5000,
        200}},
      {"deadline",
       {{"--count", "--warmup", "--interval-us", "--raw", "--wait", "--floors"},
        {0},
        2000,
        100,
        2000}},
      {"chain",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--hops", "--wait", "--floors"},
        {64},
        2000,
        200}},
      {"startup", {{"--components", "--topics", "--for"}, {0}, 1000, 200}},
      {"record",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--wait", "--dir"},
        {4096 * kKiB},
        500,
        50,
        4000}},
      {"disk", {{"--size", "--count", "--dir"}, {4096 * kKiB}, 256, 0}},
      {"inspect",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--wait"},
        {4096 * kKiB},
        600,
        100,
        10000}},
      {"trace",
       {{"--size", "--count", "--warmup", "--interval-us", "--raw", "--wait"},
        {64},
        5000,
        200,
        200}}};
  return kModes;
}

/// "32K" as bytes; none if it is no size.
std::optional<std::int64_t> parse_size(std::string_view word) {
  std::int64_t number = 0;
  const char* const end = word.data() + word.size();
  const auto [rest, error] = std::from_chars(word.data(), end, number);
  const std::string_view unit(rest, static_cast<std::size_t>(end - rest));
  const std::int64_t factor = unit.empty()                 ? 1
                              : unit == "K" || unit == "k" ? kKiB
                              : unit == "M"                ? kKiB * kKiB
                              : unit == "G"                ? kKiB * kKiB * kKiB
                                                           : 0;
  if (error != std::errc() || factor == 0 || number < 0 || number > kMaxSize / factor) {
    return std::nullopt;
  }
  return number * factor;
}

/// The memory still available, in bytes; a large number if that is unknown.
std::int64_t available_memory() {
  std::ifstream file("/proc/meminfo");
  std::string name;
  std::int64_t kib = 0;
  std::string unit;
  while (file >> name >> kib >> unit) {
    if (name == "MemAvailable:") {
      return kib * kKiB;
    }
  }
  return std::numeric_limits<std::int64_t>::max();
}

/// Where temporary files go.
std::filesystem::path disk_folder() {
  const char* const given = std::getenv("TMPDIR");
  return given == nullptr || *given == '\0' ? "/tmp" : given;
}

/// One that no disk has a part in, if there is any.
std::filesystem::path memory_folder() {
  const std::filesystem::path memory = "/dev/shm";
  return access(memory.c_str(), W_OK) == 0 ? memory : disk_folder();
}

std::string out_of_range(const std::string& option, std::int64_t value, std::int64_t min,
                         std::int64_t max) {
  return value >= min && value <= max
             ? std::string()
             : option + " expects a number from " + std::to_string(min) + " to " +
                   std::to_string(max) + ", not " + std::to_string(value);
}

std::string out_of_range(const std::string& option, const Numbers& values, std::int64_t min,
                         std::int64_t max) {
  for (const std::int64_t value : values) {
    if (std::string wrong = out_of_range(option, value, min, max); !wrong.empty()) {
      return wrong;
    }
  }
  return {};
}

std::string find_unknown_word(const Options& options) {
  static const std::vector<std::string> kWaits = {"park", "spin", "adaptive"};
  static const std::vector<std::string> kFloors = {"default", "all", "none"};
  for (const std::string& wait : options.waits) {
    if (std::find(kWaits.begin(), kWaits.end(), wait) == kWaits.end()) {
      return "--wait is \"park\", \"spin\" or \"adaptive\", or several of them with commas, not "
             "\"" +
             wait + "\"";
    }
  }
  if (std::find(kFloors.begin(), kFloors.end(), options.floors) == kFloors.end()) {
    return R"(--floors is "default", "all" or "none", not ")" + options.floors + "\"";
  }
  if (options.clock != "live" && options.clock != "simulated") {
    return R"(--clock is "live" or "simulated", not ")" + options.clock + "\"";
  }
  return {};
}

/// An option that this mode has no use for.
std::string find_foreign(const Options& options, const Defaults& mode, const CLI::App& line) {
  std::set<std::string> particular;
  for (const auto& [name, other] : modes()) {
    particular.insert(other.options.begin(), other.options.end());
  }
  for (const std::string& option : particular) {
    if (line.get_option(option)->count() > 0 && !mode.options.contains(option)) {
      std::string users;
      for (const auto& [name, other] : modes()) {
        if (other.options.contains(option)) {
          users += (users.empty() ? "" : ", ") + name;
        }
      }
      return option + " means nothing for " + options.mode + "; it is for " + users;
    }
  }
  return {};
}

/// An option that measures time, where none passes.
std::string find_meaningless_in_simulation(const Options& options, const Defaults& /*mode*/,
                                           const CLI::App& line) {
  for (const char* const option : {"--fifo", "--raw", "--wait", "--floors"}) {
    if (options.is_simulated() && line.get_option(option)->count() > 0) {
      return std::string("--clock simulated does not measure time: ") + option +
             " means nothing there";
    }
  }
  return {};
}

std::string find_bad_number(const Options& options) {
  // The credits come in quarters, and what waits for a subscriber is at most 65536 messages.
  for (const auto& wrong :
       {out_of_range("--count", options.count, 1, kMaxCount),
        out_of_range("--warmup", options.warmup, 0, kMaxCount),
        out_of_range("--interval-us", options.interval_us, 1, 60'000'000),
        out_of_range("--rounds", options.rounds, 1, 10'000),
        out_of_range("--first-round", options.first_round, 1, 10'000),
        out_of_range("--load", options.load, 0, 1024),
        out_of_range("--slice-us", options.slice_us, options.slice_us == 0 ? 0 : 100, 100'000),
        out_of_range("--window", options.window, 4, 65536),
        out_of_range("--subs", options.subs, 1, kMaxComponents - 1),
        out_of_range("--hops", options.hops, 1, kMaxComponents - 1),
        out_of_range("--components", options.components, 1, kMaxComponents - 2),
        out_of_range("--topics", options.topics, 1, 100'000)}) {
    if (!wrong.empty()) {
      return wrong;
    }
  }
  return {};
}

/// Checks that the largest pool fits, before the machine begins to swap.
std::string find_too_large(const Options& options) {
  const std::int64_t size = *std::max_element(options.sizes.begin(), options.sizes.end());
  const bool is_flood = options.mode == "flood";
  const std::int64_t depth = is_flood ? options.window : depth_for(size);
  std::int64_t pools = 1;
  if (options.mode == "fanout") {
    pools = *std::max_element(options.subs.begin(), options.subs.end());
  } else if (options.mode == "chain") {
    pools = *std::max_element(options.hops.begin(), options.hops.end());
  }
  constexpr std::int64_t kStamps = 32;
  const std::int64_t stamps =
      is_flood || options.is_simulated() ? 0 : (options.count + options.warmup) * kStamps * pools;
  const std::int64_t needed = size * (depth + 3) * pools + 2 * stamps;
  if (const std::int64_t available = available_memory(); needed > available / 2) {
    return "this needs about " + std::to_string(needed >> 20) + " MiB, and the machine has " +
           std::to_string(available >> 20) + " MiB left: use a smaller --size" +
           (is_flood                   ? " or --window"
            : options.mode == "fanout" ? ", --count or --subs"
            : options.mode == "chain"  ? ", --count or --hops"
                                       : " or --count");
  }
  return {};
}

int usable_cpus() {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  return sched_getaffinity(0, sizeof(cpus), &cpus) == 0 ? CPU_COUNT(&cpus) : 1;
}

std::string find_contradiction(const Options& options) {
  const bool spins =
      std::find(options.waits.begin(), options.waits.end(), "spin") != options.waits.end();
  if (options.is_fifo && options.slice_us != 0) {
    return "--slice-us has no effect with --fifo, whose threads have no time slices";
  }
  if (options.is_fifo && spins && usable_cpus() < 3) {
    return "--fifo with --wait spin occupies two CPUs, and none remains on this machine; use only "
           "one of these options";
  }
  return {};
}

}  // namespace

std::int64_t depth_for(std::int64_t size) {
  constexpr std::int64_t kMemory = 16 * kKiB * kKiB;
  return std::clamp<std::int64_t>(kMemory / std::max<std::int64_t>(size, 1), 4, 64);
}

void add_options(CLI::App& line, Options& options) {
  line.add_option("mode", options.mode,
                  "latency, rtt, flood, fanout, timer, deadline, chain, startup, record, disk, "
                  "inspect or trace (see below)")
      ->required()
      ->type_name("MODE");
  const auto add = [&](const char* name, auto& value, const char* type, const char* text) {
    line.add_option(name, value, text)->type_name(type);
  };
  const auto add_list = [&](const char* name, auto& values, const char* type, const char* text) {
    line.add_option(name, values, text)->type_name(type)->delimiter(',')->allow_extra_args(false);
  };
  add_list("--size", options.size_words, "N,N",
           "Payload sizes in bytes: 64, 32K, 4M (latency, rtt: 32K to 4M; record, disk, inspect: "
           "4M; else 64)");
  add("--count", options.given_count, "N",
      "Messages per point (5000; fanout, chain: 2000; record: 500; disk: 256; flood: 1000000)");
  add("--warmup", options.given_warmup, "N", "Warm-up messages, not measured (200; record: 50)");
  add("--interval-us", options.given_interval_us, "N",
      "Interval between messages (1000; record: 4000; inspect: 10000; trace: 200)");
  add("--rounds", options.rounds, "R",
      "Number of measurements of each point, alternating with the floors (1)");
  add("--first-round", options.first_round, "R",
      "Number of the first round, which determines the order of measurements (1)");
  add_list("--wait", options.waits, "WAY,WAY",
           "How workers wait: park, spin, adaptive (park; fanout, trace: park,spin)");
  add("--load", options.load, "N", "Number of other busy processes during the measurement (0)");
  line.add_flag("--fifo", options.is_fifo, "Run workers and floors as SCHED_FIFO");
  add("--slice-us", options.slice_us, "N",
      "latency: time slice of the subscriber's worker and of the floors' receivers, 100 to 100000 "
      "(that of the kernel)");
  add("--floors", options.floors, "WHICH",
      "Floors to measure: default, all (latency: with malloc; flood: with a bare ring) or none");
  line.add_flag("--json", options.is_json,
                "Print one JSON object per line, for each point and round");
  add("--raw", options.raw_file, "FILE.csv", "Write the timestamps of every message");
  line.add_flag("--print-application", options.prints_application,
                "Print the application of the first point and exit");
  line.add_flag("--processes", options.has_processes,
                "latency: also with publisher and subscriber in two processes");
  add_list("--subs", options.subs, "N,N", "fanout: subscribers (1,2,4,8,16,32,64)");
  add_list("--hops", options.hops, "N,N", "chain: number of hops (1,2,4,8)");
  add("--window", options.window, "W", "flood: maximum number of messages in flight (1024)");
  line.add_flag("--no-credits", options.has_no_credits,
                "flood: send without flow control, and count lost messages");
  add("--clock", options.clock, "CLOCK", "timer: live; or simulated, for a million periods");
  add("--components", options.components, "N", "startup: how many (12)");
  add("--topics", options.topics, "M", "startup: how many (24)");
  add("--for", options.idle_word, "TIME", "startup: duration of the idle measurement (10s)");
  add("--dir", options.record_folder, "FOLDER",
      "record, disk: output folder (record: /dev/shm; disk: TMPDIR)");
}

std::string complete(Options& options, const CLI::App& line) {
  const auto found = modes().find(options.mode);
  if (found == modes().end()) {
    std::vector<std::string> names;
    std::string list;
    for (const auto& [name, mode] : modes()) {
      names.push_back(name);
      list += (list.empty() ? "" : ", ") + name;
    }
    const std::string hint = config::did_you_mean(config::nearest(options.mode, names));
    return "unknown mode \"" + options.mode + "\"; " + (hint.empty() ? "there are " + list : hint);
  }
  const Defaults& mode = found->second;
  options.sizes = mode.sizes;
  if (!options.size_words.empty()) {
    options.sizes.clear();
    for (const std::string& word : options.size_words) {
      const std::optional<std::int64_t> size = parse_size(word);
      if (!size) {
        return "--size expects bytes up to 1G, as 64, 32K or 4M, not \"" + word + "\"";
      }
      options.sizes.push_back(*size);
    }
  }
  if (options.waits.empty()) {
    options.waits = {"park"};
    if (options.mode == "fanout" || options.mode == "trace") {
      options.waits.emplace_back("spin");  // Without the system call that wakes a sleeper.
    }
  }
  options.count = options.given_count.value_or(options.is_simulated() ? 1'000'000 : mode.count);
  options.warmup = options.given_warmup.value_or(options.is_simulated() ? 0 : mode.warmup);
  options.interval_us = options.given_interval_us.value_or(mode.interval_us);
  options.source_folder = memory_folder();
  if (options.record_folder.empty()) {
    options.record_folder = options.mode == "disk" ? disk_folder() : memory_folder();
  }
  const std::optional<Duration> idle = parse_duration(options.idle_word);
  if (!idle) {
    return "--for expects a time above zero with its unit, as 500ms, 10s or 2min, not \"" +
           options.idle_word + "\"";
  }
  options.idle = *idle;
  for (const auto& check : {find_unknown_word, find_bad_number}) {
    if (std::string wrong = check(options); !wrong.empty()) {
      return wrong;
    }
  }
  for (const auto& check : {find_foreign, find_meaningless_in_simulation}) {
    if (std::string wrong = check(options, mode, line); !wrong.empty()) {
      return wrong;
    }
  }
  if (const std::string obstacle = ReportFile(options.raw_file).find_obstacle();
      !obstacle.empty()) {
    return "--raw " + options.raw_file.string() + " cannot be written: " + obstacle;
  }
  for (const auto& check : {find_contradiction, find_too_large}) {
    if (std::string wrong = check(options); !wrong.empty()) {
      return wrong;
    }
  }
  return {};
}

}  // namespace fastcycle::tool::bench
