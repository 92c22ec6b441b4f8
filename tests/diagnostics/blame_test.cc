// Each fault that a component can have is named: component and call on standard error, within a
// run that ends, and not with exit code 0.

#include <csignal>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "config/test_folder.h"
#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::diagnostics {
namespace {

using nlohmann::json;
using test::Process;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

bool is_sanitized() {
  return std::string_view(FASTCYCLE_SANITIZER) != "none";
}

class Blame : public testing::Test {
 protected:
  void SetUp() override {
    if (is_sanitized()) {
      GTEST_SKIP() << "sanitizers report crashes in their own way";
    }
  }

  void write_application(const std::string& how, const std::string& where,
                         const json& more = json::object(), const json& whole = json::object()) {
    json broken{{"name", "mine"},
                {"library", "blame_broken"},
                {"params", {{"how", how}, {"where", where}}}};
    broken.merge_patch(more);
    if (where == "serve") {
      broken["serve_period_ms"] = 5;
    }
    json application{
        {"name", "blamed"},
        {"components",
         {{{"name", "ticker"}, {"library", "blame_ticker"}, {"serve_period_ms", 2}}, broken}}};
    application.merge_patch(whole);
    folder_.write("app.json", application.dump(2));
  }

  /// Runs it to its end; 1000 + the number of the signal that ended it.
  int run(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"run", "app.json", "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    Process program({.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()});
    const test::Ending& ending = program.wait();
    errors_ = program.errors();
    EXPECT_FALSE(ending.was_too_late) << errors_;
    return ending.signal != 0 ? 1000 + ending.signal : ending.exit_code;
  }

  /// The file of the report; empty if there is none.
  [[nodiscard]] std::filesystem::path report_file() const {
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      if (entry.path().filename().string().starts_with("fastcycle-crash-blamed-")) {
        return entry.path();
      }
    }
    return {};
  }
  [[nodiscard]] std::string report() const {
    std::ostringstream text;
    text << std::ifstream(report_file()).rdbuf();
    return text.str();
  }

  config::TestFolder folder_;
  std::string errors_;
};

// ---- Crashes ----

struct Fault {
  const char* how;
  int ending;        ///< As `Blame::run` returns it.
  const char* what;  ///< In the report.
};

void PrintTo(const Fault& fault, std::ostream* stream) {
  *stream << fault.how;
}

class BlameOfFault : public Blame, public testing::WithParamInterface<Fault> {};

TEST_P(BlameOfFault, NamesComponentCallAndMessage) {
  write_application(GetParam().how, "callback");

  EXPECT_EQ(run(), GetParam().ending) << errors_;

  EXPECT_THAT(errors_, HasSubstr(GetParam().what));
  EXPECT_THAT(errors_, HasSubstr("  component    \"mine\"\n"));
  EXPECT_THAT(errors_, HasSubstr("  in           its callback for \"counts\"\n"));
  EXPECT_THAT(errors_, HasSubstr("  given        message 20 of \"counts\" from \"ticker\""));
  EXPECT_THAT(errors_, ContainsRegex("  activation   [0-9]+ of this component\n"));
  EXPECT_THAT(errors_, ContainsRegex("  thread       pool-[0-9]+ \\([0-9]+\\)|pool \\("));
  EXPECT_THAT(errors_, HasSubstr("libblame_broken.so"));
  EXPECT_THAT(errors_, ContainsRegex("    ticker: [0-9]+, tick of timer 0, began "));
  EXPECT_THAT(errors_, ContainsRegex("    mine: [0-9]+, message 20 of \"counts\" from \"ticker\", "
                                     "began [0-9.]+ m?s ago, has not ended"));
  EXPECT_THAT(
      errors_,
      HasSubstr("\nfastcycle: crash of component \"mine\", in its callback for \"counts\": "));
  EXPECT_THAT(errors_, Not(HasSubstr("\x1b[31m")));
}

