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
    print_to(stderr, "fastcycle bench: {}\n  fastcycle bench --help shows the usage\n", wrong);
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
    throw std::runtime_error("bench: not enough memory; use a smaller --size or --count");
  }
}

constexpr const char* kModesText =
    "Modes:\n"
    "  latency  time from publish to callback, one message per interval\n"
    "  rtt      round-trip time\n"
    "  flood    maximum rate of messages, without loss unless --no-credits\n"
    "  fanout   cost of publishing per subscriber\n"
    "  timer    lateness and drift of timers\n"
    "  deadline time until a subscriber is notified that its publisher is stalled\n"
    "  chain    latency of a chain of components, on one thread and on two\n"
    "  startup  time to the first messages; memory; load of an idle application\n"
    "  record   cost of recording for publisher and subscriber; losses\n"
    "  disk     rate of recording to disk, compared with write() and dd\n"
    "  inspect  cost of five `fastcycle topic echo` for publisher and subscriber\n"
    "  trace    cost of a trace per message\n"
    "\n"
    "The application is loaded from JSON as by `fastcycle run`. It is compared with floors: the\n"
    "minimum that this machine needs for the same work with bare system calls, measured\n"
    "alternately. With --wait spin, the subscriber's worker spins, and the publisher's too,\n"
    "except in latency and fanout, where it sleeps between its messages as the floors do.\n";

}  // namespace

Command add_bench(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "bench", "Measure the cost of messages on this machine, compared with its minimum");
  line->footer(
      kModesText +
      ("\n" + examples("  fastcycle bench latency\n"
                       "  fastcycle bench rtt --size 64,32K,4M --wait park,spin --rounds 5\n"
                       "  fastcycle bench flood --json > flood.jsonl\n"
                       "  fastcycle bench startup --components 200 --topics 2000\n"
                       "  fastcycle bench record --rounds 5\n"
                       "\n"
                       "Exit codes: 0 done, 1 stopped, a measurement or output failed, or\n"
                       "messages were damaged or miscounted, 2 wrong input, 130 ended\n"
                       "immediately.\n")));
  const auto options = std::make_shared<Options>();
  bench::add_options(*line, *options);
  return {line, [options, line] { return run_bench(*options, *line); }};
}

}  // namespace fastcycle::tool
