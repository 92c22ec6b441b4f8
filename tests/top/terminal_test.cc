// fastcycle top in a real terminal: tmux shows what a person would see, and presses the keys.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::tool::top {
namespace {

using std::chrono::steady_clock;
using testing::HasSubstr;
using testing::Not;
using namespace std::chrono_literals;

constexpr const char* kApplication = R"({
  "name": "watched",
  "components": [
    {"name": "counter", "library": "launcher_parts", "class": "Counter", "serve_period_ms": 10},
    {"name": "adder", "library": "launcher_parts", "class": "Adder"}
  ]
})";

bool has_tmux() {
  return std::system("command -v tmux >/dev/null 2>&1") == 0;
}

std::string output_of(const std::string& command) {
  std::string output;
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  char buffer[4096];
  while (pipe && fgets(buffer, sizeof(buffer), pipe.get()) != nullptr) {
    output += buffer;
  }
  return output;
}

/// A terminal of its own with a shell in it, on nobody else's server.
class TmuxTerminal {
 public:
  TmuxTerminal(const test::Folder& folder, int width, int height)
      : tmux_("tmux -u -S " + (folder / "tmux").string() + " -f /dev/null ") {
    run("new-session -d -x " + std::to_string(width) + " -y " + std::to_string(height) +
        " 'env PS1=ready: bash --norc --noprofile -i'");
    run("set-option -g escape-time 0");
  }
  TmuxTerminal(const TmuxTerminal&) = delete;
  TmuxTerminal& operator=(const TmuxTerminal&) = delete;
  ~TmuxTerminal() { run("kill-server"); }

  void run(const std::string& words) const { output_of(tmux_ + words + " 2>&1"); }
  void type(const std::string& text) const { run("send-keys -l '" + text + "'"); }
  /// By tmux's names: `Enter`, `Tab`, `C-z`.
  void press(const std::string& key) const { run("send-keys " + key); }

  [[nodiscard]] std::string screen() const { return output_of(tmux_ + "capture-pane -p"); }
  [[nodiscard]] std::string screen_with_colours() const {
    return output_of(tmux_ + "capture-pane -p -e");
  }
  /// Whether a program has put the shell's screen aside, and whether the cursor is shown: "1 0".
  [[nodiscard]] std::string state() const {
    return output_of(tmux_ + "display-message -p '#{alternate_on} #{cursor_flag}'");
  }

  /// Waits until `is_true` says so of the screen.
  [[nodiscard]] bool wait_until(const std::function<bool(const std::string&)>& is_true) const {
    const auto end = steady_clock::now() + test::Process::kLongest;
    while (steady_clock::now() < end) {
      if (is_true(screen())) {
        return true;
      }
      std::this_thread::sleep_for(20ms);
    }
    return false;
  }
  [[nodiscard]] bool wait_for(const std::string& text) const {
    return wait_until(
        [&](const std::string& seen) { return seen.find(text) != std::string::npos; });
  }

 private:
  std::string tmux_;
};

/// An application that runs and may be looked at, and a terminal. They take a while.
class ManyTerminals : public testing::Test {
 protected:
  void SetUp() override {
    if (!has_tmux()) {
      GTEST_SKIP() << "tmux is not installed";
    }
    folder_.write("app.json", kApplication);
    environment_ = {"XDG_RUNTIME_DIR=" + folder_.path().string()};
    std::vector<std::string> words{"run", (folder_ / "app.json").string(), "--inspect", "--quiet"};
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");  // A memory checker looks at its own process.
    }
    application_ = std::make_unique<test::Process>(test::ProcessOptions{
        .program = FASTCYCLE_PROGRAM, .arguments = words, .environment = environment_});
    ASSERT_TRUE(is_there()) << application_->errors();
  }

  /// Waits until the application can be asked.
  [[nodiscard]] bool is_there() const {
    const auto end = steady_clock::now() + test::Process::kLongest;
    while (steady_clock::now() < end) {
      test::Process once({.program = FASTCYCLE_PROGRAM,
                          .arguments = {"top", "--json", "--interval", "100ms"},
                          .environment = environment_});
      if (once.wait().exit_code == 0) {
        return true;
      }
      std::this_thread::sleep_for(50ms);
    }
    return false;
  }

  [[nodiscard]] std::string command(const std::string& more = "") const {
    return environment_[0] + " " + FASTCYCLE_PROGRAM + " top --interval 200ms" + more;
  }
  void start_top(const TmuxTerminal& terminal, const std::string& more = "") const {
    ASSERT_TRUE(terminal.wait_for("ready:"));
    terminal.type(command(more) + "; echo code=$?");
    terminal.press("Enter");
    ASSERT_TRUE(terminal.wait_for("adder")) << terminal.screen();
    EXPECT_EQ(terminal.state(), "1 0\n");
  }

  test::Folder folder_;
  std::vector<std::string> environment_;
  std::unique_ptr<test::Process> application_;
};