std::vector<Fault> all_faults() {
  std::vector<Fault> faults{
      Fault{"segfault", 1000 + SIGSEGV, "SIGSEGV: a null pointer was used"},
      Fault{"call of null", 1000 + SIGSEGV, "SIGSEGV: a null pointer was used"},
      Fault{"constant", 1000 + SIGSEGV, "SIGSEGV: the memory that was used is protected"},
      Fault{"stack", 1000 + SIGSEGV, "SIGSEGV: the stack of the thread is used up"},
      Fault{"large array", 1000 + SIGSEGV, "SIGSEGV: the stack of the thread is used up"},
      Fault{"abort", 1000 + SIGABRT, "SIGABRT: abort() was called"},
      Fault{"bus error", 1000 + SIGBUS, "SIGBUS"},
#if defined(__x86_64__)  // Elsewhere that is SIGTRAP.
      Fault{"trap", 1000 + SIGILL, "SIGILL: an instruction that the processor does not have"},
#endif
      Fault{"exit", 1, "exit(0) was called while the application runs"},
      Fault{"_exit", 1, "_exit(0) was called while the application runs"},
      Fault{"quick_exit", 1, "quick_exit() was called while the application runs"},
      Fault{"terminate", 1000 + SIGABRT,
            "std::terminate: nobody caught std::logic_error \"this function promised not to "
            "throw?[31m\""},
      Fault{"use after free", 1000 + SIGSEGV, "SIGSEGV"},
      Fault{"free twice", 1000 + SIGABRT, "SIGABRT: abort() was called"}};
#if defined(__x86_64__)  // Elsewhere a division by zero is no fault.
  faults.push_back({"division", 1000 + SIGFPE, "SIGFPE: an integer was divided by zero"});
#endif
  return faults;
}

INSTANTIATE_TEST_SUITE_P(In, BlameOfFault, testing::ValuesIn(all_faults()));

TEST_F(Blame, TheReportSaysInWhichFunction) {
  write_application("segfault", "callback");
  EXPECT_EQ(run(), 1000 + SIGSEGV);
  EXPECT_THAT(errors_,
              ContainsRegex("#0   broken::write_to_null\\+0x[0-9a-f]+ \\(libblame_broken.so\\+0x"));
  EXPECT_THAT(errors_, HasSubstr("broken::cause_fault+0x"));
  EXPECT_THAT(errors_, ContainsRegex("    [0-9a-f]{16,}  /.*/libblame_broken.so\n"));
}

TEST_F(Blame, TheReportSaysHowLongItTook) {
  write_application("segfault", "callback");
  EXPECT_EQ(run(), 1000 + SIGSEGV);
  std::smatch time;
  ASSERT_TRUE(std::regex_search(errors_, time, std::regex("  made in      (.*)\n")));
  RecordProperty("report_made_in", time[1].str());
  std::printf("report made in %s\n", time[1].str().c_str());
}

TEST_F(Blame, ACallOfNothingSaysWhoCalled) {
  write_application("call of null", "callback");
  EXPECT_EQ(run(), 1000 + SIGSEGV);
  EXPECT_THAT(errors_, HasSubstr("#1   broken::call_null+0x"));
}

