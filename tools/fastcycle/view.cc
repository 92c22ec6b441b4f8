#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/clock.h"
#include "command.h"
#include "config/problem.h"
#include "duration.h"
#include "live_options.h"
#include "page.h"
#include "playback/played_log.h"
#include "print.h"
#include "stop_signals.h"
#include "web/server.h"

namespace fastcycle::tool {
namespace {

struct ViewOptions {
  std::vector<std::filesystem::path> files;
  LiveOptions live{.is_asked = true, .at = {}};
  double speed = 1.0;
  std::string start;
  bool is_paused = false;
};

int wrong(const std::string& sentence) {
  print_to(stderr, "fastcycle view: {}\n", sentence);
  return kWrong;
}

/// Waits for Ctrl-C.
class Request {
 public:
  void make() {
    const std::lock_guard lock(mutex_);
    is_made_ = true;
    made_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    made_.wait(lock, [this] { return is_made_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable made_;
  bool is_made_ = false;
};

std::optional<Time> start_of(const ViewOptions& options) {
  if (options.start.empty()) {
    return std::nullopt;
  }
  const record::RecordingReader reader(options.files);
  const Duration start = *parse_duration(options.start);
  if (const Duration length = reader.end() - reader.begin(); start > length) {
    throw std::runtime_error(
        fmt::format("--start {} is after the end of the recording, which is {:.3f} s long",
                    options.start, static_cast<double>(length.count()) / 1e9));
  }
  return reader.begin() + start;
}

int show(const ViewOptions& options) {
  const sigset_t signals = block_stop_signals();
  playback::PlayedLog log(options.files, {.speed = options.speed,
                                          .is_paused = options.is_paused,
                                          .start = start_of(options),
                                          .on_problem = [](const std::string& what) {
                                            print_to(stderr, "fastcycle view: {}; paused there\n",
                                                     what);
                                          }});
  web::Server server(
      *options.live.describe({}), [&log] { return log.connect(); }, live_page_html(),
      [](LogLevel, const std::string& text) { print_to(stderr, "fastcycle view: {}\n", text); });
  config::Problems problems;
  server.open(problems);
  if (problems.has_errors()) {
    return wrong(problems.all().front().message);
  }
  std::vector<base::Refusal> refusals;
  log.start(refusals);
  server.start(refusals);
  for (const std::string& note : log.notes()) {
    print_to(stderr, "fastcycle view: {}\n", note);
  }
  const double length_s = static_cast<double>((log.end() - log.begin()).count()) / 1e9;
  print_to(stdout, "{}: {:.3f} s, at\n  {}\nCtrl-C ends\n", log.name(), length_s, server.url());
  static_cast<void>(flush_output());
  Request end;
  {
    const StopSignals stop_signals(signals, [&end] { end.make(); });
    end.wait();
  }
  server.stop();
  log.stop();
  return kDone;
}

int view(const ViewOptions& options) {
  if (const std::string sentence = options.live.find_wrong(); !sentence.empty()) {
    return wrong(sentence);
  }
  if (!(options.speed >= playback::PlayedLog::kMinSpeed &&
        options.speed <= playback::PlayedLog::kMaxSpeed)) {
    return wrong("--rate expects a number from 0.01 to 1000");
  }
  if (!options.start.empty() && !parse_duration(options.start)) {
    return wrong(
        "--start expects a time above zero with its unit, as 500ms, 10s or 2min, and not \"" +
        options.start + "\"");
  }
  try {
    return show(options);
  } catch (const std::exception& error) {
    return wrong(error.what());
  }
}

}  // namespace

Command add_view(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("view", "Show a recording in a browser or in Foxglove, with seeking");
  line->footer(examples(
      "  fastcycle view drive.mcap\n"
      "  fastcycle view drive_0001.mcap drive_0002.mcap\n"
      "  fastcycle view drive.mcap --start 12s --paused\n"
      "  fastcycle view drive.mcap --live 127.0.0.1:9000\n"
      "\n"
      "Open the URL that it prints, or the address in Foxglove (Open connection, Foxglove\n"
      "WebSocket). No component runs: the messages are those of the file. To play them\n"
      "into components, see fastcycle play.\n"));
  const auto options = std::make_shared<ViewOptions>();
  line->add_option("recording", options->files, "The files of one recording, or any MCAP file")
      ->required()
      ->type_name("FILE.mcap");
  options->live.add_to(*line);
  line->add_option("--rate", options->speed, "Speed factor of time")->type_name("X");
  line->add_option("--start", options->start, "Start time, from the beginning of the recording")
      ->type_name("TIME");
  line->add_flag("--paused", options->is_paused, "Start paused");
  return {line, [options] { return view(*options); }};
}

}  // namespace fastcycle::tool
