// fastcycle bench: what messages cost on this machine, beside the floors of the machine.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <CLI/CLI.hpp>

#include "bench/application.h"
#include "command.h"
#include "host/report.h"
#include "measure/floors.h"
#include "measure/row.h"

namespace fastcycle::tool {
namespace {

using measure::Measured;
using measure::Plan;
using measure::Row;

struct BenchOptions {
  std::string mode;
  std::vector<std::int64_t> sizes = {32 << 10, 128 << 10, 512 << 10, 1 << 20, 4 << 20};
  Plan plan;
  std::int64_t rounds = 1;
  std::vector<std::string> waits = {"park"};
};

/// A folder of its own, gone with it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "fastcycle-bench-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw std::runtime_error("cannot make a folder like " + name);
    }
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

double number_of(const host::RunReport& report, const std::string& name) {
  for (const auto& [key, value] : report.results) {
    if (key == name) {
      if (const auto* number = std::get_if<double>(&value)) {
        return *number;
      }
      if (const auto* number = std::get_if<std::int64_t>(&value)) {
        return static_cast<double>(*number);
      }
    }
  }
  throw std::runtime_error("the benchmark's components did not report \"" + name + "\"");
}

Measured measure_fastcycle(const Plan& plan, const bench::Profile& profile, bool is_rtt) {
  const TemporaryFolder folder;
  const host::RunReport report =
      bench::run_application(is_rtt ? bench::rtt_application(plan, profile, folder.path())
                                    : bench::latency_application(plan, profile, folder.path()),
                             folder.path());
  Measured result;
  if (const std::string error = measure::read_samples(folder.path() + "/samples", result.samples);
      !error.empty()) {
    throw std::runtime_error(error);
  }
  const auto whole = [&](const std::string& name) {
    return static_cast<std::int64_t>(number_of(report, name));
  };
  result.usage = {.cpu_us = number_of(report, "cpu_us"),
                  .minor_faults = whole("minor_faults"),
                  .major_faults = whole("major_faults"),
                  .voluntary_switches = whole("voluntary_switches"),
                  .involuntary_switches = whole("involuntary_switches")};
  return result;
}

void print_row(const BenchOptions& options, const Plan& plan, const std::string& peer,
               std::int64_t round, const Measured& measured) {
  Row row{.peer = peer,
          .mode = options.mode,
          .size = plan.size,
          .round = round,
          .warmup = plan.warmup,
          .interval_us = plan.interval_us};
  measure_into(row, measured.samples, plan.count, measured.usage);
  std::printf("%s\n", to_json(row).c_str());
  std::fflush(stdout);
}

int bench_latency(const BenchOptions& options) {
  const bool is_rtt = options.mode == "rtt";
  const auto floor = is_rtt ? &measure::floor_rtt : &measure::floor_latency;
  for (std::int64_t round = 1; round <= options.rounds; ++round) {
    for (const std::int64_t size : options.sizes) {
      Plan plan = options.plan;
      plan.size = size;
      print_row(options, plan, "floor-futex", round, floor(plan, measure::Waiting::kFutex));
      for (const std::string& wait : options.waits) {
        if (wait == "spin") {
          print_row(options, plan, "floor-spin", round, floor(plan, measure::Waiting::kSpin));
        }
        print_row(options, plan, "fastcycle-" + wait, round,
                  measure_fastcycle(plan, {.wait = wait}, is_rtt));
      }
    }
  }
  return kDone;
}

}  // namespace

Command add_bench(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "bench", "Measure what messages cost on this machine, beside its floors");
  const auto options = std::make_shared<BenchOptions>();
  line->add_option("mode", options->mode, "latency or rtt")->required()->type_name("MODE");
  line->add_option("--size", options->sizes, "Payload in bytes")->type_name("N")->delimiter(',');
  line->add_option("--count", options->plan.count, "Messages a point")->type_name("N");
  line->add_option("--warmup", options->plan.warmup, "Messages before")->type_name("N");
  line->add_option("--interval-us", options->plan.interval_us, "Between messages")->type_name("N");
  line->add_option("--rounds", options->rounds, "Rounds")->type_name("R");
  line->add_option("--wait", options->waits, "park, spin, adaptive")->delimiter(',');
  return {line, [options] { return bench_latency(*options); }};
}

}  // namespace fastcycle::tool