TEST_F(Blame, TheReportIsAlsoAFileForItsOwnerOnly) {
  write_application("segfault", "callback");
  EXPECT_EQ(run(), 1000 + SIGSEGV);

  ASSERT_FALSE(report_file().empty()) << errors_;
  struct stat status{};
  ASSERT_EQ(stat(report_file().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  EXPECT_THAT(report(), AllOf(HasSubstr("SIGSEGV"), HasSubstr("component    \"mine\""),
                              HasSubstr("last activations")));
  EXPECT_THAT(errors_, HasSubstr("  written to   " + report_file().string()));
}

TEST_F(Blame, LinesThatWaitWhenACrashComesArePrinted) {
  write_application("many lines", "callback");
  EXPECT_EQ(run(), 1000 + SIGSEGV);
  for (int i = 1; i <= 1000; ++i) {
    ASSERT_THAT(errors_, HasSubstr(fmt::format("info mine: line {}\n", i)));
  }
}

class BlameIn : public Blame, public testing::WithParamInterface<const char*> {};

TEST_P(BlameIn, NamesTheCall) {
  const std::string where = GetParam();
  write_application("segfault", where);

  EXPECT_EQ(run({"--for", "1s"}), 1000 + SIGSEGV) << errors_;

  const std::string call = where == "constructor" || where == "destructor" ? "its " + where
                           : where == "thread"                             ? "its thread \"reader\""
                                                                           : "its " + where + "()";
  EXPECT_THAT(errors_, HasSubstr("  component    \"mine\"\n  in           " + call + "\n"));
}

TEST_P(BlameIn, NamesTheCallInSimulatedTime) {
  const std::string where = GetParam();
  write_application("abort", where);

  EXPECT_EQ(run({"--for", "1s", "--clock", "simulated"}), 1000 + SIGABRT) << errors_;

  EXPECT_THAT(errors_, HasSubstr("fastcycle: crash of component \"mine\", in its " + where));
}

INSTANTIATE_TEST_SUITE_P(Call, BlameIn,
                         testing::Values("constructor", "start", "serve", "stop", "destructor",
                                         "thread"));

TEST_F(Blame, AThreadThatAComponentMadeItselfIsNamedByItsCode) {
  for (const std::string how : {"own thread", "throw in own thread"}) {
    write_application(how, "callback");
    EXPECT_EQ(run(), 1000 + (how == "own thread" ? SIGSEGV : SIGABRT)) << errors_;
    EXPECT_THAT(errors_, HasSubstr("it runs code of the library of component \"mine\""));
    EXPECT_THAT(errors_, HasSubstr("fastcycle: crash of component \"mine\", in a thread that it "
                                   "made itself: SIG"));
  }
  EXPECT_THAT(errors_, HasSubstr("nobody caught std::runtime_error \"in a thread of mine\""));
}

TEST_F(Blame, ASignalOfSomebodyElseIsNamedAsSuch) {
  write_application("sleep", "callback", {{"callback_limit_ms", 50}});
  Process program({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"run", "app.json", "--quiet"},
                   .folder = folder_.path()});
  ASSERT_TRUE(program.wait_for("it stands in")) << program.errors();
  program.send(SIGSEGV);
  EXPECT_EQ(program.wait().signal, SIGSEGV);
  EXPECT_THAT(program.errors(), HasSubstr(fmt::format("SIGSEGV, sent by process {}", getpid())));
}

TEST_F(Blame, AllMemoryGoneIsAFaultThatNamesWhoAskedForIt) {
  write_application("memory", "callback", {{"on_fault", "stop"}});
  EXPECT_EQ(run(), 1) << errors_;
  EXPECT_THAT(errors_,
              ContainsRegex("no memory is left for component \"mine\", in its callback for "
                            "\"counts\": the process has [0-9]+ MB, and may map 4294 MB"));
  EXPECT_THAT(errors_, HasSubstr("its callback for \"counts\" threw: std::bad_alloc"));
}

// ---- What the flight recorder reports of a crash ----

TEST_F(Blame, TheFlightRecorderNamesTheCrashInTheNextRun) {
  write_application("segfault", "callback");
  EXPECT_EQ(run({"--flight-recorder", "drive.ring"}), 1000 + SIGSEGV) << errors_;
  write_application("none", "nowhere");
  EXPECT_EQ(run({"--flight-recorder", "drive.ring", "--for", "50ms"}), 0) << errors_;

  std::filesystem::path dump;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".mcap") {
      dump = entry.path();
    }
  }
  ASSERT_FALSE(dump.empty()) << errors_;
  EXPECT_THAT(dump.filename().string(), HasSubstr("_crash"));
  Process info({.program = FASTCYCLE_PROGRAM,
                .arguments = {"info", dump.string(), "--json"},
                .folder = folder_.path()});
  info.wait();
  EXPECT_THAT(info.output(), HasSubstr("in its callback for \\\"counts\\\": SIGSEGV"))
      << info.output() << info.errors();
}

// ---- Faults ----

