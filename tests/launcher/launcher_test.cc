#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "config/test_folder.h"
#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::launcher {
namespace {

using nlohmann::json;
using test::Process;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kCounter =
    R"({"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 1})";
constexpr const char* kAdder =
    R"({"name": "adder", "library": "launcher_parts", "class": "Adder"})";

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

/// Applications in a folder of their own, and what came of the last program that was run on one.
class Launcher : public testing::Test {
 protected:
  /// Writes app.json: some components, and what else the file says.
  void write_application(std::initializer_list<std::string> components,
                         const std::string& more = "") {
    std::string list;
    for (const std::string& component : components) {
      list += (list.empty() ? "" : ",\n    ") + component;
    }
    folder_.write("app.json", "{\"name\": \"launched\"" + more + ",\n  \"components\": [\n    " +
                                  list + "]\n}\n");
  }

  [[nodiscard]] std::string application() const { return (folder_ / "app.json").string(); }
  [[nodiscard]] std::string report_file() const { return (folder_ / "report.json").string(); }

  /// The words of a run that writes a report.
  [[nodiscard]] std::vector<std::string> run_words(
      const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"run", application(), "--report", report_file()};
    // A memory checker looks at its own process, which a protected one does not allow.
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  int launch(const std::vector<std::string>& words) {
    Process program(started_with(words));
    return take(program);
  }
  int run(const std::vector<std::string>& more = {}) { return launch(run_words(more)); }

  [[nodiscard]] static test::ProcessOptions started_with(const std::vector<std::string>& words) {
    return {.program = FASTCYCLE_PROGRAM, .arguments = words};
  }

  /// Waits for the end. Returns the exit code; 1000 + the number of the signal that ended it.
  int take(Process& program) {
    const test::Ending& ending = program.wait();
    output_ = program.output();
    errors_ = program.errors();
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  [[nodiscard]] json report() const { return json::parse(content_of(report_file())); }
  [[nodiscard]] bool has_report() const { return std::filesystem::exists(report_file()); }

  config::TestFolder folder_;
  std::string output_;
  std::string errors_;
};

/// Whether the ledgers of all subscriptions in `report` add up.
void expect_that_ledgers_add_up(const json& report) {
  for (const auto& [name, topic] : report.at("topics").items()) {
    for (const json& subscriber : topic.at("subscribers")) {
      std::uint64_t sum = subscriber.at("delivered").get<std::uint64_t>() +
                          subscriber.at("queued").get<std::uint64_t>();
      for (const auto& [reason, count] : subscriber.at("dropped").items()) {
        sum += count.get<std::uint64_t>();
      }
      EXPECT_EQ(subscriber.at("published"), sum) << name << ": " << subscriber;
      EXPECT_TRUE(subscriber.at("adds_up")) << name;
    }
  }
}

std::string trouble(const std::string& where, const std::string& on_fault) {
  return R"({"name": "trouble", "library": "launcher_parts", "class": "Trouble", )"
         R"("serve_period_ms": 1, "params": {"where": ")" +
         where + R"("}, "on_fault": ")" + on_fault + "\"}";
}

// ---- How a run ends ----

TEST_F(Launcher, RunEndsWhenItsTimeIsOver) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--for", "200ms"}), 0) << errors_;

  EXPECT_THAT(output_, HasSubstr("time over"));
  EXPECT_THAT(output_, HasSubstr("numbers (launcher.Number)"));
  EXPECT_THAT(output_, Not(HasSubstr("DOES NOT ADD UP")));
  const json report = this->report();
  EXPECT_EQ(report["application"], "launched");
  EXPECT_EQ(report["clock"], "live");
  EXPECT_EQ(report["end"], "time over");
  EXPECT_GE(report["time_s"], 0.2);
  EXPECT_GT(report["startup_ms"], 0.0);
  EXPECT_GT(report["cpu_s"], 0.0);
  EXPECT_GT(report["rss_max_kib"], 1000);
  EXPECT_EQ(report["topics"]["numbers"]["published"], report["results"]["published"]);
  expect_that_ledgers_add_up(report);
}

TEST_F(Launcher, RunEndsWhenTheInputIsOver) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--set", "counter.count=25"}), 0) << errors_;

  EXPECT_EQ(report()["end"], "input finished");
  EXPECT_EQ(report()["results"]["sum"], 25 * 26 / 2);
}

class LauncherOnSignal : public Launcher, public testing::WithParamInterface<int> {};

TEST_P(LauncherOnSignal, RunEndsInOrderWithReport) {
  write_application({kCounter, kAdder});
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();

  program.send(GetParam());

  EXPECT_EQ(take(program), 0);
  EXPECT_THAT(errors_, HasSubstr("stopping… (Ctrl-C again ends immediately)"));
  EXPECT_THAT(output_, HasSubstr("stopped on request"));
  const json report = this->report();
  EXPECT_EQ(report["end"], "stopped on request");
  EXPECT_GE(report["results"]["received"], 10);
  EXPECT_EQ(report["components"]["adder"]["state"], "stopped");
  expect_that_ledgers_add_up(report);
}

INSTANTIATE_TEST_SUITE_P(Stop, LauncherOnSignal, testing::Values(SIGINT, SIGTERM, SIGHUP));

/// A service manager that waits for news of what it started.
class ServiceManager {
 public:
  /// `name` as in `NOTIFY_SOCKET`: of a file, or with '@' of the abstract namespace.
  explicit ServiceManager(std::string name)
      : name_(std::move(name)), socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::ranges::copy(name_, address.sun_path);
    if (name_.front() == '@') {
      address.sun_path[0] = '\0';
    }
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size())),
              0);
    const timeval limit{.tv_sec = Process::kLongest.count(), .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    const int yes = 1;
    setsockopt(socket_, SOL_SOCKET, SO_PASSCRED, &yes, sizeof(yes));
  }
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;
  ~ServiceManager() { close(socket_); }

  [[nodiscard]] std::string variable() const { return "NOTIFY_SOCKET=" + name_; }

  /// The next news, which systemd takes from the process alone that it started; "" if none comes.
  [[nodiscard]] std::string news_of(pid_t process) const {
    std::array<char, 256> text{};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(ucred))> control{};
    iovec part{text.data(), text.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t size = recvmsg(socket_, &message, 0);
    if (size <= 0) {
      return "";
    }
    const cmsghdr* const header = CMSG_FIRSTHDR(&message);
    if (header == nullptr || header->cmsg_type != SCM_CREDENTIALS) {
      return "without the sender";
    }
    ucred sender{};
    std::memcpy(&sender, CMSG_DATA(header), sizeof(sender));
    const std::string news(text.data(), static_cast<std::size_t>(size));
    return sender.pid == process ? news : news + " of another process";
  }

 private:
  const std::string name_;
  const int socket_;
};

/// Words of the command line.
class LauncherAsAService : public Launcher,
                           public testing::WithParamInterface<std::vector<std::string>> {};

TEST_P(LauncherAsAService, ReportsToTheServiceManagerThatItHasStartedAndThatItStops) {
  const auto is_there = [&](const std::string& name) {
    write_application({kCounter, kAdder});
    const ServiceManager manager(name);
    test::ProcessOptions options = started_with(run_words(GetParam()));
    options.environment.push_back(manager.variable());
    Process program(options);

    EXPECT_EQ(manager.news_of(program.pid()), "READY=1") << program.errors();
    program.send(SIGINT);
    EXPECT_EQ(manager.news_of(program.pid()), "STOPPING=1") << program.errors();

    EXPECT_EQ(take(program), 0) << errors_;
  };
  is_there((folder_ / "manager").string());
  is_there("@fastcycle_launcher_test_" + std::to_string(getpid()));
}

