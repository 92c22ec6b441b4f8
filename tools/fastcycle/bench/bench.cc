// fastcycle bench: what messages cost on this machine, beside the floors of the machine.

#include <csignal>
#include <cstdio>
#include <map>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "bench/modes.h"
#include "bench/options.h"
#include "bench/session.h"
#include "command.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

using bench::Mode;
using bench::Options;
using bench::Session;

Mode mode_of(const Options& options, Session* session) {
  using Make = Mode (*)(const Options&, Session*);
  static const std::map<std::string, Make> kModes = {
      {"latency", &bench::latency_mode}, {"rtt", &bench::latency_mode},
      {"flood", &bench::flood_mode},     {"fanout", &bench::fanout_mode},
      {"timer", &bench::timer_mode},     {"deadline", &bench::deadline_mode},
      {"chain", &bench::chain_mode},     {"startup", &bench::startup_mode},
      {"record", &bench::record_mode},   {"disk", &bench::disk_mode},
      {"inspect", &bench::inspect_mode}, {"trace", &bench::trace_mode}};
  return kModes.at(options.mode)(options, session);
}

int run_bench(Options& options, const CLI::App& line) {
  if (const std::string wrong = bench::complete(options, line); !wrong.empty()) {
    print_to(stderr, "fastcycle bench: {}\n  fastcycle bench --help says more\n", wrong);
    return kWrong;
  }
  if (options.prints_application) {
    print_to(stdout, "{}\n", mode_of(options, nullptr).application.dump(2));
    return flush_output();
  }
  // A reader that goes away must not leave the folder of the session behind.
  std::signal(SIGPIPE, SIG_IGN);
  Session session(options);
  try {
    return session.run(mode_of(options, &session));
  } catch (const std::bad_alloc&) {
    throw std::runtime_error("bench: the memory is not enough: take a smaller --size or --count");
  }
}

constexpr const char* kModesText =
    "Modes:\n"
    "  latency  from publish to callback, one message an interval\n"
    "  rtt      there and back\n"
    "  flood    messages a second, as fast as possible, without loss unless --no-credits\n"
    "  fanout   what publishing costs for each further subscriber\n"
    "  timer    how late timers are, and that they do not drift\n"
    "  deadline how soon a subscriber is notified that its publisher is stalled\n"
    "  chain    several components in a row, on one thread and on two\n"
    "  startup  from nothing to the first messages; memory; an idle application\n"
    "  record   what recording costs publisher and subscriber; what of it is lost\n"
    "  disk     how fast a recording goes to the disk, beside write() and dd\n"
    "  inspect  what five `fastcycle topic echo` cost publisher and subscriber\n"
    "  trace    what a trace costs a message\n"
    "\n"
    "Component libraries are loaded from JSON by the host, as `fastcycle run` does. They are\n"
    "compared with floors: the least that this machine needs for the same with bare system calls,\n"
    "measured in turn with them. With --wait spin the subscriber's worker spins; the publisher's\n"
    "too, but in latency and fanout, where it sleeps between its messages as the floors do.\n";

}  // namespace

Command add_bench(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "bench", "Measure what messages cost on this machine, beside the least it needs");
  line->footer(kModesText +
               ("\n" + examples("  fastcycle bench latency\n"
                                "  fastcycle bench rtt --size 64,32K,4M --wait "
                                "park,spin --rounds 5\n"
                                "  fastcycle bench flood --json > flood.jsonl\n"
                                "  fastcycle bench startup --components 200 --topics "
                                "2000\n"
                                "  fastcycle bench record --rounds 5\n"
                                "\n"
                                "Exit codes: 0 done, 1 stopped, could not be measured "
                                "or written, or what arrived is\ndamaged or does not add up, "
                                "2 wrong input, 130 ended at once.\n")));
  const auto options = std::make_shared<Options>();
  bench::add_options(*line, *options);
  return {line, [options, line] { return run_bench(*options, *line); }};
}

}  // namespace fastcycle::tool