TEST_F(Blame, ThrownThingsAreFaultsThatDoNotEndTheRun) {
  for (const std::string how : {"throw", "throw of int"}) {
    write_application(how, "callback");
    EXPECT_EQ(run({"--for", "1s"}), 0) << errors_;
    EXPECT_THAT(errors_, HasSubstr("mine: its callback for \"counts\" threw: "));
    EXPECT_EQ(run({"--for", "1s", "--fail-on-fault"}), 1) << errors_;
  }
}

TEST_F(Blame, WhatOffloadedWorkAndTheCallBehindItThrowNamesThem) {
  for (const std::string where : {"work", "behind work"}) {
    const std::string call =
        where == "work" ? "offloaded work" : "its callback behind offloaded work";
    for (const std::string how : {"throw", "throw of int"}) {
      write_application(how, where, {{"executor", "side"}}, {{"executors", {{{"name", "side"}}}}});
      EXPECT_EQ(run({"--for", "1s", "--fail-on-fault"}), 1) << errors_;
      EXPECT_THAT(errors_, HasSubstr("mine: " + call + " threw: " +
                                     (how == "throw" ? "no calibration"
                                                     : "something that is no std::exception")));
    }
    write_application("segfault", where, {{"executor", "side"}},
                      {{"executors", {{{"name", "side"}}}}});
    EXPECT_EQ(run(), 1000 + SIGSEGV) << errors_;
    EXPECT_THAT(errors_, HasSubstr(where == "work" ? "in its offloaded work" : "in " + call));
  }
}

TEST_F(Blame, FailOnFaultIsContentWithARunWithoutAFault) {
  write_application("none", "nowhere");
  EXPECT_EQ(run({"--for", "50ms", "--fail-on-fault"}), 0) << errors_;
}

// ---- Calls that do not return ----

class BlameOfHang : public Blame, public testing::WithParamInterface<const char*> {};

TEST_P(BlameOfHang, NamesCallMessageAndPlaceAndEndsTheRun) {
  write_application(GetParam(), "callback", {{"on_hang", "stop"}, {"callback_limit_ms", 100}});

  EXPECT_EQ(run(), 1) << errors_;

  EXPECT_THAT(errors_, ContainsRegex("error mine: its callback for \"counts\" \\(message 20 of "
                                     "\"counts\" from \"ticker\", published [0-9.]+ m?s before the "
                                     "callback, activation [0-9]+\\) has not returned for "));
  EXPECT_THAT(errors_, ContainsRegex("error mine: it stands in .*libblame_broken.so"));
  EXPECT_THAT(errors_, HasSubstr("the run ends, as its \"on_hang\" says"));
}

INSTANTIATE_TEST_SUITE_P(Of, BlameOfHang, testing::Values("loop", "deadlock", "sleep"));

class BlameOfHangIn : public Blame, public testing::WithParamInterface<const char*> {};

TEST_P(BlameOfHangIn, NamesTheCallAndEndsTheRun) {
  const std::string where = GetParam();
  write_application("loop", where, {{"on_hang", "stop"}},
                    {{"callback_limit_ms", 100}, {"lifecycle_limit_ms", 100}});

  EXPECT_EQ(run({"--for", "1s"}), 1) << errors_;

  const bool is_plain = where == "constructor" || where == "destructor";
  const std::string call = "its " + where + (is_plain ? "" : "()");
  EXPECT_THAT(errors_, HasSubstr("error mine: " + call));
  EXPECT_THAT(errors_, HasSubstr("has not returned for "));
  EXPECT_THAT(errors_, HasSubstr("it stands in broken::spin+0x"));
}

INSTANTIATE_TEST_SUITE_P(Call, BlameOfHangIn,
                         testing::Values("constructor", "start", "serve", "stop", "destructor"));

TEST_F(Blame, ADestructorThatHangsKeepsNoRunFromEnding) {
  for (const std::string how : {"loop", "joins"}) {
    write_application(how, "destructor");
    EXPECT_EQ(run({"--for", "1s"}), 1) << errors_;
    EXPECT_THAT(errors_, HasSubstr("fastcycle run: component \"mine\" has not returned from its "
                                   "destructor, currently in "));
    EXPECT_THAT(errors_, HasSubstr("the process ends without waiting for it"));
  }
}