TEST_P(LauncherAsAService, RunsWithoutAServiceManagerThatReads) {
  write_application({kCounter, kAdder});
  for (const std::string& name : {(folder_ / "nobody").string(), std::string("@fastcycle_nobody"),
                                  std::string(500, 'x'), std::string()}) {
    std::vector<std::string> words = run_words(GetParam());
    words.insert(words.end(), {"--for", "20ms"});
    test::ProcessOptions options = started_with(words);
    options.environment.push_back("NOTIFY_SOCKET=" + name);
    Process program(options);
    EXPECT_EQ(take(program), 0) << errors_;
  }
}

INSTANTIATE_TEST_SUITE_P(In, LauncherAsAService,
                         testing::Values(std::vector<std::string>{},
                                         std::vector<std::string>{"--isolate", "all"}),
                         [](const auto& words) {
                           return words.param.empty() ? "OneProcess" : "Processes";
                         });

TEST_F(Launcher, ReportsTheStartAlsoWhereAProcessEndsInItAndIsNotReplaced) {
  for (const std::string policy :
       {R"("on_exit": "continue")",
        R"("on_exit": "restart", "restart": {"limit": 0, "then": "continue"})"}) {
    write_application({kCounter, kAdder,
                       R"({"name": "trouble", "library": "launcher_parts", "class": "Trouble",
                           "process": "slow", "params": {"where": "hang in start"}})"},
                      R"(, "processes": [{"name": "slow", )" + policy + "}]");
    const ServiceManager manager("@fastcycle_launcher_test_" + std::to_string(getpid()));
    test::ProcessOptions options = started_with(run_words());
    options.environment.push_back(manager.variable());
    Process program(options);
    ASSERT_TRUE(program.wait_for("it hangs now")) << program.errors();

    kill(test::process_of_session(program.pid(), "slow"), SIGKILL);
    EXPECT_EQ(manager.news_of(program.pid()), "READY=1") << program.errors();
    program.send(SIGINT);

    EXPECT_EQ(take(program), 0) << errors_;
    EXPECT_THAT(errors_, HasSubstr("the others go on without it"));
  }
}

TEST_F(Launcher, SimulatedRunEndsInOrderOnCtrlC) {
  write_application({kCounter, kAdder});
  Process program(started_with(run_words({"--clock", "simulated"})));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();

  program.send(SIGINT);

  EXPECT_EQ(take(program), 0);
  EXPECT_EQ(report()["end"], "stopped on request");
  expect_that_ledgers_add_up(report());
}

TEST_F(Launcher, SecondCtrlCEndsARunThatHangs) {
  write_application({kCounter, trouble("hang in stop", "stop_component")});
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received a number")) << program.errors();
  program.send(SIGINT);
  ASSERT_TRUE(program.wait_for("it hangs now")) << program.errors();

  program.send(SIGINT);

  EXPECT_EQ(take(program), 130);
  EXPECT_FALSE(has_report());
}

TEST_F(Launcher, ReportMayGoToStandardOutput) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"run", application(), "--set", "counter.count=1", "--report", "/dev/stdout",
                    "--quiet", "--debuggable"}),
            0)
      << errors_;

  EXPECT_EQ(json::parse(output_)["end"], "input finished");
}

// ---- Faults ----

class LauncherOnFault : public Launcher, public testing::WithParamInterface<std::string> {};

TEST_P(LauncherOnFault, OthersGoOnWhenItsPolicyIsToStopTheComponent) {
  write_application({kCounter, kAdder, trouble(GetParam(), "stop_component")});

  EXPECT_EQ(run({"--set", "counter.count=100"}), 0) << errors_;

  const json report = this->report();
  EXPECT_EQ(report["end"], "input finished");
  EXPECT_EQ(report["results"]["received"], 100);
  EXPECT_GE(report["components"]["trouble"]["faults"], 1);
  EXPECT_THAT(report["components"]["trouble"]["fault_texts"][0].get<std::string>(),
              HasSubstr("trouble in " + GetParam()));
  EXPECT_THAT(output_, HasSubstr("fault of trouble: "));
  EXPECT_THAT(output_, HasSubstr("trouble in " + GetParam()));
  expect_that_ledgers_add_up(report);
}

TEST_P(LauncherOnFault, RunFailsWhenItsPolicyIsToStop) {
  write_application({kCounter, kAdder, trouble(GetParam(), "stop")});

  EXPECT_EQ(run({"--set", "counter.count=100"}), 1) << errors_;

  EXPECT_EQ(report()["end"], "component fault");
  EXPECT_THAT(output_, HasSubstr("trouble in " + GetParam()));
  expect_that_ledgers_add_up(report());
}

INSTANTIATE_TEST_SUITE_P(In, LauncherOnFault,
                         testing::Values("constructor", "start", "callback", "serve", "stop",
                                         "destructor"));

class LauncherWithAHangingComponent : public Launcher,
                                      public testing::WithParamInterface<const char*> {};

TEST_P(LauncherWithAHangingComponent, EndsOnTheFirstSignalAndNamesIt) {
  write_application({kCounter, kAdder, trouble(std::string("hang in ") + GetParam(), "stop")});
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  if (std::string_view(GetParam()) == "stop") {
    program.send(SIGINT);
    ASSERT_TRUE(program.wait_for("it hangs now")) << program.errors();
  } else {
    ASSERT_TRUE(program.wait_for("it hangs now")) << program.errors();
    program.send(SIGINT);
  }

  EXPECT_EQ(take(program), 1) << errors_;

  const std::string call = std::string_view(GetParam()) == "callback"
                               ? "its callback for \"numbers\""
                               : std::string("its ") + GetParam() + "()";
  EXPECT_THAT(errors_, HasSubstr("component \"trouble\" has not returned from " + call));
  const json report = this->report();
  EXPECT_EQ(report["components"]["trouble"]["state"], "stuck");
  EXPECT_EQ(report["components"]["adder"]["state"], "stopped");
  EXPECT_THAT(output_, HasSubstr("stuck"));
}

INSTANTIATE_TEST_SUITE_P(In, LauncherWithAHangingComponent,
                         testing::Values("callback", "serve", "stop"));

TEST_F(Launcher, EndsWhileAStartHangs) {
  write_application({trouble("hang in start", "stop"), kCounter});
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("it hangs now")) << program.errors();
  program.send(SIGTERM);

  EXPECT_EQ(take(program), 1) << errors_;

  EXPECT_THAT(errors_, HasSubstr("component \"trouble\" has not returned from its start()"));
  EXPECT_EQ(report()["end"], "stopped on request");
  EXPECT_EQ(report()["components"]["counter"]["state"], "constructed");
}

TEST_F(Launcher, ComponentIsMadeAnewWhenItsPolicyIsToRestart) {
  write_application({kCounter, kAdder, trouble("callback", "restart")});

  EXPECT_EQ(run({"--set", "counter.count=100"}), 0) << errors_;

  EXPECT_EQ(report()["components"]["trouble"]["restarts"], 3);
  EXPECT_EQ(report()["components"]["trouble"]["state"], "failed");
  EXPECT_THAT(output_, HasSubstr("(restarting)"));
  EXPECT_EQ(report()["results"]["received"], 100);
}

