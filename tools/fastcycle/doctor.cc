#include "archive/doctor.h"

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/printable.h"
#include "command.h"
#include "duration.h"
#include "file_work.h"
#include "loading/component_library.h"
#include "machine/examine.h"
#include "mcap/file.h"
#include "option_values.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kTime = "2s";
constexpr const char* kTimeOfDds = "10s";  // Some announce themselves every 8 s.

/// The options that apply only to DDS.
struct DdsOptions {
  bool is_wanted = false;
  std::optional<std::uint32_t> domain;
  std::string interface;
  std::string engine;
  std::string security;
};

struct DoctorOptions {
  std::vector<std::filesystem::path> files;
  std::string time;
  DdsOptions dds;
  bool is_json = false;
  bool is_quiet = false;
};

std::string line_of(const Json& json) {
  return base::printable_json(json.dump(-1, ' ', false, Json::error_handler_t::replace)) + "\n";
}

std::string json_of(const archive::Finding& finding) {
  const mcap::Problem& problem = finding.problem;
  Json json{{"file", problem.place.file}, {"severity", finding.is_warning ? "warning" : "error"}};
  if (problem.place.offset != mcap::Place::kWholeFile) {
    json["offset"] = problem.place.offset;
  }
  if (problem.place.offset_in_chunk) {
    json["offset_in_chunk"] = *problem.place.offset_in_chunk;
  }
  json["record"] = problem.record;
  json["expected"] = problem.expected;
  json["found"] = problem.found;
  return line_of(json);
}

std::string text_of(const archive::Finding& finding) {
  return (finding.is_warning ? "warning: " : "") + to_string(finding.problem) + "\n";
}

std::string conclusion(const std::string& file, const archive::Diagnosis& diagnosis, bool is_json) {
  if (is_json) {
    return line_of({{"file", file},
                    {"messages", diagnosis.messages},
                    {"chunks", diagnosis.chunks},
                    {"errors", diagnosis.errors},
                    {"warnings", diagnosis.warnings}});
  }
  const auto counted = [](std::uint64_t count, const std::string& word) {
    return std::to_string(count) + " " + word + (count == 1 ? "" : "s");
  };
  std::string text = file + ": " + counted(diagnosis.messages, "message") + " in " +
                     counted(diagnosis.chunks, "chunk") + ": ";
  text += diagnosis.errors == 0 ? "in order" : counted(diagnosis.errors, "error");
  if (diagnosis.warnings > 0) {
    text += ", " + counted(diagnosis.warnings, "warning");
  }
  return text + "\n";
}

archive::Diagnosis look_at(const std::filesystem::path& path, const DoctorOptions& options,
                           Output& output) {
  const mcap::FileSource file(path);
  FileWork work(!options.is_quiet);
  const archive::Diagnosis diagnosis = archive::diagnose(
      file,
      [&](const archive::Finding& finding) {
        output.write(options.is_json ? json_of(finding) : text_of(finding));
      },
      {}, work.progress(path.filename().string(), file.size()));
  output.write(conclusion(path.string(), diagnosis, options.is_json));
  return diagnosis;
}

/// The domain that nodes of this shell are in.
std::string domain_of_environment() {
  const char* const text = std::getenv("ROS_DOMAIN_ID");
  const auto number = parse_number(text == nullptr ? "" : text);
  const bool is_domain = number && *number >= 0 && *number <= 232 &&
                         *number == static_cast<double>(static_cast<int>(*number));
  return is_domain ? std::to_string(static_cast<int>(*number)) : "0";
}

/// Becomes the helper program that links DDS, which the tool does not; returns only if that fails.
int look_at_dds(const DoctorOptions& options) {
  const DdsOptions& dds = options.dds;
  const auto time = *parse_duration(options.time.empty() ? kTimeOfDds : options.time);
  std::vector<std::string> words = {
      host::helper_program("fastcycle-dds-doctor").string(),
      "look",
      options.is_json ? "JSON" : "TEXT",
      dds.engine,
      dds.domain ? std::to_string(*dds.domain) : domain_of_environment(),
      dds.interface,
      dds.security,
      std::to_string(std::chrono::ceil<std::chrono::milliseconds>(time).count())};
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  execv(arguments.front(), arguments.data());
  if (errno == ENOENT) {
    print_to(stderr,
             "fastcycle doctor: this installation has no DDS support; install the package "
             "fastcycle-dds\n");
  } else {
    print_to(stderr, "fastcycle doctor: {}: {}\n", words.front(), std::strerror(errno));
  }
  return kFailed;
}

int doctor(const DoctorOptions& options) {
  if (options.dds.is_wanted) {
    return look_at_dds(options);
  }
  Output output;
  if (options.files.empty()) {
    return machine::examine(*parse_duration(options.time.empty() ? kTime : options.time),
                            options.is_json, output);
  }
  int result = kDone;
  for (const std::filesystem::path& file : options.files) {
    try {
      if (look_at(file, options, output).errors > 0) {
        result = result == kDone ? kProblems : result;
      }
    } catch (const mcap::Error& error) {
      print_to(stderr, "fastcycle doctor: {}\n", error.what());
      result = kFailed;
    }
  }
  output.flush();
  return result;
}

}  // namespace

Command add_doctor(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "doctor", "Check this machine for latency problems; or check logs, or the DDS network");
  line->footer(examples(
      "  fastcycle doctor\n"
      "  fastcycle doctor drive.mcap\n"
      "  fastcycle doctor --json drive_*.mcap\n"
      "  fastcycle doctor --dds --domain 42 --interface eth0\n"
      "\n"
      "Without a file: the privileges, kernel settings and wake-up times that determine latency,\n"
      "worst first, each with the command that changes it. With --dds: the network, the\n"
      "participants of the domain, and why messages between them are not delivered.\n"
      "\n"
      "Exit codes: 0 no problems (warnings and possible improvements do not count), 3 problems\n"
      "found, 1 a file cannot be read, 2 the command line is wrong.\n"));
  const auto options = std::make_shared<DoctorOptions>();
  CLI::Option* const files =
      line->add_option("files", options->files, "The logs")->type_name("FILE…");
  line->add_option("--for", options->time,
                   "Duration of each wake-up measurement (2s), or of watching the network (10s)")
      ->type_name("TIME")
      ->check(is_time())
      ->excludes(files);
  CLI::Option* const dds =
      line->add_flag("--dds", options->dds.is_wanted, "Check DDS: the network and the ROS 2 nodes")
          ->excludes(files);
  line->add_option("--domain", options->dds.domain, "DDS domain, 0 to 232 (ROS_DOMAIN_ID, else 0)")
      ->type_name("N")
      ->check(is_number_from(0, 232))
      ->needs(dds);
  line->add_option("--interface", options->dds.interface, "Check only this network interface")
      ->type_name("NAME")
      ->needs(dds);
  line->add_option("--engine", options->dds.engine, "DDS implementation to use (cyclone)")
      ->type_name("cyclone|fast")
      ->needs(dds);
  line->add_option("--security", options->dds.security, "Enclave to use")
      ->type_name("DIR")
      ->needs(dds);
  line->add_flag("--json", options->is_json,
                 "Print one JSON object; for logs, one line for each finding");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line");
  return {line, [options] { return doctor(*options); }};
}

}  // namespace fastcycle::tool
