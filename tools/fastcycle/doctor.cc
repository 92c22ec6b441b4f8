#include "archive/doctor.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "command.h"
#include "duration.h"
#include "file_work.h"
#include "machine/examine.h"
#include "mcap/file.h"
#include "option_values.h"
#include "print.h"

namespace fastcycle::tool {
namespace {

using Json = nlohmann::ordered_json;

struct DoctorOptions {
  std::vector<std::filesystem::path> files;
  std::string time = "2s";
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

int doctor(const DoctorOptions& options) {
  Output output;
  if (options.files.empty()) {
    return machine::examine(*parse_duration(options.time), options.is_json, output);
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
      "doctor", "What this machine allows, and how late it is; or check everything of logs");
  line->footer(examples(
      "  fastcycle doctor\n"
      "  fastcycle doctor drive.mcap\n"
      "  fastcycle doctor --json drive_*.mcap\n"
      "\n"
      "Without a file: the rights, settings of the kernel and wake-ups that latencies hang on, "
      "the\n"
      "worst first, each with the command that changes it.\n"
      "\n"
      "Exit codes: 0 all in order (warnings and what could be better do not count), 3 problems\n"
      "found, 1 a file cannot be read, 2 the command line is wrong.\n"));
  const auto options = std::make_shared<DoctorOptions>();
  CLI::Option* const files =
      line->add_option("files", options->files, "The logs")->type_name("FILE…");
  line->add_option("--for", options->time, "Measure each way of waking up so long (2s)")
      ->type_name("TIME")
      ->check(is_time())
      ->excludes(files);
  line->add_flag("--json", options->is_json,
                 "One JSON object; of logs, one a line for each finding");
  line->add_flag("--quiet", options->is_quiet, "No progress line");
  return {line, [options] { return doctor(*options); }};
}

}  // namespace fastcycle::tool