// ---- What people read ----

bool steers(const std::string& text) {
  return text.find_first_of("\x1b\r\x7f\xff") != std::string::npos ||
         text.find("\xc2\x9b") != std::string::npos;
}

TEST_F(Launcher, NothingThatComponentsSaySteersTheTerminal) {
  write_application({kCounter,
                     R"({"name": "adder", "library": "launcher_parts", "class": "Adder",
           "params": {"text": "a\u001b[31m\u009b\rb"}})",
                     trouble("callback", "restart")});

  EXPECT_EQ(run({"--set", "counter.count=100"}), 0) << errors_;

  EXPECT_THAT(errors_, HasSubstr(" info adder: its text is a\\x1b[31m\\xc2\\x9b\\x0db\n"));
  EXPECT_THAT(errors_, HasSubstr("trouble in callback, \\x1b[2J"));
  EXPECT_THAT(output_, HasSubstr("trouble in callback"));
  EXPECT_FALSE(steers(errors_)) << errors_;
  EXPECT_FALSE(steers(output_)) << output_;
  EXPECT_FALSE(steers(content_of(report_file())));
  EXPECT_EQ(report()["results"]["text"], "a\x1b[31m\xc2\x9b\rb");
}

TEST_F(Launcher, NothingInFilesAndOnTheCommandLineSteersTheTerminal) {
  const std::string steering =
      "\x1b[2J\xc2\x9b"
      "31m\r\xff";
  for (const std::vector<std::string>& words : {std::vector<std::string>{steering},
                                                {"run", steering + ".json"},
                                                {"check", steering + ".json"},
                                                {"info", steering + ".mcap"},
                                                {"echo", steering + ".mcap"},
                                                {"doctor", steering + ".mcap"},
                                                {"play", steering + ".mcap", steering + ".json"},
                                                {"run", "app.json", "--" + steering},
                                                {"run", "app.json", "--for", steering},
                                                {"topic", "echo", steering}}) {
    EXPECT_NE(launch(words), 0);
    EXPECT_FALSE(steers(errors_ + output_)) << errors_ << output_;
  }
  write_application({R"({"name": "a\u009b", "library": "\u001b[2J", "class": "\r"})"});
  EXPECT_EQ(launch({"check", application()}), 2);
  EXPECT_FALSE(steers(errors_ + output_)) << errors_;
}

TEST_F(Launcher, LogLevelOfTheCommandLineReplacesThatOfTheApplication) {
  const auto adder = [](const std::string& name, const std::string& more) {
    return R"({"name": ")" + name +
           R"(", "library": "launcher_parts", "class": "Adder", "remap": {"sums": "sums_of_)" +
           name + R"("})" + more + "}";
  };
  write_application({kCounter, adder("plain", ""), adder("own", R"(, "log_level": "debug")")},
                    R"(, "log_level": "debug")");

  EXPECT_EQ(run({"--set", "counter.count=20", "--log-level", "warning"}), 0) << errors_;

  EXPECT_THAT(errors_, Not(HasSubstr("plain: received ten numbers")));
  EXPECT_THAT(errors_, HasSubstr(" info own: received ten numbers\n"));
  EXPECT_EQ(run({"--log-level", "loud"}), 2);
  EXPECT_THAT(errors_, HasSubstr("loud"));
}

// ---- The configuration ----

TEST_F(Launcher, CommandLineStandsAboveTheFile) {
  write_application({kCounter,
                     R"({"name": "adder", "library": "launcher_parts", "class": "Adder",
           "params": {"limits": {"high": 1}, "text": "${word}"}})"},
                    R"(, "variables": {"word": "file"})");
  const auto overlay = folder_.write(
      "overlay.json", R"({"components": [{"name": "counter", "params": {"count": 7}}]})");

  EXPECT_EQ(
      run({"--set", "adder.limits.high=42", "--var", "word=line", "--overlay", overlay.string()}),
      0)
      << errors_;

  EXPECT_EQ(report()["results"]["high"], 42);
  EXPECT_EQ(report()["results"]["text"], "line");
  EXPECT_EQ(report()["results"]["published"], 7);
}

TEST_F(Launcher, EachErrorIsNamedAndNothingIsStarted) {
  write_application({R"({"name": "counter", "library": "launcher_parts", "class": "Counter",
           "params": {"count": -1, "brust": 2}})",
                     R"({"name": "adder", "library": "launcher_party"})",
                     R"({"name": "other", "library": "launcher_parts", "class": "Ader"})"});

  for (const std::string command : {"check", "run"}) {
    EXPECT_EQ(launch({command, application()}), 2);

    EXPECT_THAT(errors_, HasSubstr("/components/0/params/count"));
    EXPECT_THAT(errors_, HasSubstr("did you mean \"burst\"?"));
    EXPECT_THAT(errors_, HasSubstr("did you mean \"launcher_parts\"?"));
    EXPECT_THAT(errors_, HasSubstr("did you mean \"Adder\"?"));
    EXPECT_THAT(errors_, testing::EndsWith("app.json: 4 errors, 1 warning; nothing was started\n"));
    EXPECT_EQ(output_, "");
  }
}

TEST_F(Launcher, MissingLibraryIsOneError) {
  write_application({R"({"name": "nothing"})"});

  EXPECT_EQ(launch({"check", application()}), 2);

  EXPECT_THAT(errors_, HasSubstr("/components/0: the key \"library\" is missing"));
  EXPECT_THAT(errors_, HasSubstr("1 error;"));
}

TEST_F(Launcher, ErrorsInTheFileAndInComponentsAreFoundTogether) {
  write_application({R"({"name": "counter", "library": "launcher_parts", "class": "Counter",
                         "serve_period_ms": "often", "params": {"count": -1}})"});

  EXPECT_EQ(launch({"check", application()}), 2);

  EXPECT_THAT(errors_, HasSubstr("/components/0/serve_period_ms"));
  EXPECT_THAT(errors_, HasSubstr("/components/0/params/count"));
}

TEST_F(Launcher, CheckCallsAConstructorThatThrowsAnError) {
  write_application({kCounter, trouble("constructor", "stop_component")});

  EXPECT_EQ(launch({"check", application()}), 2);

  EXPECT_THAT(errors_, HasSubstr("trouble in constructor"));
}

TEST_F(Launcher, WarningsAreShownAndDoNotStop) {
  write_application({kAdder});  // Nobody publishes what it listens to.

  EXPECT_EQ(launch({"check", application()}), 0);
  EXPECT_THAT(errors_, HasSubstr("warning: "));
  EXPECT_THAT(output_, HasSubstr("no errors, 1 warning"));

  EXPECT_EQ(run({"--for", "10ms"}), 0) << errors_;
  EXPECT_THAT(errors_, HasSubstr("warning: "));
}

TEST_F(Launcher, CheckPrintsTheEffectiveConfiguration) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"check", application(), "--print", "--set", "adder.limits.high=42"}), 0);
  EXPECT_THAT(output_, HasSubstr("\"high\": 42"));
  EXPECT_THAT(output_, HasSubstr("--set adder.limits.high=42"));

  // What it prints can be run.
  folder_.write("app.json", output_);
  EXPECT_EQ(run({"--set", "counter.count=3"}), 0) << errors_;
  EXPECT_EQ(report()["results"]["high"], 42);
}

