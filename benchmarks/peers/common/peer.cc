#include "peers/common/peer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <optional>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <sys/prctl.h>

namespace fastcycle::peers {
namespace {

struct Options {
  std::string variant;
  Mode mode = Mode::kLatency;
  std::optional<std::int64_t> size;
  std::optional<std::int64_t> count;
  measure::Plan plan;
  std::int64_t round = 1;
  bool is_list = false;
};

constexpr std::array<std::int64_t, 5> kPaperSizes = {32 << 10, 128 << 10, 512 << 10, 1 << 20,
                                                     4 << 20};

std::string_view name_of(Delivery delivery) {
  switch (delivery) {
    case Delivery::kBetweenThreads:
      return "hands over between threads";
    case Delivery::kPublishersThread:
      return "runs in the publisher's thread";
    case Delivery::kBetweenProcesses:
      return "between processes";
  }
  return "";
}

/// Facts about the peer for readers of a row, as JSON without braces.
std::string description(const Peer& peer, const Variant& variant) {
  return fmt::format(R"("class":"{}","typed":{},"copies":"{}","version":"{}")",
                     name_of(variant.delivery), variant.is_typed, variant.copies, peer.version);
}

/// The shortest interval, in whole milliseconds, that leaves half of the time idle.
std::int64_t interval_hint_us(const Variant& variant, std::int64_t size) {
  const double busy_us = variant.busy_us_per_mib * static_cast<double>(size) / (1 << 20);
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(2 * busy_us / 1000))) * 1000;
}

void list(const Peer& peer) {
  for (const Variant& variant : peer.variants) {
    std::string hints;
    for (const std::int64_t size : kPaperSizes) {
      hints += fmt::format(R"({}"{}":{})", hints.empty() ? "" : ",", size,
                           interval_hint_us(variant, size));
    }
    fmt::print(
        R"({{"peer":"{}","variant":"{}","about":"{}",{},"daemon":"{}","interval_hint_us":{{{}}}}})"
        "\n",
        peer.name, variant.name, variant.about, description(peer, variant), variant.daemon, hints);
  }
}

const Variant& variant_of(const Peer& peer, const std::string& name) {
  for (const Variant& variant : peer.variants) {
    if (name.empty() || variant.name == name) {
      return variant;
    }
  }
  throw std::runtime_error("there is no variant '" + name + "'; --list names them");
}

void measure_and_print(const Peer& peer, Options options) {
  const Variant& variant = variant_of(peer, options.variant);
  const bool is_flood = options.mode == Mode::kFlood;
  options.plan.size = options.size.value_or(is_flood ? 64 : options.plan.size);
  options.plan.count = options.count.value_or(is_flood ? 100'000 : options.plan.count);
  // Like FastCycle's own workers: a timer slack of one nanosecond. Later threads inherit it.
  prctl(PR_SET_TIMERSLACK, 1UL);
  Run run(options.mode, options.plan);
  variant.measure(run);
  measure::Row row = run.finish();
  row.peer = variant.name == "default" ? peer.name : peer.name + "-" + variant.name;
  row.round = options.round;
  row.more = description(peer, variant);
  fmt::print("{}\n", to_json(row));
}

}  // namespace

int peer_main(int argc, char** argv, const Peer& peer) {
  Options options;
  CLI::App line("Measures " + peer.name + " as `fastcycle bench` measures FastCycle.");
  line.add_flag("--list", options.is_list, "Say which variants there are, one JSON object a line");
  line.add_option("--variant", options.variant, "One of --list; default: the first");
  const std::map<std::string, Mode> modes = {
      {"latency", Mode::kLatency}, {"rtt", Mode::kRtt}, {"flood", Mode::kFlood}};
  line.add_option("--mode", options.mode, "latency, rtt or flood")
      ->transform(CLI::CheckedTransformer(modes));
  line.add_option("--size", options.size, "Payload in bytes")->check(CLI::Range(1, 1 << 30));
  line.add_option("--count", options.count, "Messages")->check(CLI::Range(1, 1 << 30));
  line.add_option("--warmup", options.plan.warmup, "Messages before")
      ->check(CLI::Range(0, 1 << 30));
  line.add_option("--interval-us", options.plan.interval_us, "Between messages; not in a flood")
      ->check(CLI::Range(1, 1 << 30));
  line.add_option("--round", options.round, "A number for the row");
  try {
    line.parse(argc, argv);
    if (options.is_list) {
      list(peer);
    } else {
      measure_and_print(peer, options);
    }
    return EXIT_SUCCESS;
  } catch (const CLI::ParseError& error) {
    return line.exit(error) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "peer_%s: %s\n", peer.name.c_str(), error.what());
    return EXIT_FAILURE;
  }
}

}  // namespace fastcycle::peers
