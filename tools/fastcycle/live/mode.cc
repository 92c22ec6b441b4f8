#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "command.h"
#include "live/session.h"
#include "live/text.h"

namespace fastcycle::tool {
namespace live {
namespace {

struct ModeOptions {
  Target target;
  std::string mode;
};

std::vector<std::string> modes_of(const protocol::Overview& overview) {
  return {overview.modes().begin(), overview.modes().end()};
}

int show(const protocol::Overview& overview, bool is_json) {
  const std::vector<std::string> modes = modes_of(overview);
  if (is_json) {
    return print_json({{"mode", modes.empty() ? Json() : Json(overview.mode())}, {"modes", modes}});
  }
  std::string text = modes.empty() ? "The application has no modes.\n" : "";
  for (const std::string& mode : modes) {
    text += (mode == overview.mode() ? "* " : "  ") + mode + "\n";
  }
  return print_text(text);
}

/// The components follow within their own activations: waits until they did.
bool wait_for(Session& session, const std::string& mode) {
  constexpr std::chrono::seconds kPatience{5};
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (session.overview().mode() != mode) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

int switch_to(Session& session, const protocol::Overview& overview, const ModeOptions& options) {
  if (overview.modes().empty()) {
    throw Failure(kWrong, "the application has no modes");
  }
  require_known(options.mode, modes_of(overview), "mode");
  protocol::Request request;
  request.mutable_switch_mode()->set_mode(options.mode);
  request.mutable_switch_mode()->set_why("fastcycle mode");
  session.client().ask(std::move(request));
  if (!wait_for(session, options.mode)) {
    throw Failure(kFailed, "the mode \"" + options.mode +
                               "\" was requested, but the application is still in \"" +
                               session.overview().mode() + "\"");
  }
  if (options.target.is_json) {
    return print_json({{"mode", options.mode}, {"was", overview.mode()}});
  }
  return print_text(options.mode == overview.mode()
                        ? "The application is in mode " + options.mode + " already.\n"
                        : "Mode " + options.mode + ", was " + overview.mode() + ".\n");
}

int mode(const ModeOptions& options) {
  Session session(options.target, "mode");
  const protocol::Overview overview = session.overview();
  return options.mode.empty() ? show(overview, options.target.is_json)
                              : switch_to(session, overview, options);
}

}  // namespace
}  // namespace live

Command add_mode(CLI::App& program) {
  CLI::App* line =
      program.add_subcommand("mode", "Show the modes of a running application, or switch the mode");
  line->footer(examples(
      "  fastcycle mode\n"
      "  fastcycle mode degraded\n"
      "  fastcycle mode --json | jq -r .mode\n"
      "\n"
      "The application must allow a switch: \"inspect\": {\"allow\": [\"lifecycle\"]}.\n"));
  const auto options = std::make_shared<live::ModeOptions>();
  line->add_option("mode", options->mode, "The mode to switch to")->type_name("MODE");
  options->target.add_to(*line);
  return {line, [options] { return live::guarded("mode", [&] { return live::mode(*options); }); }};
}

}  // namespace fastcycle::tool