TEST_F(Launcher, ReportThatCannotBeWrittenIsFoundBeforeTheStart) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"run", application(), "--report", (folder_ / "nowhere/r.json").string()}), 2);
  EXPECT_THAT(errors_, HasSubstr("cannot be written"));
  EXPECT_THAT(errors_, Not(HasSubstr("received ten")));

  EXPECT_EQ(launch({"run", application(), "--report", folder_.path().string()}), 2);
  EXPECT_THAT(errors_, HasSubstr("it is a folder"));
}

TEST_F(Launcher, NothingIsLeftBesideTheReport) {
  write_application({kCounter, kAdder});
  folder_.write("report.json", "what was there before");

  EXPECT_EQ(run({"--set", "counter.count=3"}), 0) << errors_;

  EXPECT_EQ(report()["results"]["published"], 3);
  const auto files = std::filesystem::directory_iterator(folder_.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 2);
}

// ---- The command line ----

TEST_F(Launcher, WrongCommandLineIsReportedInASentence) {
  write_application({kCounter, kAdder});
  const std::string app = application();
  struct Case {
    std::vector<std::string> words;
    std::string sentence;
  };
  const std::vector<Case> cases{
      {{"rnu", app}, "unknown command \"rnu\"; did you mean \"run\"?"},
      {{"run"}, "application is required"},
      {{"run", app, "other.json"}, "unexpected argument \"other.json\""},
      {{"run", app, "--reprot=x"}, "unknown option --reprot; did you mean \"--report\"?"},
      {{"run", app, "--for", "10"}, "--for expects a time above zero with its unit"},
      {{"run", app, "--for", "0s"}, "--for expects a time above zero with its unit"},
      {{"run", app, "--for", "-1s"}, "--for expects a time above zero with its unit"},
      {{"run", app, "--clock", "sun"}, "--clock is \"live\" or \"simulated\", not \"sun\""},
      {{"run", app, "--clock", "simulated", "--rate", "2"}, "--rate requires --clock live"},
      {{"run", app, "--workers", "2"}, "--workers requires --clock simulated"},
      {{"run", app, "--clock", "simulated", "--workers", "0"}, "--workers expects a number"},
      {{"run", app, "--rate", "0"}, "--rate expects a number"},
      {{"run", app, "--rate", "nan"}, "--rate expects a number"},
      {{"run", app, "--rate", "fast"}, "--rate expects a number, found \"fast\""},
      {{"run", app, "--workers", "1.5"},
       "--workers expects a whole number, not below 0, found \"1.5\""},
      {{"run", app, "--quiet=maybe"}, "--quiet expects no value, found \"maybe\""},
      {{"run", app, "--load-timeout", "5"}, "500ms or 10s, found \"5\""},
      {{"check", app, "--timing", "x", "--margin", "0.5"},
       "--margin expects a number from 1 to 100, found \"0.5\""},
      {{"log", "--level", "loud"},
       "--level expects one of debug, info, warning, error, found \"loud\""},
      {{"topic", "hz", "a", "--count", "0"}, "--count expects a number above zero, found \"0\""},
      {{"run", app, "--for"}, "--for expects a value: TIME"},
      {{"run", app, "--for", "1s", "--for", "2s"}, "--for may be given only once"},
      {{"doctor", app, "--for", "1s"}, "files and --for cannot be used together"},
      {{"graph", app, "-o", "picture.bmp"}, "ends in .svg or .dot"},
  };

  for (const Case& each : cases) {
    EXPECT_EQ(launch(each.words), 2) << each.sentence;

    EXPECT_THAT(errors_, HasSubstr(each.sentence));
    EXPECT_EQ(output_, "") << each.sentence;
  }
}

TEST_F(Launcher, HelpIsGivenForEachCommandWithExamples) {
  for (const std::string command : {"run", "check", "graph", "params", "version"}) {
    EXPECT_EQ(launch({command, "--help"}), 0);

    EXPECT_THAT(output_, HasSubstr("Examples:\n  fastcycle " + command));
    EXPECT_THAT(errors_, Not(HasSubstr("warning")));
  }
  for (const std::string word : {"--help", "help"}) {
    EXPECT_EQ(launch({word}), 0);
    EXPECT_THAT(output_, HasSubstr("Exit codes:"));
  }
}

TEST_F(Launcher, VersionNamesWhatItWasBuiltWith) {
  EXPECT_EQ(launch({"version"}), 0);

  EXPECT_THAT(output_, HasSubstr(FASTCYCLE_VERSION));
  EXPECT_THAT(output_, HasSubstr(FASTCYCLE_BUILD_NOTE));
}

// ---- The graph ----

TEST_F(Launcher, GraphShowsComponentsAndTopics) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"graph", application()}), 0);

  EXPECT_THAT(output_, testing::StartsWith("digraph application {"));
  EXPECT_THAT(output_, HasSubstr("<b>adder</b>"));
  EXPECT_THAT(output_, HasSubstr("launcher.Number"));
  EXPECT_THAT(output_, HasSubstr("component_0 -> topic_0"));
  EXPECT_THAT(output_, HasSubstr("topic_0 -> component_1"));
  EXPECT_THAT(errors_, HasSubstr("-o FILE.svg writes a picture"));
}

TEST_F(Launcher, GraphIsWrittenAsDotAndDrawnAsSvg) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"graph", application(), "-o", (folder_ / "app.dot").string()}), 0);
  EXPECT_THAT(content_of(folder_ / "app.dot"), HasSubstr("digraph"));

  if (system("dot -V >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "Graphviz is not installed";
  }
  EXPECT_EQ(launch({"graph", application(), "-o", (folder_ / "app.svg").string()}), 0) << errors_;
  EXPECT_THAT(content_of(folder_ / "app.svg"), HasSubstr("<svg"));
}

TEST_F(Launcher, GraphHasABoxForEachProcess) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"graph", application(), "--isolate", "adder"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("<b>main</b> process"));
  EXPECT_THAT(output_, HasSubstr("<b>adder</b> process"));

  if (system("dot -V >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "Graphviz is not installed";
  }
  EXPECT_EQ(
      launch({"graph", application(), "--isolate", "all", "-o", (folder_ / "app.svg").string()}), 0)
      << errors_;
  const std::string picture = content_of(folder_ / "app.svg");
  EXPECT_THAT(picture, HasSubstr("class=\"cluster\""));
  EXPECT_THAT(picture, HasSubstr(">counter</text>"));
}

// ---- Processes ----

TEST_F(Launcher, CheckSaysTheProcessesThatThereAre) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"check", application()}), 0) << errors_;
  EXPECT_THAT(output_, testing::EndsWith("; 2 components fit together\n"));

  EXPECT_EQ(launch({"check", application(), "--isolate", "adder"}), 0) << errors_;
  EXPECT_THAT(output_,
              testing::EndsWith("; 2 components fit together, in 2 processes: main, adder\n"));

  EXPECT_EQ(launch({"check", application(), "--isolate", "all"}), 0) << errors_;
  EXPECT_THAT(output_, testing::EndsWith(", in 2 processes: counter, adder\n"));
}

