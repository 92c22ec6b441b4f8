#include "run_observers.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "inspect/refusal.h"
#include "inspect/server.h"
#include "page.h"
#include "report/report_parts.h"
#include "trace/tracer.h"
#include "web/server.h"

namespace fastcycle::tool {

/// Lets browsers and Foxglove pause what is played, and set its rate.
class PlayControl final : public inspect::PlaybackControl {
 public:
  PlayControl(host::WallPace& pace, const host::Application& application,
              const host::Replay& replay)
      : pace_(pace), application_(application), replay_(replay) {}

  void obey(const inspect::protocol::ControlPlayback& control) override {
    using Control = inspect::protocol::ControlPlayback;
    if (control.has_seek()) {
      throw inspect::Refusal(inspect::protocol::Error::KIND_REFUSED,
                             "the recording is played into components, which cannot seek",
                             "use fastcycle view LOG to show a recording and seek in it");
    }
    if (control.speed() > 0) {
      pace_.set_rate(std::clamp(control.speed(), kMinRate, kMaxRate));
    }
    if (control.command() != Control::COMMAND_NONE) {
      pace_.set_paused(control.command() == Control::COMMAND_PAUSE);
    }
  }

  [[nodiscard]] inspect::protocol::Playback state() const override {
    using Playback = inspect::protocol::Playback;
    Playback playback;
    playback.set_status(pace_.is_paused() ? Playback::STATUS_PAUSED : Playback::STATUS_PLAYING);
    playback.set_now_ns(base::to_ns(application_.clock().now()));
    playback.set_speed(pace_.rate());
    playback.set_begin_ns(base::to_ns(replay_.begin()));
    playback.set_end_ns(base::to_ns(replay_.begin() + replay_.length()));
    return playback;
  }

 private:
  host::WallPace& pace_;
  const host::Application& application_;
  const host::Replay& replay_;
};

namespace {

/// The result of a trace, for the report.
nlohmann::ordered_json json_of(const trace::TraceReport& trace) {
  return {{"file", trace.file},
          {"problem", trace.problem},
          {"bytes", trace.bytes},
          {"slices", trace.slices},
          {"flows", trace.flows},
          {"instants", trace.instants},
          {"samples", trace.samples},
          {"lost",
           {{"activations", trace.activations_lost},
            {"events", trace.events_lost},
            {"notes", trace.notes_lost}}}};
}

/// The same for people.
std::string text_of(const trace::TraceReport& trace) {
  std::string text = fmt::format("\nTRACED {} activations, {} flows, {:.1f} MB, {}\n  {}\n",
                                 trace.slices, trace.flows, static_cast<double>(trace.bytes) / 1e6,
                                 trace.lost() == 0 ? "nothing lost" : "with losses", trace.file);
  if (!trace.problem.empty()) {
    text += "  incomplete: " + trace.problem + "\n";
  }
  if (trace.lost() > 0) {
    text += fmt::format(
        "  lost: {} activations that exceeded the rate, {} events without space, {} drops and "
        "faults\n",
        trace.activations_lost, trace.events_lost, trace.notes_lost);
  }
  return text;
}

}  // namespace

struct RunObservers::Observers {
  const RunOptions& options;
  const config::ApplicationDescription& description;
  std::optional<PlayControl> play_control;    // Outlives its callers.
  std::optional<inspect::Server> inspection;  // Outlives what it looks at.
  std::optional<web::Server> live_server;
  std::optional<trace::Tracer> tracer;
};

std::string RunObservers::find_absent(const RunOptions& /*options*/,
                                      const config::ApplicationDescription& /*description*/) {
  return {};
}

RunObservers::RunObservers(const RunOptions& options,
                           const config::ApplicationDescription& description)
    : observers_(std::make_unique<Observers>(options, description)) {
  if (const auto traced = options.trace.describe(description)) {
    observers_->tracer.emplace(*traced, inputs_of(options));
  }
}

RunObservers::~RunObservers() = default;

void RunObservers::add_servers(host::Application& application, const Played& played,
                               bool has_processes) {
  const RunOptions& options = observers_->options;
  const config::ApplicationDescription& description = observers_->description;
  std::optional<inspect::Server>& inspection = observers_->inspection;
  const auto shown = options.live.describe(description);
  const bool is_wanted = options.inspect.is_wanted(description);
  if (!is_wanted && !shown) {
    return;
  }
  // Without a folder no tool finds it: it is there for the live server alone.
  inspection.emplace(application, options.inspect.describe(description),
                     is_wanted ? inspect::socket_folder() : std::filesystem::path());
  application.add(*inspection);
  if (played.pace != nullptr && played.replay != nullptr) {
    inspection->offer(observers_->play_control.emplace(*played.pace, application, *played.replay));
  }
  if (has_processes) {
    inspection->offer("followers", [&application] {
      return fmt::format("{{\"followers\": [{}]}}",
                         fmt::join(application.follower_news().all(), ", "));
    });
  }
  if (!description.chains.empty()) {
    inspection->offer(
        "chains", [&application] { return to_json(application.chains_of_all_processes()).dump(); });
  }
  if (shown) {
    observers_->live_server.emplace(
        application, *shown, [&inspection] { return inspection->connect(); }, live_page_html());
    application.add(*observers_->live_server);
  }
}

void RunObservers::add_trace(host::Application& application) {
  if (observers_->tracer) {
    application.add(*observers_->tracer);
  }
}

std::vector<std::string> RunObservers::addresses() const {
  std::vector<std::string> lines;
  if (const auto& server = observers_->live_server) {
    lines.push_back("live: " + server->url());
    if (!server->fingerprint().empty()) {
      lines.push_back("live: SHA-256 of its certificate: " + server->fingerprint());
    }
  }
  return lines;
}

std::vector<host::ToolReport> RunObservers::reports() const {
  if (!observers_->tracer) {
    return {};
  }
  const trace::TraceReport traced = observers_->tracer->report();
  return {{.name = "trace", .json = json_of(traced).dump(), .table = text_of(traced)}};
}

std::string RunObservers::trace_problem() const {
  return observers_->tracer ? observers_->tracer->report().problem : std::string();
}

}  // namespace fastcycle::tool
