#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "archive/output_file.h"
#include "archive/view_data.h"
#include "command.h"
#include "drive_page.h"
#include "file_work.h"
#include "log_files.h"
#include "print.h"
#include "quantity.h"
#include "record/recorded_schedule.h"
#include "rewriting.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;

struct RenderOptions {
  std::vector<fs::path> files;
  fs::path output;
  fs::path view;
  std::string start;
  std::string end;
  bool is_forced = false;
  bool is_quiet = false;
};

int render_log(const RenderOptions& options, const archive::ViewOptions& times) {
  if (const std::string twice = record::find_named_twice(options.files); !twice.empty()) {
    return print_error("render", twice);
  }
  const DriveView view = DriveView::read(options.view);
  const LogFiles log(options.files);
  for (const mcap::Reader* const file : log.readers()) {
    if (file->problem()) {
      print_problem("render", *file->problem(), "the readable part was used");
    }
  }
  archive::ViewOptions from_log = times;
  const std::uint64_t first_ns = archive::first_message_ns(log.readers());
  from_log.begin_ns += first_ns;
  if (from_log.end_ns) {
    *from_log.end_ns += first_ns;
  }
  const fs::path output = options.output.empty()
                              ? fs::path(options.files.front()).replace_extension(".html")
                              : options.output;
  std::vector<fs::path> inputs = options.files;
  if (!options.view.empty()) {
    inputs.push_back(options.view);
  }
  FileWork work(!options.is_quiet);
  archive::OutputFile file(output, {.may_replace = options.is_forced, .inputs = inputs});
  archive::ViewData data;
  try {
    data = archive::view_data(log.readers(), view.text, from_log, log.bytes(),
                              work.progress(log.name(), log.bytes()));
  } catch (const archive::ViewError& error) {
    return print_error("render", view.name + ": " + error.what());
  }
  write_drive_page(log.name(), data.json, file.sink());
  file.commit();
  if (!options.is_quiet) {
    for (const std::string& layer : data.left_out) {
      print_to(stderr, "fastcycle render: not shown: {}\n", layer);
    }
    print_to(stdout, "{}: {}, {} messages\n", output.string(), bytes_text(fs::file_size(output)),
             data.messages);
  }
  return flush_output();
}

int render(const RenderOptions& options) {
  if (!has_drive_page("render")) {
    return kFailed;
  }
  std::optional<std::uint64_t> start_ns;
  archive::ViewOptions times;
  std::string wrong = read_offset("--start", options.start, start_ns);
  wrong = wrong.empty() ? read_offset("--end", options.end, times.end_ns) : wrong;
  times.begin_ns = start_ns.value_or(0);
  if (wrong.empty() && times.end_ns && *times.end_ns <= times.begin_ns) {
    wrong = "--end expects a time after --start";
  }
  return wrong.empty() ? render_log(options, times) : print_error("render", wrong);
}

}  // namespace

Command add_render(CLI::App& program) {
  CLI::App* line = program.add_subcommand("render", "Write a page that plays the drive of a log");
  line->footer(
      examples("  fastcycle render drive.mcap\n"
               "  fastcycle render drive.mcap -o first.html --end 30s\n"
               "  fastcycle render drive_*.mcap -o drive.html\n"
               "  fastcycle render drive.mcap --view other.json\n"));
  const auto options = std::make_shared<RenderOptions>();
  line->add_option("files", options->files, "The log, all files of a split one")
      ->required()
      ->type_name("FILE");
  line->add_option("-o,--output", options->output,
                   "Output (beside the log: drive.html for drive.mcap)")
      ->type_name("FILE");
  line->add_option("--start", options->start, "Start time, from the beginning of the log: 10s")
      ->type_name("TIME");
  line->add_option("--end", options->end, "End time, from the beginning of the log: 15s")
      ->type_name("TIME");
  line->add_option("--view", options->view,
                   "Topics and fields that the page shows, JSON (docs/reference/page.md)")
      ->type_name("FILE");
  line->add_flag("--force", options->is_forced, "Overwrite an existing output");
  line->add_flag("--quiet", options->is_quiet, "Print no progress line and no summary");
  return {line, [options] { return render(*options); }};
}

}  // namespace fastcycle::tool