TEST_F(Launcher, IsolationIsAPartOfTheEffectiveConfigurationWhichMeansTheSame) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"check", application(), "--isolate", "c*", "--print"}), 0) << errors_;

  EXPECT_THAT(output_, HasSubstr("\"process\": \"counter\"  // --isolate c*"));
  EXPECT_THAT(errors_, HasSubstr("in 2 processes: main, counter"));
  folder_.write("printed.json", output_);
  EXPECT_EQ(launch({"check", (folder_ / "printed.json").string()}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("in 2 processes: main, counter"));
}

TEST_F(Launcher, IsolatingAComponentThatIsNotThereIsAnError) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"check", application(), "--isolate", "contr", "--isolate", "counte"}), 2);

  EXPECT_THAT(errors_, HasSubstr("--isolate contr: there is no component \"contr\""));
  EXPECT_THAT(errors_, HasSubstr("--isolate counte: there is no component \"counte\"; did you mean "
                                 "\"counter\"?"));
}

// ---- The params ----

TEST_F(Launcher, ParamsAreListedAsATable) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"params", application(), "--set", "counter.count=5"}), 0) << errors_;

  EXPECT_THAT(output_, testing::StartsWith("param"));
  EXPECT_THAT(output_, testing::ContainsRegex("counter\\.count +integer +≥ 0 +0 +5 +"
                                              "--set counter\\.count=5 +no\n"));
  EXPECT_THAT(output_, testing::ContainsRegex("counter\\.burst +integer +messages +≥ 1 +1 +1 +"
                                              "default +yes +In every period\n"));
  EXPECT_THAT(output_, testing::ContainsRegex("adder\\.text +string +\"none\" +\"none\""));
}

TEST_F(Launcher, ParamsAreListedAsJson) {
  write_application({kCounter,
                     R"({"name": "adder", "library": "launcher_parts", "class": "Adder", "params": {
            "limits": {"high": 7}}})"});

  EXPECT_EQ(launch({"params", application(), "--json"}), 0) << errors_;

  const json params = json::parse(output_);
  ASSERT_GE(params.size(), 4U);
  EXPECT_EQ(params[0], json({{"component", "counter"},
                             {"name", "count"},
                             {"type", "integer"},
                             {"min", 0},
                             {"default", 0},
                             {"value", 0},
                             {"from", "default"},
                             {"tunable", false}}));
  EXPECT_EQ(params[1]["tunable"], true);
  EXPECT_EQ(params[1]["unit"], "messages");
  EXPECT_EQ(params[2]["name"], "limits.high");
  EXPECT_EQ(params[2]["value"], 7);
  EXPECT_EQ(params[2]["from"], "file");
  EXPECT_EQ(params[2]["pointer"], "/components/1/params/limits/high");
  EXPECT_GT(params[2]["line"], 0);
}

TEST_F(Launcher, ParamsAreListedAsMarkdownAndOnlyThoseThatAreWanted) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"params", application(), "--markdown", "*.burst"}), 0) << errors_;
  EXPECT_EQ(
      output_,
      "| param | type | unit | range | default | value | from | tunable | description |\n"
      "|---|---|---|---|---|---|---|---|---|\n"
      "| counter.burst | integer | messages | ≥ 1 | 1 | 1 | default | yes | In every period |\n");

  EXPECT_EQ(launch({"params", application(), "adder"}), 0) << errors_;
  EXPECT_THAT(output_, Not(HasSubstr("counter")));

  EXPECT_EQ(launch({"params", application(), "addr"}), 2);
  EXPECT_THAT(errors_, HasSubstr("unknown component or param \"addr\"; did you mean \"adder\"?"));
  EXPECT_EQ(output_, "");
}

TEST_F(Launcher, ParamsThatAreWrongAreErrorsAndNothingIsListed) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(launch({"params", application(), "--set", "counter.burst=0", "--set", "adder.txt=a"}),
            2);

  EXPECT_EQ(output_, "");
  EXPECT_THAT(errors_, HasSubstr("expected an integer in [1, 9223372036854775807], found 0"));
  EXPECT_THAT(errors_, HasSubstr("there is no param \"txt\"; did you mean \"text\"?"));
  EXPECT_THAT(errors_, HasSubstr("2 errors; nothing was started"));
}

// ---- Load, clocks, and the machine ----

TEST_F(Launcher, QueueOfOneLosesMessagesAndCountsThem) {
  write_application({kCounter, R"({"name": "adder", "library": "launcher_parts", "class": "Adder",
                     "subscribers": {"numbers": {"depth": 1}}})"});

  EXPECT_EQ(
      run({"--clock", "simulated", "--set", "counter.count=500", "--set", "counter.burst=50"}), 0)
      << errors_;

  const json subscriber = report()["topics"]["numbers"]["subscribers"][0];
  EXPECT_EQ(subscriber["depth"], 1);
  EXPECT_EQ(subscriber["published"], 500);
  EXPECT_EQ(subscriber["delivered"], 10);
  EXPECT_EQ(subscriber["dropped"]["overflow"], 490);
  EXPECT_THAT(output_, HasSubstr("500 = 10 delivered + 490 overflow"));
  expect_that_ledgers_add_up(report());
}

TEST_F(Launcher, RateLetsTimeRunFaster) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--rate", "50", "--for", "5s"}), 0) << errors_;

  EXPECT_GE(report()["time_s"], 5.0);
  EXPECT_LT(report()["wall_s"].get<double>(), report()["time_s"].get<double>());
  expect_that_ledgers_add_up(report());
}

/// What must be the same in every simulated run.
json without_what_the_machine_says(json report) {
  for (const char* key : {"startup_ms", "wall_s", "cpu_s", "rss_max_kib"}) {
    report.erase(key);
  }
  for (json& component : report["components"]) {
    component.erase("callback_us");
    for (json& callback : component["callbacks"]) {
      callback.erase("time_us");
    }
  }
  for (json& topic : report["topics"]) {
    topic.erase("allocated");
  }
  return report;
}

TEST_F(Launcher, SimulatedRunsAreEqualForAnyNumberOfWorkers) {
  write_application({kCounter, kAdder,
                     R"({"name": "second", "library": "launcher_parts", "class": "Adder",
                         "remap": {"sums": "other_sums"},
                         "subscribers": {"numbers": {"depth": 3}}})"});
  const std::vector<std::string> words{"--clock", "simulated",       "--for",    "3s",
                                       "--set",   "counter.burst=5", "--workers"};
  std::vector<json> reports;

  for (const std::string workers : {"1", "1", "2", "4"}) {
    auto with_workers = words;
    with_workers.push_back(workers);
    ASSERT_EQ(run(with_workers), 0) << errors_;
    reports.push_back(without_what_the_machine_says(report()));
  }

  EXPECT_GT(reports[0]["results"]["received"], 1000);
  EXPECT_TRUE(reports[0]["results"].contains("second.hash"));
  for (const json& report : reports) {
    EXPECT_EQ(report, reports[0]);
  }
}

