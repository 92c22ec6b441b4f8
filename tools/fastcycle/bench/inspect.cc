// inspect: what it costs the application that five `fastcycle topic echo` look at its topic.

#include <algorithm>
#include <array>
#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench/beside.h"
#include "bench/modes.h"
#include "inspect/server.h"

namespace fastcycle::tool::bench {
namespace {

constexpr const char* kAsked = "asked";    ///< The socket is open, without clients.
constexpr const char* kEchoed = "echoed";  ///< Five look.
constexpr int kEchoes = 5;

/// A process `fastcycle topic echo payload` that writes into a file; the destructor removes both.
class Echo {
 public:
  explicit Echo(const std::filesystem::path& runtime_folder, int number)
      : output_(runtime_folder / fmt::format("echo-{}.txt", number)) {
    std::string folder = "XDG_RUNTIME_DIR=" + runtime_folder.string();
    std::vector<char*> environment{folder.data()};
    for (char** word = environ; *word != nullptr; ++word) {
      if (!std::string_view(*word).starts_with("XDG_RUNTIME_DIR=")) {
        environment.push_back(*word);
      }
    }
    environment.push_back(nullptr);
    const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
    std::array<std::string, 4> words{program, "topic", "echo", "payload"};
    std::array<char*, words.size() + 1> pointers{};
    std::ranges::transform(words, pointers.begin(), [](std::string& word) { return word.data(); });
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output_.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const int error = posix_spawn(&process_, program.c_str(), &actions, nullptr, pointers.data(),
                                  environment.data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      throw std::system_error(error, std::generic_category(), "bench: " + program);
    }
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;
  ~Echo() {
    kill(process_, SIGINT);
    int status = 0;
    waitpid(process_, &status, 0);
    std::error_code ignored;
    std::filesystem::remove(output_, ignored);
  }

  /// Whether it still runs, and has shown a message.
  [[nodiscard]] bool is_echoing() const {
    siginfo_t ended{};
    const bool runs =
        waitid(P_PID, static_cast<id_t>(process_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 &&
        ended.si_pid == 0;
    std::error_code none;
    return runs && std::filesystem::file_size(output_, none) > 0 && !none;
  }

 private:
  std::filesystem::path output_;
  pid_t process_ = 0;
};

Finding measure_inspect(Session& session, const std::string& what, const std::string& wait,
                        std::int64_t size) {
  const std::filesystem::path runtime = session.folder();
  std::optional<inspect::Server> server;
  std::vector<std::unique_ptr<Echo>> echoes;
  std::ptrdiff_t echoing = 0;
  RunHooks hooks;
  if (what != kWithout) {
    hooks.before_build = [&](host::Application& application) {
      server.emplace(application, config::InspectDescription{}, runtime / "fastcycle");
      application.add(*server);
    };
  }
  if (what == kEchoed) {
    hooks.after_start = [&] {
      for (int i = 0; i < kEchoes; ++i) {
        echoes.push_back(std::make_unique<Echo>(runtime, i));
      }
    };
    hooks.before_stop = [&] {
      echoing = std::ranges::count_if(echoes, [](const auto& echo) { return echo->is_echoing(); });
      echoes.clear();
    };
  }
  const Finished finished = session.run_application(
      application_beside(session.options(), size, wait, session.folder()), hooks);
  Finding finding = finding_beside(session, what, wait, size, finished);
  finding.row.more += fmt::format(",\"echoing\":{}", echoing);
  return finding;
}

}  // namespace

Mode inspect_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application = application_beside(options, options.sizes.front(), options.waits.front(), {});
  mode.title = fmt::format(
      "with {} times `fastcycle topic echo` and without, µs; {} messages after {} of warm-up, one "
      "each {} µs",
      kEchoes, options.count, options.warmup, options.interval_us);
  mode.columns = {{"size", "size"},
                  {"peer", "peer"},
                  {"publish p50", "publish_p50_us", 2},
                  {"publish p99", "publish_p99_us", 2},
                  {"transfer p50", "p50_us"},
                  {"transfer p99", "p99_us"},
                  {"lost", "lost", 0},
                  {"echoing", "echoing", 0},
                  {"publish p99/without", "publish_p99_us_ratio", 2},
                  {"transfer p99/without", "p99_us_ratio", 2}};
  mode.after_round = add_ratios;
  for (const std::int64_t size : options.sizes) {
    for (const std::string& wait : options.waits) {
      Point point;
      for (const char* const what : {kWithout, kAsked, kEchoed}) {
        point.steps.push_back({.peer = fmt::format("{}-{}", what, wait),
                               .measure = [session, what = std::string(what), wait, size] {
                                 return measure_inspect(*session, what, wait, size);
                               }});
      }
      mode.points.push_back(std::move(point));
    }
  }
  return mode;
}

}  // namespace fastcycle::tool::bench