TEST_F(ManyTerminals, ShowComponentsAndTopicsAndAreAsBeforeAtTheEnd) {
  const TmuxTerminal terminal(folder_, 80, 24);
  start_top(terminal);
  EXPECT_TRUE(terminal.wait_until([](const std::string& seen) {
    return seen.find("watched") != std::string::npos && seen.find("active") != std::string::npos &&
           seen.find("CPU%") != std::string::npos;
  })) << terminal.screen();

  terminal.press("Tab");
  EXPECT_TRUE(terminal.wait_until([](const std::string& seen) {
    return seen.find("TOPIC") != std::string::npos && seen.find("numbers") != std::string::npos;
  })) << terminal.screen();
  EXPECT_THAT(terminal.screen_with_colours(), HasSubstr("\x1b[46m"));

  terminal.type("q");
  EXPECT_TRUE(terminal.wait_for("code=0")) << terminal.screen();
  EXPECT_EQ(terminal.state(), "0 1\n");
  EXPECT_THAT(terminal.screen(), Not(HasSubstr("TOPIC")));
  terminal.type("stty -a");
  terminal.press("Enter");
  EXPECT_TRUE(terminal.wait_for(" icanon iexten echo ")) << terminal.screen();
}

TEST_F(ManyTerminals, GrowWithTheScreen) {
  const TmuxTerminal terminal(folder_, 80, 24);
  start_top(terminal);
  EXPECT_THAT(terminal.screen(), Not(HasSubstr("EXECUTOR")));

  terminal.run("resize-window -x 140 -y 40");
  EXPECT_TRUE(terminal.wait_for("EXECUTOR")) << terminal.screen();

  terminal.run("resize-window -x 40 -y 10");
  EXPECT_TRUE(terminal.wait_until([](const std::string& seen) {
    return seen.find("EXECUTOR") == std::string::npos &&
           seen.find("COMPONENT") != std::string::npos;
  })) << terminal.screen();
}

TEST_F(ManyTerminals, FilterPauseAndHelpByKeys) {
  const TmuxTerminal terminal(folder_, 80, 24);
  start_top(terminal);

  terminal.type("/count");
  EXPECT_TRUE(terminal.wait_until([](const std::string& seen) {
    return seen.find("filter: count_") != std::string::npos &&
           seen.find("adder") == std::string::npos;
  })) << terminal.screen();
  terminal.press("Escape");
  EXPECT_TRUE(terminal.wait_for("adder"));

  terminal.press("Space");
  EXPECT_TRUE(terminal.wait_for("PAUSED"));
  terminal.press("Space");
  EXPECT_TRUE(terminal.wait_until(
      [](const std::string& seen) { return seen.find("PAUSED") == std::string::npos; }));

  terminal.type("?");
  EXPECT_TRUE(terminal.wait_for("sort by another column"));
  terminal.press("Escape");
  terminal.press("Down");
  terminal.press("Enter");
  EXPECT_TRUE(terminal.wait_for("callback time")) << terminal.screen();
  terminal.press("C-c");
  EXPECT_TRUE(terminal.wait_for("code=0")) << terminal.screen();
}

TEST_F(ManyTerminals, SayThatTheApplicationHasEnded) {
  const TmuxTerminal terminal(folder_, 80, 24);
  start_top(terminal);

  application_->send(SIGTERM);

  EXPECT_TRUE(terminal.wait_for("watched has ended")) << terminal.screen();
  EXPECT_TRUE(terminal.wait_for("code=0")) << terminal.screen();
  EXPECT_EQ(terminal.state(), "0 1\n");
}

