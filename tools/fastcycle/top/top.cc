#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <CLI/App.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/printable.h"
#include "command.h"
#include "duration.h"
#include "inspect/client.h"
#include "print.h"
#include "top/layout.h"
#include "top/model.h"
#include "top/terminal.h"
#include "top/view.h"
#include "top/watch.h"

namespace fastcycle::tool {
namespace {

using std::chrono::milliseconds;
using namespace std::chrono_literals;

constexpr milliseconds kShortest = 100ms;
constexpr int kTextWidth = 120;  // Of what goes into a file or a pipe.

struct TopOptions {
  std::string application;
  std::string interval = "1s";
  bool is_once = false;
  bool is_json = false;
};

/// The snapshots of an application, and values derived from successive ones.
class History {
 public:
  /// Adds a new snapshot.
  void add(top::Snapshot snapshot) {
    if (newest_) {
      before_ = std::move(newest_);
    }
    newest_ = std::move(snapshot);
  }

  [[nodiscard]] top::Model model() const {
    return newest_ ? top::model_of(before_ ? &*before_ : nullptr, *newest_) : top::Model();
  }

 private:
  std::optional<top::Snapshot> before_;
  std::optional<top::Snapshot> newest_;
};

int show_once(inspect::Client& client, milliseconds interval, bool is_json) {
  History history;
  history.add(top::snapshot_of(client));
  std::this_thread::sleep_for(interval);
  history.add(top::snapshot_of(client));
  const top::Model model = history.model();
  const int width = isatty(STDOUT_FILENO) != 0 ? top::terminal_size().width : kTextWidth;
  const std::string text =
      is_json ? base::printable_json(to_json(model).dump(2)) + "\n" : top::to_text(model, width);
  print_text(stdout, text);
  return flush_output();
}

/// The current problem of the connection, for display; empty: none.
std::string notice_of(const top::Watch& watch, milliseconds interval) {
  const auto silence = top::Watch::Clock::now() - watch.last_update();
  return silence < interval + 2s
             ? ""
             : fmt::format("no answer for {} s",
                           std::chrono::duration_cast<std::chrono::seconds>(silence).count());
}

/// The screen, until somebody ends it. Returns why the application is not there any more, if that
/// was the end.
std::optional<std::string> show_until_end(std::unique_ptr<inspect::Client> client,
                                          milliseconds interval) {
  top::Terminal terminal(top::look_of_environment());
  top::Watch watch(std::move(client), interval);
  History history;
  top::Model model = history.model();
  top::View view = top::first_view();
  for (;;) {
    const top::TerminalSize size = top::terminal_size();
    view.notice = notice_of(watch, interval);
    terminal.show(lay_out(model, view, size.width, size.height));
    const top::Terminal::Event event = terminal.wait(watch.descriptor(), 1s);
    if (event.is_over) {
      return std::nullopt;
    }
    top::Watch::News news = watch.take();
    if (news.end) {
      return news.end;
    }
    if (news.snapshot) {
      history.add(std::move(*news.snapshot));
    }
    for (const top::Key& key : event.keys) {
      if (!press(view, key, model, size.width, size.height)) {
        return std::nullopt;
      }
    }
    if (!view.is_paused) {
      model = history.model();
    }
  }
}

int show_screen(std::unique_ptr<inspect::Client> client, milliseconds interval) {
  if (!top::Terminal::is_there()) {
    print_text(stderr,
               "fastcycle top: standard input and output are not a usable terminal\n"
               "  --once prints the current state without one\n");
    return kWrong;
  }
  const std::string name = client->welcome().application();
  const std::optional<std::string> end = show_until_end(std::move(client), interval);
  if (end && !end->empty()) {
    print_to(stderr, "fastcycle top: {}\n", *end);
    return kFailed;
  }
  if (end) {
    print_to(stdout, "fastcycle top: {} has ended\n", name);
  }
  return flush_output();
}

int run_top(const TopOptions& options) {
  const std::optional<Duration> interval = parse_duration(options.interval);
  if (!interval || *interval < kShortest) {
    print_to(stderr, "fastcycle top: --interval expects 100ms or more, such as 2s, not \"{}\"\n",
             options.interval);
    return kWrong;
  }
  const auto rounded = std::chrono::duration_cast<milliseconds>(*interval);
  try {
    auto client = std::make_unique<inspect::Client>(
        inspect::find_application(options.application).socket, "fastcycle top");
    return options.is_once || options.is_json ? show_once(*client, rounded, options.is_json)
                                              : show_screen(std::move(client), rounded);
  } catch (const inspect::ClientError& error) {
    print_to(stderr, "fastcycle top: {}\n", error.what());
    if (!error.hint().empty()) {
      print_to(stderr, "  {}\n", error.hint());
    }
    return kFailed;
  }
}

}  // namespace

Command add_top(CLI::App& program) {
  CLI::App* line = program.add_subcommand(
      "top", "Monitor the components and topics of a running application in the terminal");
  line->footer(
      examples("  fastcycle top\n"
               "  fastcycle top --app rav4 --interval 500ms\n"
               "  fastcycle top --once\n"
               "  fastcycle top --json | jq '.topics[] | select(.dropped != {})'\n"));
  const auto options = std::make_shared<TopOptions>();
  line->add_option("--app", options->application, "The running application (the only one)")
      ->type_name("NAME");
  line->add_option("--interval", options->interval, "Time between updates: 500ms, 2s")
      ->type_name("TIME")
      ->capture_default_str();
  line->add_flag("--once", options->is_once, "Print the current state and exit");
  line->add_flag("--json", options->is_json, "Print the current state as one JSON document");
  return {line, [options] { return run_top(*options); }};
}

}  // namespace fastcycle::tool
