#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <google/protobuf/message.h>
#include <nlohmann/json.hpp>

#include "archive/output_file.h"
#include "archive/view_data.h"
#include "base/printable.h"
#include "broker/publisher_core.h"
#include "broker/topics.h"
#include "command.h"
#include "drive_page.h"
#include "exact_replaying.h"
#include "fastcycle/version.h"
#include "file_work.h"
#include "log_files.h"
#include "mcap/error.h"
#include "mcap/writer.h"
#include "print.h"
#include "quantity.h"
#include "record/descriptor_set.h"
#include "replay/drive_comparison.h"
#include "report/changes.h"
#include "report_file.h"

namespace fastcycle::tool {
namespace {

namespace fs = std::filesystem;
using host::TopicChange;
using nlohmann::ordered_json;

struct CompareOptions {
  ExactReplaying replaying;
  fs::path report;
  fs::path page;
  fs::path log;
  fs::path view;
  bool is_forced = false;
};

/// The new messages as a log.
///
/// @threads  Confined.
class NewLog {
 public:
  explicit NewLog(mcap::Sink& sink) : writer_(sink, {.library = "fastcycle " FASTCYCLE_VERSION}) {}

  void add(const host::DriveComparison::NewMessage& message) {
    const detail::PublisherCore& publisher = message.publisher;
    auto found = channels_.find(publisher.id);
    if (found == channels_.end()) {
      const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
      const google::protobuf::Descriptor& type = *publisher.default_instance.GetDescriptor();
      writer_.add(mcap::Schema{.id = id,
                               .name = type.full_name(),
                               .encoding = "protobuf",
                               .data = record::descriptor_set_of(type)});
      writer_.add(mcap::Channel{.id = id,
                                .schema_id = id,
                                .topic = publisher.topic.name,
                                .message_encoding = "protobuf",
                                .metadata = {{"publisher", publisher.owner.name}}});
      found = channels_.emplace(publisher.id, id).first;
    }
    const auto time_ns = static_cast<std::uint64_t>(message.publish_time_ns);
    const mcap::Bytes bytes = mcap::bytes_of(message.bytes);
    writer_.write(mcap::MessageHead{.channel_id = found->second,
                                    .sequence = static_cast<std::uint32_t>(message.sequence),
                                    .log_time_ns = time_ns,
                                    .publish_time_ns = time_ns},
                  {&bytes, 1});
    ++messages_;
  }
  void close() { writer_.close(); }

  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  mcap::Writer writer_;
  std::map<PublisherId, std::uint16_t> channels_;
  std::uint64_t messages_ = 0;
};

ordered_json to_json(const std::vector<host::ExactReplayResult>& results) {
  ordered_json json = ordered_json::object();
  for (const host::ExactReplayResult& result : results) {
    json[result.component] = {{"executed", result.is_executed},
                              {"recorded_activations", result.recorded},
                              {"activations", result.activations},
                              {"not_recorded", result.not_recorded},
                              {"why", result.why}};
  }
  return json;
}

/// Notes on components that were not executed, or not to their end.
std::string to_notes(const std::vector<host::ExactReplayResult>& results) {
  std::string text;
  for (const host::ExactReplayResult& result : results) {
    if (!result.is_component) {
      continue;
    }
    if (!result.is_executed) {
      text += fmt::format("{}: not executed: {}\n", result.component, result.why);
    } else if (!result.why.empty()) {
      text += fmt::format("{}: {} activations of {}: {}\n", result.component, result.activations,
                          result.recorded, result.why);
    }
    if (result.not_recorded > 0 && result.outputs == 0) {
      text += fmt::format("{}: {} published messages are on topics that the log does not contain\n",
                          result.component, result.not_recorded);
    }
  }
  return text;
}

/// The file of the page; null without one. Made before the work: it may be refused.
std::unique_ptr<archive::OutputFile> page_file(const CompareOptions& options) {
  if (options.page.empty()) {
    return nullptr;
  }
  std::vector<fs::path> inputs = options.replaying.files;
  inputs.push_back(options.view);
  inputs.push_back(options.replaying.configuration.load.file);
  return std::make_unique<archive::OutputFile>(
      options.page,
      archive::OutputFile::Options{.may_replace = options.is_forced, .inputs = inputs});
}

/// The page with both drives. `new_log` has the new messages.
int write_page(const CompareOptions& options, const DriveView& view,
               const std::vector<TopicChange>& topics, const fs::path& new_log,
               archive::OutputFile& file, FileWork& work) {
  const LogFiles recorded(options.replaying.files);
  std::string data;
  try {
    const archive::ViewOptions times{.zero_ns = archive::first_message_ns(recorded.readers())};
    data = archive::view_data(recorded.readers(), view.text, times, recorded.bytes(),
                              work.progress(recorded.name(), recorded.bytes()))
               .json;
    data.pop_back();  // Its last brace.
    const LogFiles now({new_log});
    archive::ViewOptions new_times = times;
    new_times.may_be_empty = true;
    ordered_json differences = host::json_of(topics, static_cast<std::int64_t>(*times.zero_ns));
    data += ",\"other\":" + archive::view_data(now.readers(), view.text, new_times).json +
            ",\"differences\":";
    // Nothing in it ends the element of the page that it stands in.
    for (const char letter :
         differences.dump(-1, ' ', false, ordered_json::error_handler_t::replace)) {
      data += letter == '<' ? std::string("\\u003c") : std::string(1, letter);
    }
    data += '}';
  } catch (const archive::ViewError& error) {
    return print_error("compare", view.name + ": " + error.what());
  }
  write_drive_page(recorded.name() + ", recorded and new", data, file.sink());
  file.commit();
  print_to(stdout, "{}: {}\n", options.page.string(), bytes_text(fs::file_size(options.page)));
  return kDone;
}

/// A file for the new messages: where the user wants it, or one beside the page that goes away.
class NewLogFile {
 public:
  explicit NewLogFile(const CompareOptions& options)
      : is_wanted_(!options.log.empty()),
        file_(is_wanted_ ? options.log : fs::path(options.page.string() + ".mcap"),
              {.may_replace = options.is_forced || !is_wanted_, .inputs = options.replaying.files}),
        log_(file_.sink()) {}