TEST_F(Launcher, RecordsARunWithoutLoss) {
  write_application({kCounter, kAdder});
  const std::filesystem::path file = folder_ / "drive.mcap";
  for (const std::vector<std::string>& clock :
       {std::vector<std::string>{"--clock", "simulated"}, std::vector<std::string>{}}) {
    std::filesystem::remove(file);
    std::vector<std::string> words{"--for", "300ms", "--record", file.string()};
    words.insert(words.end(), clock.begin(), clock.end());
    ASSERT_EQ(run(words), 0) << errors_;

    EXPECT_THAT(output_, HasSubstr("RECORDED"));
    EXPECT_THAT(output_, HasSubstr("nothing lost"));
    const json recording = report()["recording"];
    EXPECT_EQ(recording["files"], json({file.string()})) << recording["problem"];
    EXPECT_EQ(recording["activations_lost"], 0);
    const json topics = report()["topics"];
    EXPECT_EQ(recording["topics"].size(), topics.size());
    for (const auto& [name, topic] : topics.items()) {
      EXPECT_EQ(recording["topics"][name]["recorded"], topic["published"]) << name;
    }
    EXPECT_GT(std::filesystem::file_size(file), 10'000U);
  }
}

TEST_F(Launcher, RecordingDoesNotChangeASimulatedRun) {
  write_application({kCounter, kAdder});
  const std::vector<std::string> words{"--for", "1s", "--clock", "simulated"};
  ASSERT_EQ(run(words), 0) << errors_;
  const json without = without_what_the_machine_says(report());
  auto recorded = words;
  recorded.insert(recorded.end(), {"--record", (folder_ / "drive.mcap").string(),
                                   "--record-compression", "zstd", "--record-topics", "numb*"});
  ASSERT_EQ(run(recorded), 0) << errors_;
  json with = without_what_the_machine_says(report());
  EXPECT_EQ(with["recording"]["topics"].size(), 1U);
  with.erase("recording");
  EXPECT_EQ(with["results"], without["results"]);
  EXPECT_EQ(with["components"], without["components"]);
}

TEST_F(Launcher, ApplicationSaysWhatIsRecorded) {
  write_application({kCounter, kAdder}, R"(, "record": {"file": "log.mcap", "except": ["su*"],
      "compression_by_topic": {"**/numbers": "none"}, "sync_ms": 0})");
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated"}), 0) << errors_;

  EXPECT_THAT(errors_, Not(HasSubstr("warning")));
  json recording = report()["recording"];
  EXPECT_EQ(recording["files"], json({(folder_ / "log.mcap").string()})) << recording["problem"];
  EXPECT_EQ(recording["topics"].size(), 1U);
  EXPECT_EQ(recording["topics"]["numbers"]["recorded"], report()["topics"]["numbers"]["published"]);

  const std::string other = (folder_ / "other.mcap").string();
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated", "--record", other, "--record-topics",
                 "sums", "--record-topics", "nothing/*"}),
            0);
  EXPECT_THAT(errors_, HasSubstr("\"nothing/*\" means no topic"));
  recording = report()["recording"];
  EXPECT_EQ(recording["files"], json({other}));
  EXPECT_TRUE(recording["topics"].contains("sums")) << recording;
}

TEST_F(Launcher, RecorderMayBeAComponent) {
  const std::string logging =
      R"({"name": "logging", "library": "recorder", "params": {"file": "log.mcap", "topics": ["numbers"]}})";
  write_application({kCounter, kAdder, logging});
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated"}), 0) << errors_;

  const json recording = report()["recording"];
  EXPECT_EQ(recording["files"], json({(folder_ / "log.mcap").string()})) << recording["problem"];
  EXPECT_EQ(recording["topics"]["numbers"]["recorded"], report()["topics"]["numbers"]["published"]);

  EXPECT_EQ(run({"--record", (folder_ / "other.mcap").string()}), 2);
  EXPECT_THAT(errors_, HasSubstr("\"logging\" records what is recorded already"));
  EXPECT_THAT(errors_, HasSubstr("leave one of them out"));
}

TEST_F(Launcher, RecordCommandRecords) {
  write_application({kCounter, kAdder});
  std::vector<std::string> words =
      run_words({"--for", "100ms", "--clock", "simulated", "-o", (folder_ / "drive.mcap").string(),
                 "--except", "sums", "--split-s", "0.1", "--compression", "zstd"});
  words.front() = "record";
  ASSERT_EQ(launch(words), 0) << errors_;

  const json recording = report()["recording"];
  EXPECT_EQ(recording["files"][0], (folder_ / "drive_0001.mcap").string()) << recording;
  EXPECT_EQ(recording["topics"].size(), 1U);
}

TEST_F(Launcher, RunGoesOnWhereNothingCanBeRecorded) {
  write_application({kCounter, kAdder});
  const std::vector<std::string> words{"--for", "100ms", "--record",
                                       (folder_ / "missing/drive.mcap").string()};
  ASSERT_EQ(run(words), 1) << "a log was asked for, and there is none: " << errors_;

  EXPECT_THAT(errors_, HasSubstr("refused: recording: "));
  EXPECT_THAT(errors_, HasSubstr("missing/drive.mcap"));
  const json report = this->report();
  for (const auto& [name, topic] : report["recording"]["topics"].items()) {
    EXPECT_EQ(topic["lost"]["disk"], report["topics"][name]["published"]) << name;
  }

  auto strict = words;
  strict.emplace_back("--strict");
  EXPECT_EQ(run(strict), 1);
}

TEST_F(Launcher, LogThatWasDeletedFailsTheRun) {
  write_application({kCounter, kAdder});
  const auto log = folder_ / "logs/drive.mcap";
  folder_.write("logs/other", "");
  Process program(started_with(run_words({"--record", log.string()})));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  ASSERT_TRUE(std::filesystem::exists(log.string() + ".active"));

  std::filesystem::remove_all(folder_ / "logs");
  ASSERT_TRUE(program.wait_for("it was deleted")) << program.errors();
  std::filesystem::create_directory(folder_ / "logs");
  ASSERT_TRUE(program.wait_for("recording goes on in")) << program.errors();
  program.send(SIGINT);

  EXPECT_EQ(take(program), 1) << errors_;
  EXPECT_THAT(output_, HasSubstr("incomplete: "));
  const auto whole = report();
  for (const auto& [name, topic] : whole.at("recording").at("topics").items()) {
    std::uint64_t lost = 0;
    for (const auto& [reason, count] : topic["lost"].items()) {
      lost += count.get<std::uint64_t>();
    }
    EXPECT_GT(lost, 0U) << name;
    EXPECT_EQ(topic["published"], topic["recorded"].get<std::uint64_t>() + lost) << name;
  }
}

TEST_F(Launcher, LogDoesNotReplaceWhatGotItsNameMeanwhile) {
  write_application({kCounter, kAdder});
  const auto log = folder_ / "drive.mcap";
  Process program(started_with(run_words({"--record", log.string()})));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  folder_.write("drive.mcap", "precious");
  program.send(SIGINT);

  EXPECT_EQ(take(program), 0) << errors_;

  EXPECT_EQ(content_of(log), "precious");
  EXPECT_EQ(report()["recording"]["files"], json({(folder_ / "drive_0002.mcap").string()}));
  EXPECT_THAT(errors_, HasSubstr("this log is " + (folder_ / "drive_0002.mcap").string()));
}

// ---- Files that must not be written ----

