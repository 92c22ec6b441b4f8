// The program that `fastcycle doctor --dds` runs, so that the tool itself links no DDS:
//
//     fastcycle-dds-doctor look TEXT|JSON ENGINE DOMAIN INTERFACE SECURITY MILLISECONDS
//     fastcycle-dds-doctor echo ENGINE DOMAIN INTERFACE FROM TO
//
// ENGINE, INTERFACE and SECURITY may be empty. `echo` is the other process of a round trip. Exit
// codes are those of the tool.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/printable.h"
#include "dds_gateway/doctor/observe.h"
#include "dds_gateway/doctor/to_text.h"
#include "dds_security/documents.h"
#include "dds_security/enclave.h"

namespace {

using namespace fastcycle::dds_gateway;

constexpr int kDone = 0;
constexpr int kFailed = 1;
constexpr int kWrong = 2;
constexpr int kProblems = 3;

/// An error on the command line.
class Wrong final : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

const Engine& engine_of(const std::string& name) {
  std::vector<std::string> names;
  for (const Engine& engine : engines()) {
    if (name.empty() || name == engine.name) {
      return engine;
    }
    names.emplace_back(engine.name);
  }
  throw Wrong(
      fmt::format("--engine expects one of {}, found \"{}\"", fmt::join(names, ", "), name));
}

void refuse_wrong_enclave(const ParticipantOptions& options) {
  std::vector<std::string> errors = fastcycle::dds_security::enclave_errors(options.security);
  if (options.domain > fastcycle::dds_security::kDomainMax) {
    errors.push_back(fmt::format("--domain expects a number from 0 to {} with security, found {}",
                                 fastcycle::dds_security::kDomainMax, options.domain));
  }
  if (!errors.empty()) {
    throw Wrong(fmt::format("{}", fmt::join(errors, "\n")));
  }
}

void print(std::FILE* stream, const std::string& text) {
  std::fputs(fastcycle::base::printable_lines(text).c_str(), stream);
  std::fflush(stream);
}

int look(const std::vector<std::string>& args) {
  const bool is_json = args.at(1) == "JSON";
  ObserveOptions options{
      .engine = &engine_of(args.at(2)),
      .participant = {.domain = static_cast<std::uint32_t>(std::stoul(args.at(3))),
                      .interface = args.at(4),
                      .user_data = {},
                      .security = args.at(5)},
      .time = std::chrono::milliseconds(std::stoul(args.at(6))),
      .program = {}};
  if (options.participant.security.empty()) {
    // Permissions cover the topics of the application, but not those of a round trip.
    options.program = std::filesystem::read_symlink("/proc/self/exe");
  } else {
    refuse_wrong_enclave(options.participant);
  }
  if (!is_json) {
    print(stdout, fmt::format("The domain {}, looked at by the engine {} on {} for {:.3g} s\n",
                              options.participant.domain, options.engine->name,
                              args.at(4).empty() ? "the interface that it chooses" : args.at(4),
                              static_cast<double>(options.time.count()) / 1e3));
  }
  const Observation seen = observe(options);
  const std::vector<Finding> findings = diagnose(seen);
  print(stdout, is_json ? to_json(seen, findings) : to_text(seen, findings));
  if (std::ferror(stdout) != 0) {
    return kFailed;
  }
  const bool has_problem = std::ranges::any_of(
      findings, [](const Finding& finding) { return finding.level == Level::kProblem; });
  return has_problem ? kProblems : kDone;
}

int echo(const std::vector<std::string>& args) {
  const auto participant =
      engine_of(args.at(1))
          .create({.domain = static_cast<std::uint32_t>(std::stoul(args.at(2))),
                   .interface = args.at(3),
                   .user_data = kDoctorUserData,
                   .security = {}});
  RoundTrip::echo(*participant, args.at(4), args.at(5));
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> args(argv + 1, argv + argc);
  try {
    if (args.size() == 7 && args.front() == "look") {
      return look(args);
    }
    if (args.size() == 6 && args.front() == "echo") {
      return echo(args);
    }
    print(stderr, "fastcycle-dds-doctor is started by `fastcycle doctor --dds`\n");
    return kWrong;
  } catch (const Wrong& error) {
    print(stderr, fmt::format("fastcycle doctor: {}\n", error.what()));
    return kWrong;
  } catch (const EngineError& error) {
    print(stderr, fmt::format("fastcycle doctor: {}\n", error.what()));
    return kWrong;
  } catch (const std::exception& error) {
    print(stderr, fmt::format("fastcycle doctor: {}\n", error.what()));
    return kFailed;
  }
}