TEST_F(ManyTerminals, AreAsBeforeWhileItIsStoppedAndWhenASignalEndsIt) {
  const TmuxTerminal terminal(folder_, 80, 24);
  ASSERT_TRUE(terminal.wait_for("ready:"));
  terminal.type(command());
  terminal.press("Enter");
  ASSERT_TRUE(terminal.wait_for("adder")) << terminal.screen();

  terminal.press("C-z");
  EXPECT_TRUE(terminal.wait_for("Stopped")) << terminal.screen();
  EXPECT_EQ(terminal.state(), "0 1\n");
  terminal.type("fg");
  terminal.press("Enter");
  EXPECT_TRUE(terminal.wait_for("adder")) << terminal.screen();
  EXPECT_EQ(terminal.state(), "1 0\n");

  terminal.type("q");
  EXPECT_TRUE(terminal.wait_until(
      [](const std::string& seen) { return seen.find("COMPONENT") == std::string::npos; }));

  for (const int signal : {SIGTERM, SIGABRT}) {
    const std::string file = (folder_ / ("pid" + std::to_string(signal))).string();
    terminal.type("clear; sh -c \"echo \\$\\$ > " + file + "; exec env " + command() +
                  "\"; echo ended=" + std::to_string(signal));
    terminal.press("Enter");
    ASSERT_TRUE(terminal.wait_for("adder")) << terminal.screen();
    kill(std::stoi(test::read_file(file)), signal);
    EXPECT_TRUE(terminal.wait_for("ended=" + std::to_string(signal))) << terminal.screen();
    EXPECT_EQ(terminal.state(), "0 1\n") << signal;
  }
}

TEST_F(ManyTerminals, AnswerKeysWhileTheApplicationHangs) {
  const TmuxTerminal terminal(folder_, 80, 24);
  start_top(terminal);

  application_->send(SIGSTOP);
  EXPECT_TRUE(terminal.wait_for("no answer for")) << terminal.screen();
  terminal.press("Tab");
  EXPECT_TRUE(terminal.wait_for("numbers")) << terminal.screen();
  terminal.type("q");
  EXPECT_TRUE(terminal.wait_for("code=0")) << terminal.screen();
  application_->send(SIGCONT);
}

TEST_F(ManyTerminals, HaveNoColoursWhereNobodyWantsThem) {
  const TmuxTerminal terminal(folder_, 80, 24);
  ASSERT_TRUE(terminal.wait_for("ready:"));
  terminal.type("export NO_COLOR=1; clear");
  terminal.press("Enter");
  start_top(terminal);

  const std::string seen = terminal.screen_with_colours();

  for (const char* colour : {"\x1b[46m", "\x1b[32m", "\x1b[31m", "\x1b[44m"}) {
    EXPECT_THAT(seen, Not(HasSubstr(colour)));
  }
}

TEST_F(ManyTerminals, AreNotNeededForOneLook) {
  test::Process once({.program = FASTCYCLE_PROGRAM,
                      .arguments = {"top", "--once", "--interval", "200ms"},
                      .environment = environment_});
  EXPECT_EQ(once.wait().exit_code, 0) << once.errors();
  EXPECT_THAT(once.output(), HasSubstr("COMPONENT"));
  EXPECT_THAT(once.output(), HasSubstr("numbers"));
  EXPECT_THAT(once.output(), Not(HasSubstr("\x1b")));

  test::Process json({.program = FASTCYCLE_PROGRAM,
                      .arguments = {"top", "--json", "--interval", "200ms", "--app", "watched"},
                      .environment = environment_});
  EXPECT_EQ(json.wait().exit_code, 0) << json.errors();
  const nlohmann::json document = nlohmann::json::parse(json.output());
  EXPECT_EQ(document.at("application"), "watched");
  EXPECT_EQ(document.at("components").at(0).at("name"), "counter");

  test::Process screen(
      {.program = FASTCYCLE_PROGRAM, .arguments = {"top"}, .environment = environment_});
  EXPECT_EQ(screen.wait().exit_code, 2);
  EXPECT_THAT(screen.errors(), HasSubstr("--once"));

  test::Process other({.program = FASTCYCLE_PROGRAM,
                       .arguments = {"top", "--once", "--app", "nobody"},
                       .environment = environment_});
  EXPECT_EQ(other.wait().exit_code, 1);
  EXPECT_THAT(other.errors(), HasSubstr("watched"));
}

}  // namespace
}  // namespace fastcycle::tool::top