TEST_F(Launcher, NoOutputGoesOverTheApplicationALinkOrAFifo) {
  write_application({kCounter, kAdder});
  const std::string before = content_of(application());
  folder_.write("precious", "precious");
  std::filesystem::create_symlink(folder_ / "precious", folder_ / "link");
  ASSERT_EQ(mkfifo((folder_ / "fifo").c_str(), 0600), 0);

  for (const char* const option : {"--trace", "--report"}) {
    for (const auto& [name, words] :
         {std::pair{"app.json", "it is read by this command"},
          std::pair{"link", "it is a symbolic link"}, std::pair{"fifo", "it is no regular file"}}) {
      EXPECT_EQ(launch({"run", application(), "--for", "20ms", "--debuggable", option,
                        (folder_ / name).string()}),
                2)
          << option << " " << name;
      EXPECT_THAT(errors_, HasSubstr(words)) << option;
    }
  }
  for (const auto& name : {"link", "fifo"}) {
    EXPECT_EQ(launch({"bench", "latency", "--raw", (folder_ / name).string()}), 2) << name;
  }
  std::filesystem::create_symlink(folder_ / "precious", folder_ / "link.dot");
  EXPECT_EQ(launch({"graph", application(), "-o", (folder_ / "link.dot").string()}), 1);
  std::filesystem::create_symlink(folder_ / "precious", folder_ / "link.svg");
  EXPECT_EQ(launch({"graph", application(), "-o", (folder_ / "link.svg").string()}), 1);

  EXPECT_EQ(content_of(application()), before);
  EXPECT_EQ(content_of(folder_ / "precious"), "precious");
}

// ---- Traces ----

TEST_F(Launcher, TraceIsWrittenForALiveAndForASimulatedRun) {
  write_application({kCounter, kAdder});
  for (const char* const clock : {"live", "simulated"}) {
    const auto file = folder_ / (std::string(clock) + ".pftrace");
    ASSERT_EQ(run({"--for", "100ms", "--clock", clock, "--trace", file.string()}), 0) << errors_;

    const json trace = report()["trace"];
    EXPECT_EQ(trace["file"], file.string());
    EXPECT_EQ(trace["problem"], "");
    EXPECT_EQ(trace["bytes"], std::filesystem::file_size(file));
    EXPECT_GT(trace["slices"], 0);
    EXPECT_GT(trace["flows"], 0);
    EXPECT_EQ(trace["lost"], json({{"activations", 0}, {"events", 0}, {"notes", 0}}));
    EXPECT_THAT(output_, HasSubstr("TRACED "));
  }
}

TEST_F(Launcher, TraceThatCannotBeWrittenIsAnError) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--trace", (folder_ / "missing/run.pftrace").string()}), 2);

  EXPECT_THAT(errors_, HasSubstr("the trace cannot be written: "));
  EXPECT_THAT(errors_, HasSubstr("missing/run.pftrace"));
}

TEST_F(Launcher, TraceOfTheFileGoesWhereTheFileOrTheCommandLineSays) {
  write_application({kCounter, kAdder}, R"(, "trace": {"file": "file.pftrace", "buffer_mb": 2})");
  ASSERT_EQ(run({"--for", "20ms", "--clock", "simulated"}), 0) << errors_;
  EXPECT_EQ(report()["trace"]["file"], (folder_ / "file.pftrace").string());
  std::filesystem::remove(folder_ / "file.pftrace");

  const auto other = folder_ / "line.pftrace";
  ASSERT_EQ(run({"--for", "20ms", "--clock", "simulated", "--trace", other.string()}), 0)
      << errors_;
  EXPECT_EQ(report()["trace"]["file"], other.string());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "file.pftrace"));

  ASSERT_EQ(run({"--for", "20ms", "--clock", "simulated", "--overlay",
                 folder_.write("quiet.json", R"({"trace": null})").string()}),
            0)
      << errors_;
  EXPECT_FALSE(report().contains("trace"));
}

TEST_F(Launcher, TraceOfTheFileThatCannotBeWrittenIsAnErrorAtItsPlace) {
  write_application({kCounter, kAdder}, R"(, "trace": {"file": "missing/run.pftrace"})");

  EXPECT_EQ(run(), 2);

  EXPECT_THAT(errors_, HasSubstr("app.json:1: /trace: the trace cannot be written: "));
}

// ---- The flight recorder ----

constexpr const char* kFlightRecorder =
    R"(, "flight_recorder": {"file": "drive.ring", "size_mb": 1, "before_s": 0.01, "after_s": 0.005})";

TEST_F(Launcher, FlightRecorderWritesWhatWasAroundAFault) {
  write_application({kCounter, kAdder, trouble("serve", "stop_component")}, kFlightRecorder);
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated"}), 0) << errors_;

  const json recorder = report()["flight_recorder"];
  EXPECT_EQ(recorder["file"], (folder_ / "drive.ring").string());
  EXPECT_GT(recorder["messages"], 0);
  ASSERT_EQ(recorder["dumps"].size(), 1U) << recorder;
  const json dump = recorder["dumps"][0];
  EXPECT_EQ(dump["reason"], "fault");
  EXPECT_EQ(dump["component"], "trouble");
  EXPECT_EQ(dump["problem"], "");
  EXPECT_EQ(dump["file"], (folder_ / "drive_2000-01-01_00-00-00_fault.mcap").string());
  EXPECT_TRUE(std::filesystem::exists(dump["file"].get<std::string>()));
  // Both topics, up to 5 ms after the first tick.
  EXPECT_EQ(dump["messages"], 12) << recorder;
  EXPECT_THAT(errors_, HasSubstr("fault.mcap (12 messages; fault of trouble)"));
  EXPECT_THAT(output_, HasSubstr("FLIGHT RECORDER kept"));

  ASSERT_EQ(
      run({"--for", "100ms", "--clock", "simulated", "--overlay",
           folder_.write("quiet.json", R"({"flight_recorder": {"on_fault": false}})").string()}),
      0);
  EXPECT_EQ(report()["flight_recorder"]["dumps"].size(), 0U);
}

TEST_F(Launcher, FlightRecorderWritesWhatAComponentAsksFor) {
  write_application(
      {kCounter, R"({"name": "alarm", "library": "launcher_parts", "class": "Alarm"})"});
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated", "--flight-recorder",
                 (folder_ / "other.ring").string(), "--flight-recorder-mb", "2"}),
            0)
      << errors_;

  const json recorder = report()["flight_recorder"];
  EXPECT_EQ(recorder["capacity"], 2'002'944);  // Whole pages.
  ASSERT_EQ(recorder["dumps"].size(), 1U) << recorder;
  EXPECT_EQ(recorder["dumps"][0]["reason"], "Hard braking");
  EXPECT_EQ(recorder["dumps"][0]["component"], "alarm");
  EXPECT_THAT(recorder["dumps"][0]["file"].get<std::string>(),
              testing::EndsWith("/other_2000-01-01_00-00-00_hard_braking.mcap"));

  // Without one nothing happens.
  ASSERT_EQ(run({"--for", "100ms", "--clock", "simulated"}), 0) << errors_;
  EXPECT_FALSE(report().contains("flight_recorder"));
}

