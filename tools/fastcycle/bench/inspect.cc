// inspect: what it costs the application that five `fastcycle topic echo` look at its topic.

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bench/beside.h"
#include "bench/modes.h"
#include "inspect/server.h"

namespace fastcycle::tool::bench {
namespace {

constexpr const char* kAsked = "asked";    ///< The socket is there, and nobody comes.
constexpr const char* kEchoed = "echoed";  ///< Five look.
constexpr int kEchoes = 5;

/// A process `fastcycle topic echo payload`, whose output goes nowhere; ended with it.
class Echo {
 public:
  explicit Echo(const std::filesystem::path& runtime_folder) {
    const std::string folder = "XDG_RUNTIME_DIR=" + runtime_folder.string();
    std::vector<char*> environment{const_cast<char*>(folder.c_str())};
    for (char** word = environ; *word != nullptr; ++word) {
      if (std::strncmp(*word, "XDG_RUNTIME_DIR=", 16) != 0) {
        environment.push_back(*word);
      }
    }
    environment.push_back(nullptr);
    const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
    std::array<std::string, 4> words{program, "topic", "echo", "payload"};
    std::array<char*, words.size() + 1> pointers{};
    for (std::size_t i = 0; i < words.size(); ++i) {
      pointers[i] = words[i].data();
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    const int error = posix_spawn(&process_, program.c_str(), &actions, nullptr, pointers.data(),
                                  environment.data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      throw std::system_error(error, std::generic_category(), "bench: " + program);
    }
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;
  ~Echo() { end(); }

  /// Whether it ran until now.
  bool end() {
    if (process_ == 0) {
      return true;
    }
    int status = 0;
    const bool ran = waitpid(process_, &status, WNOHANG) == 0;
    if (ran) {
      kill(process_, SIGINT);
      waitpid(process_, &status, 0);
    }
    process_ = 0;
    return ran && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

 private:
  pid_t process_ = 0;
};

Finding measure_inspect(Session& session, const std::string& what, const std::string& wait,
                        std::int64_t size) {
  const std::filesystem::path runtime = session.folder();
  std::optional<inspect::Server> server;
  std::vector<std::unique_ptr<Echo>> echoes;
  bool all_ran = true;
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
        echoes.push_back(std::make_unique<Echo>(runtime));
      }
    };
    hooks.before_stop = [&] {
      for (const auto& echo : echoes) {
        all_ran = echo->end() && all_ran;
      }
    };
  }
  const Finished finished = session.run_application(
      application_beside(session.options(), size, wait, session.folder()), hooks);
  Finding finding = finding_beside(session, what, wait, size, finished);
  if (!all_ran) {
    finding.trouble = "an echo ended before the application did";
  }
  return finding;
}

}  // namespace

Mode inspect_mode(const Options& options, Session* session) {
  Mode mode;
  mode.application =
      application_beside(options, options.sizes.front(), options.waits.front(), {});
  mode.title = fmt::format(
      "with {} times `fastcycle topic echo` and without, µs; {} messages after {} of warm-up, one "
      "each {} µs",
      kEchoes, options.count, options.warmup, options.interval_us);
  mode.columns = columns_beside();
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