TEST_F(Blame, AConstructorThatHangsKeepsNoRunFromEnding) {
  write_application("loop", "constructor", {{"lifecycle_limit_ms", 100}});
  Process program({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"run", "app.json", "--quiet"},
                   .folder = folder_.path()});
  ASSERT_TRUE(program.wait_for("it stands in")) << program.errors();
  program.send(SIGINT);
  EXPECT_EQ(program.wait().exit_code, 1);
  EXPECT_THAT(program.errors(), HasSubstr("component \"mine\" has not returned from its "
                                          "constructor, currently in broken::spin+0x"));
}

TEST_F(Blame, AHangIsReportedInSimulatedTimeByTheMachinesClock) {
  write_application("loop", "callback", {{"on_hang", "stop"}, {"callback_limit_ms", 100}});
  EXPECT_EQ(run({"--clock", "simulated", "--for", "10s"}), 1) << errors_;
  EXPECT_THAT(errors_, HasSubstr("error mine: its callback for \"counts\" (message 20"));
}

TEST_F(Blame, AHangIsShownByTools) {
  write_application("sleep", "callback", {{"callback_limit_ms", 50}}, {{"inspect", true}});
  Process program({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"run", "app.json", "--quiet"},
                   .folder = folder_.path()});
  ASSERT_TRUE(program.wait_for("it stands in")) << program.errors();
  EXPECT_THAT(program.errors(), HasSubstr("warning mine: its callback for \"counts\""));

  std::string listed;
  for (int i = 0; i < 200 && listed.find("hangs") == std::string::npos; ++i) {
    Process list({.program = FASTCYCLE_PROGRAM,
                  .arguments = {"component", "list", "--app", "blamed"},
                  .folder = folder_.path()});
    list.wait();
    listed = list.output() + list.errors();
  }
  EXPECT_THAT(listed, HasSubstr("hangs: its callback for \"counts\" (message 20"));
}

// ---- Libraries that are exchanged ----

TEST_F(Blame, ALibraryThatIsWrittenBetweenItsTrialAndItsUseIsNotLoaded) {
  std::filesystem::copy_file(FASTCYCLE_BROKEN_LIBRARY, folder_.path() / "libblame_broken.so");
  write_application("write own library", "trial");
  EXPECT_EQ(run({"--for", "50ms"}), 2) << errors_;
  EXPECT_THAT(errors_, HasSubstr("library \"blame_broken\" was exchanged or written since it was "
                                 "tried"));
}

// ---- Children ----

TEST_F(Blame, AChildThatReturnsFromItsCallbackEndsThere) {
  write_application("fork", "callback");
  EXPECT_EQ(run({"--for", "500ms", "--flight-recorder", "drive.ring"}), 0) << errors_;
  EXPECT_THAT(errors_,
              HasSubstr("component \"mine\", in its callback for \"counts\", called fork(), and "
                        "the call returned in the child too"));
  EXPECT_TRUE(report_file().empty());
}

TEST_F(Blame, AChildMayExit) {
  write_application("fork and exit", "callback");
  EXPECT_EQ(run({"--for", "500ms"}), 0) << errors_;
  EXPECT_EQ(
      errors_,
      "app.json:8: /components/1: warning: component \"mine\": serve() of its class Broken is "
      "never called, because the component has no \"serve_period_ms\"; say how often it is "
      "called, or remove serve() from the class\n");
}

TEST_F(Blame, NoProcessIsLeftOfForks) {
  write_application("fork", "callback");
  Process program({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"run", "app.json", "--quiet", "--for", "500ms"},
                   .folder = folder_.path()});
  const pid_t leader = program.pid();
  EXPECT_EQ(program.wait().exit_code, 0) << program.errors();
  for (int i = 0; i < 1000 && test::processes_of_session(leader) > 0; ++i) {
    usleep(10'000);
  }
  EXPECT_EQ(test::processes_of_session(leader), 0);
}

}  // namespace
}  // namespace fastcycle::diagnostics