TEST_F(Launcher, FlightRecorderOfAKilledRunIsReadAtTheNextStart) {
  write_application({kCounter, kAdder}, kFlightRecorder);
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  // The recorder takes messages every few milliseconds, or later.
  const auto free_bytes = [&] {
    return std::ranges::count(content_of(folder_ / "drive.ring"), '\0');
  };
  const auto free_before = free_bytes();
  for (int i = 0; i < 6000 && free_bytes() > free_before - 1000; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  program.send(SIGKILL);
  take(program);

  ASSERT_EQ(run({"--set", "counter.count=3"}), 0) << errors_;

  EXPECT_THAT(errors_, HasSubstr("the run before did not end in order"));
  const json dumps = report()["flight_recorder"]["dumps"];
  ASSERT_EQ(dumps.size(), 1U);
  EXPECT_EQ(dumps[0]["reason"], "crash");
  EXPECT_GE(dumps[0]["messages"], 1);
  EXPECT_THAT(dumps[0]["file"].get<std::string>(), testing::EndsWith("_crash.mcap"));
  EXPECT_TRUE(std::filesystem::exists(dumps[0]["file"].get<std::string>()));

  // This one ended in order.
  ASSERT_EQ(run({"--set", "counter.count=3"}), 0) << errors_;
  EXPECT_EQ(report()["flight_recorder"]["dumps"].size(), 0U);
}

TEST_F(Launcher, RunGoesOnWhenTheRingOfTheFlightRecorderIsCutOff) {
  write_application({kCounter, kAdder}, kFlightRecorder);
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();

  std::filesystem::resize_file(folder_ / "drive.ring", 0);
  ASSERT_TRUE(program.wait_for("drive.ring: another program cut it off")) << program.errors();
  program.send(SIGINT);

  EXPECT_EQ(take(program), 0) << errors_;
  EXPECT_THAT(report()["flight_recorder"]["problem"].get<std::string>(), HasSubstr("cut it off"));
}

TEST_F(Launcher, SignalAsksTheFlightRecorderForADump) {
  write_application({kCounter, kAdder}, kFlightRecorder);
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  program.send(SIGUSR1);
  ASSERT_TRUE(program.wait_for("_signal.mcap")) << program.errors();
  program.send(SIGINT);

  EXPECT_EQ(take(program), 0) << errors_;
  EXPECT_EQ(report()["flight_recorder"]["dumps"][0]["reason"], "signal");
}

TEST_F(Launcher, SignalDoesNothingWithoutAFlightRecorder) {
  write_application({kCounter, kAdder});
  Process program(started_with(run_words()));
  ASSERT_TRUE(program.wait_for("received ten numbers")) << program.errors();
  program.send(SIGUSR1);
  ASSERT_TRUE(program.wait_for("there is no flight recorder")) << program.errors();
  program.send(SIGINT);

  EXPECT_EQ(take(program), 0) << errors_;
}

TEST_F(Launcher, NothingIsStartedWhereThereCanBeNoFlightRecorder) {
  write_application({kCounter, kAdder}, kFlightRecorder);
  std::filesystem::create_symlink(folder_ / "elsewhere", folder_ / "drive.ring");

  EXPECT_EQ(run(), 2);

  EXPECT_THAT(errors_, HasSubstr("/flight_recorder: flight recorder: "));
  EXPECT_THAT(errors_, HasSubstr("drive.ring: "));
  EXPECT_THAT(errors_, HasSubstr("a symbolic link"));
  EXPECT_THAT(errors_, HasSubstr("nothing was started"));
  EXPECT_FALSE(has_report());

  EXPECT_EQ(run({"--flight-recorder", (folder_ / "missing/drive.ring").string()}), 2);
  EXPECT_THAT(errors_, HasSubstr("missing/drive.ring"));
  EXPECT_EQ(run({"--flight-recorder-mb", "0"}), 2);
  EXPECT_THAT(errors_, HasSubstr("--flight-recorder-mb expects a number from 1"));
}

TEST_F(Launcher, WhatTheMachineRefusesIsReportedOnceAndFatalOnlyWhenStrict) {
  write_application({R"({"name": "counter", "library": "launcher_parts", "class": "Counter",
           "serve_period_ms": 1, "executor": "far"})"},
                    R"(, "executors": [{"name": "far", "threads": 2, "cpus": [1000, 1001]}])");

  EXPECT_EQ(run({"--set", "counter.count=3"}), 0) << errors_;
  EXPECT_THAT(errors_, HasSubstr("refused: "));
  EXPECT_EQ(report()["end"], "input finished");

  EXPECT_EQ(run({"--set", "counter.count=3", "--strict"}), 1) << errors_;
  EXPECT_EQ(report()["end"], "refused by the machine");
}

TEST_F(Launcher, NothingIsDrawnWhereThereIsNoTerminal) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--for", "1200ms"}), 0);

  EXPECT_THAT(errors_, Not(HasSubstr("\x1b")));
  EXPECT_THAT(errors_, Not(HasSubstr("messages/s")));
}

TEST_F(Launcher, QuietRunPrintsNothingButTheLog) {
  write_application({kCounter, kAdder});

  EXPECT_EQ(run({"--quiet", "--set", "counter.count=3"}), 0);

  EXPECT_EQ(output_, "");
  EXPECT_EQ(report()["results"]["published"], 3);
}

TEST_F(Launcher, TableThatCannotBePrintedIsReported) {
  write_application({kCounter, kAdder});
  std::string line = std::string("exec '") + FASTCYCLE_PROGRAM + "'";
  for (const std::string& word : run_words({"--set", "counter.count=3"})) {
    line += " '" + word + "'";
  }
  Process program({.program = "/bin/sh", .arguments = {"-c", line + " >/dev/full"}});

  EXPECT_EQ(take(program), 0) << errors_;

  EXPECT_THAT(errors_, HasSubstr("standard output: No space left on device"));
  EXPECT_EQ(report()["results"]["published"], 3);
}

// ---- Files that may not grow ----

TEST_F(Launcher, AFileThatMayNotGrowIsAnErrorOfThatFileAndNotTheEndOfTheRun) {
  write_application({kCounter, kAdder});
  for (const std::string option : {"--record", "--trace"}) {
    const std::string file = (folder_ / "file").string();
    Process program(
        {.program = "/bin/bash",
         .arguments = {
             "-c", "ulimit -f 1; exec \"$0\" run \"$1\" --for 200ms --quiet " + option + " \"$2\"",
             FASTCYCLE_PROGRAM, application(), file}});
    EXPECT_EQ(take(program), 1) << errors_;
    EXPECT_THAT(errors_, testing::HasSubstr("File too large"));
    EXPECT_THAT(errors_, testing::HasSubstr(file));
  }
}

// ---- Little room ----

TEST_F(Launcher, WhereNoThreadCanBeMadeItIsSaidWhichLimitsToRaise) {
  if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
    GTEST_SKIP() << "a sanitizer needs more memory than that";
  }
  write_application({kCounter, kAdder});
  int refusals = 0;
  for (int megabytes = 30; megabytes <= 160; megabytes += 10) {
    Process program({.program = "/bin/bash",
                     .arguments = {"-c",
                                   "ulimit -v " + std::to_string(1000 * megabytes) +
                                       "; exec \"$0\" run \"$1\" --for 20ms --quiet",
                                   FASTCYCLE_PROGRAM, application()}});
    take(program);
    if (errors_.find("fastcycle: ") != std::string::npos &&
        errors_.find("Resource temporarily unavailable") != std::string::npos &&
        errors_.find("trial") == std::string::npos) {
      ++refusals;
      EXPECT_THAT(errors_, HasSubstr("raise the limits of threads and of memory (ulimit -u, "
                                     "ulimit -v)"));
    }
  }
  EXPECT_GT(refusals, 0);
}

}  // namespace
}  // namespace fastcycle::launcher