  [[nodiscard]] NewLog& log() { return log_; }
  /// Ends it. Returns where it is, as long as this lives.
  fs::path finish() {
    log_.close();
    if (is_wanted_) {
      file_.commit();
    }
    return is_wanted_ ? file_.path() : file_.unfinished();
  }

 private:
  const bool is_wanted_;
  archive::OutputFile file_;
  NewLog log_;
};

int compare_drive(CompareOptions& options, const ReportFile& report_file) {
  FileWork work(true);  // Before any other thread, none of which may take its signals.
  const auto replayed = ReplayedApplication::make("compare", options.replaying);
  if (replayed == nullptr) {
    return kWrong;
  }
  const DriveView view = DriveView::read(options.view);
  const std::unique_ptr<archive::OutputFile> page = page_file(options);
  std::unique_ptr<NewLogFile> new_log;
  if (!options.log.empty() || !options.page.empty()) {
    new_log = std::make_unique<NewLogFile>(options);
  }
  host::DriveComparison comparison(replayed->schedule());
  if (new_log != nullptr) {
    comparison.on_new_message = [&](const auto& message) { new_log->log().add(message); };
  }
  bool is_stopped = false;
  replayed->replay().listener = &comparison;
  const auto show = work.steps("executing", "activations");
  replayed->replay().run([&](const host::ExactReplay::Progress& progress) {
    is_stopped = !show(progress);
    return !is_stopped;
  });
  comparison.finish();
  const std::vector<host::ExactReplayResult> results = replayed->replay().results();
  const std::vector<TopicChange> topics = comparison.topics();
  const std::int64_t begin_ns = replayed->replay().begin_ns();
  print_text(stdout, host::table_of(topics, begin_ns) + to_notes(results));
  const ordered_json report = {{"topics", host::json_of(topics, begin_ns)},
                               {"components", to_json(results)}};
  const std::string obstacle = report_file.write(
      base::printable_json(report.dump(2, ' ', false, ordered_json::error_handler_t::replace)) +
      "\n");
  if (!obstacle.empty()) {
    print_to(stderr, "fastcycle compare: the report {} was not written: {}\n",
             options.report.string(), obstacle);
    static_cast<void>(flush_output());
    return kFailed;
  }
  if (is_stopped) {
    print_text(stderr,
               "fastcycle compare: stopped on request; not all activations were executed\n");
    static_cast<void>(flush_output());
    return kFailed;
  }
  const fs::path written = new_log == nullptr ? fs::path() : new_log->finish();
  if (!options.log.empty()) {
    print_to(stdout, "{}: {} new messages\n", options.log.string(), new_log->log().messages());
  }
  if (page != nullptr) {
    if (const int code = write_page(options, view, topics, written, *page, work); code != kDone) {
      return code;
    }
  }
  const int code = flush_output();
  return code == kDone && !std::ranges::all_of(topics, &TopicChange::is_equal) ? kProblems : code;
}

int compare(CompareOptions& options) {
  if (const std::string wrong = options.replaying.find_wrong(); !wrong.empty()) {
    return print_error("compare", wrong);
  }
  if (!options.page.empty() && !has_drive_page("compare")) {
    return kFailed;
  }
  const ReportFile report_file(options.report, options.replaying.files);
  if (const std::string obstacle = report_file.find_obstacle(); !obstacle.empty()) {
    return print_error("compare",
                       "the report " + options.report.string() + " cannot be written: " + obstacle);
  }
  try {
    return compare_drive(options, report_file);
  } catch (const mcap::Error& error) {
    return print_error("compare", error.what());
  }
}

}  // namespace

Command add_compare(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "compare", "Execute a log with changed components, and report how their messages differ");
  line->footer(examples(
      "  fastcycle compare drive.mcap --library-path build/new/lib\n"
      "  fastcycle compare drive.mcap app.json --set planning.margin_m=1.5 --page both.html\n"
      "  fastcycle compare drive.mcap app.json --component planning --report out.json\n"
      "\n"
      "Like verify, but for changed components: each component receives its recorded inputs, and\n"
      "each message that it publishes is compared field by field with the recorded message of the\n"
      "same activation. Mean and max are the size of the change, over all values that changed.\n"
      "\n"
      "Exit codes: 0 all equal, 1 stopped or not written, 2 wrong input, 3 a difference.\n"));
  const auto options = std::make_shared<CompareOptions>();
  options->replaying.add_to(*line);
  options->replaying.add_input_to(*line);
  line->add_option("--report", options->report, "Write the results as JSON")->type_name("FILE");
  line->add_option("--page", options->page,
                   "Write a page as `fastcycle render` does, with both drives superimposed")
      ->type_name("FILE.html");
  line->add_option("--view", options->view,
                   "Topics and fields that the page shows, JSON (docs/reference/page.md)")
      ->type_name("FILE");
  line->add_option("--log", options->log, "Write the new messages to a log")
      ->type_name("FILE.mcap");
  line->add_flag("--force", options->is_forced, "Overwrite an existing page or log");
  return {line, [options] { return compare(*options); }};
}

}  // namespace fastcycle::tool
