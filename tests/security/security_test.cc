// What another process of the same user can learn of a running application, what a run leaves
// behind, and that these tests would notice: each has a control that must succeed.
//
// Root may do everything; a test that starts as root starts program and attacker as an ordinary
// user.

#include <algorithm>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "attacks.h"
#include "exposure.h"
#include "process/process.h"

namespace fastcycle::test {
namespace {

namespace fs = std::filesystem;

const std::string kSecret = "the key is under the puddle: the doors open 63-14-25";

bool is_root() {
  return geteuid() == 0;
}
uid_t user() {
  return is_root() ? kNobody : geteuid();
}

/// A tree of programs and libraries that every user may read, and an application in it.
class Security : public testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "a sanitizer's own threads and its leak search need a process that is not "
                    "protected";
#endif
    std::istringstream files(FASTCYCLE_INSTALLED_FILES);
    for (std::string file; std::getline(files, file, '|');) {
      const fs::path copy =
          installed_.path() / fs::path(file).lexically_relative(FASTCYCLE_BUILD_FOLDER);
      fs::create_directories(copy.parent_path());
      fs::copy(file, copy);
      fs::permissions(copy, fs::perms(0755));
    }
    for (const char* folder : {"work", "temporary"}) {
      fs::create_directory(installed_ / folder);
      fs::permissions(installed_ / folder, fs::perms(01777));
    }
    write_application("go on");
  }

  void write_application(const std::string& then) {
    installed_.write("app.json", R"({"name": "secrets", "components": [
  {"name": "keeper", "library": "security_parts", "class": "Keeper", "serve_period_ms": 5},
  {"name": "listener", "library": "security_parts", "class": "Listener", "params": {"then": ")" +
                                     then + R"("}}
]})");
  }

  /// As root installs them: other users may execute the programs and not read them.
  void make_unreadable() const {
    fs::permissions(program(), fs::perms(0711));
    fs::permissions(installed_ / "libexec/fastcycle/fastcycle-trial", fs::perms(0711));
  }

  [[nodiscard]] fs::path program() const { return installed_ / "bin/fastcycle"; }
  [[nodiscard]] fs::path work() const { return installed_ / "work"; }

  [[nodiscard]] ProcessOptions run(const std::vector<std::string>& more = {}) const {
    ProcessOptions options{
        .program = program(),
        .arguments = {"run", (installed_ / "app.json").string(), "--library-path",
                      (installed_ / "lib/fastcycle").string(), "--quiet"},
        .folder = work(),
        .environment = {"TMPDIR=" + (installed_ / "temporary").string()},
        .is_ordinary_user = true};
    options.arguments.insert(options.arguments.end(), more.begin(), more.end());
    return options;
  }

  /// A run that the test may look into: root may always.
  [[nodiscard]] ProcessOptions run_to_look_into() const {
    return is_root() ? run() : run({"--debuggable"});
  }

  Folder installed_;
};

/// Where the running program has the secret, once it says so.
std::optional<std::uintptr_t> address_of_secret(Process& process) {
  const std::string mark = "secret at 0x";
  if (!process.wait_for(mark)) {
    return std::nullopt;
  }
  // The rest of the line may come a moment later.
  static_cast<void>(process.wait_for("\n"));
  const std::string& text = process.errors();
  const char* const begin = text.data() + text.find(mark) + mark.size();
  std::uintptr_t address = 0;
  std::from_chars(begin, text.data() + text.size(), address, 16);
  return address;
}

// --- Another process of the same user -----------------------------------------------------------

/// Attacks a run with `arguments`; runs as an ordinary user.
std::string attack_run(const ProcessOptions& options) {
  Process victim(options);
  const auto address = address_of_secret(victim);
  return address ? to_text(attack(victim.pid(), *address, kSecret)) : "";
}

/// The same against a process that has the secret and no protection: what this machine allows.
std::string attack_plain_process() {
  const std::string secret = kSecret + "!";
  const pid_t pid = fork();
  if (pid == 0) {
    prctl(PR_SET_DUMPABLE, 1);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    raise(SIGSTOP);
    for (;;) {
      pause();
    }
  }
  int status = 0;
  waitpid(pid, &status, WUNTRACED);
  kill(pid, SIGCONT);
  waitpid(pid, &status, WCONTINUED);
  const auto address = reinterpret_cast<std::uintptr_t>(secret.data());
  const std::string results = to_text(attack(pid, address, kSecret));
  kill(pid, SIGKILL);
  waitpid(pid, &status, 0);
  return results;
}

void expect_refused(const std::map<std::string, Result>& results) {
  EXPECT_GE(results.size(), 20U);
  for (const auto& [name, result] : results) {
    EXPECT_TRUE(result == Result::kRefused || result == Result::kMissing)
        << name << ": " << static_cast<char>(result);
  }
}

TEST_F(Security, AnotherProcessOfTheSameUserIsRefusedEverything) {
  const auto results = from_text(as_ordinary_user([&] { return attack_run(run()); }));

  expect_refused(results);
}

TEST_F(Security, AnotherUserIsRefusedEverythingEvenIfDebuggable) {
  if (!is_root()) {
    GTEST_SKIP() << "only root can be two users";
  }
  Process victim(run({"--debuggable"}));
  const auto address = address_of_secret(victim);
  ASSERT_TRUE(address) << victim.errors();
  constexpr unsigned kStranger = kNobody - 1;

  const auto results = from_text(as_ordinary_user(
      [&] { return to_text(attack(victim.pid(), *address, kSecret)); }, kStranger));

  expect_refused(results);
}

TEST_F(Security, WithDebuggableTheSameAttacksSucceed) {
  const auto plain = from_text(as_ordinary_user(attack_plain_process));
  const auto results =
      from_text(as_ordinary_user([&] { return attack_run(run({"--debuggable"})); }));

  EXPECT_EQ(results.size(), plain.size());
  int succeeded = 0;
  for (const auto& [name, result] : results) {
    if (plain.contains(name) && plain.at(name) == Result::kSucceeded) {
      EXPECT_EQ(static_cast<char>(result), 's') << name;
      ++succeeded;
    } else {
      std::printf("not on this machine, even against a plain process: %s\n", name.c_str());
    }
  }
  if (succeeded == 0) {
    GTEST_SKIP() << "this machine refuses these attacks against every process";
  }
}

TEST_F(Security, WithDebuggableTheySucceedAlsoIfTheUserCannotReadTheProgram) {
  if (!is_root()) {
    GTEST_SKIP() << "only root can install a program that its user cannot read";
  }
  make_unreadable();
  const auto plain = from_text(as_ordinary_user(attack_plain_process));
  const auto results =
      from_text(as_ordinary_user([&] { return attack_run(run({"--debuggable"})); }));

  ASSERT_TRUE(results.contains("process_vm_readv"));
  EXPECT_EQ(results.at("process_vm_readv"), plain.at("process_vm_readv"));
  EXPECT_EQ(results.at("mem for reading"), plain.at("mem for reading"));
}

TEST_F(Security, ARunWhoseProtectionAComponentUndoesDoesNotStart) {
  installed_.write("app.json", R"({"name": "open", "components": [
  {"name": "opener", "library": "security_parts", "class": "Opener"}]})");
  Process process(run({"--for", "50ms"}));
  Process debuggable(run({"--for", "50ms", "--debuggable"}));

  EXPECT_EQ(process.wait().exit_code, 2);
  EXPECT_NE(process.errors().find("has made its memory readable again"), std::string::npos)
      << process.errors();
  EXPECT_NE(process.errors().find("nothing was started\n"), std::string::npos);
  EXPECT_EQ(process.errors().find("opener: started"), std::string::npos) << process.errors();
  EXPECT_EQ(debuggable.wait().exit_code, 0);
  EXPECT_NE(debuggable.errors().find("opener: started"), std::string::npos) << debuggable.errors();
}

// --- Tracers and core dumps ---------------------------------------------------------------------

TEST_F(Security, ATracedProgramDoesNotStart) {
  ProcessOptions options = run({"--for", "100ms"});
  options.is_traced = true;
  Process process(options);

  const Ending& ending = process.wait();

  if (ending.exit_code == 127) {
    GTEST_SKIP() << "this machine lets no process be traced";
  }
  EXPECT_EQ(ending.exit_code, 2) << process.errors();
  EXPECT_NE(process.errors().find("traces it and could read every message"), std::string::npos)
      << process.errors();
  EXPECT_EQ(process.errors().find("secret at"), std::string::npos);
}

TEST_F(Security, WithDebuggableATracedProgramStarts) {
  ProcessOptions options = run({"--for", "100ms", "--debuggable"});
  options.is_traced = true;
  Process process(options);

  const Ending& ending = process.wait();

  if (ending.exit_code == 127) {
    GTEST_SKIP() << "this machine lets no process be traced";
  }
  EXPECT_EQ(ending.exit_code, 0) << process.errors();
  EXPECT_NE(process.errors().find("secret at"), std::string::npos);
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    names.insert(entry.path().lexically_relative(folder).string());
  }
  return names;
}

/// The reports of crashes, taken out of `names`.
std::set<std::string> take_reports(std::set<std::string>& names) {
  std::set<std::string> reports;
  std::erase_if(names, [&](const std::string& name) {
    const bool is_report = name.starts_with("fastcycle-crash-");
    if (is_report) {
      reports.insert(name);
    }
    return is_report;
  });
  return reports;
}

struct Crash {
  const char* then;
  int signal;
};

void PrintTo(const Crash& crash, std::ostream* stream) {
  *stream << crash.then;
}

class SecurityOfACrash : public Security, public testing::WithParamInterface<Crash> {};

TEST_P(SecurityOfACrash, LeavesAReportForItsOwnerWithoutTheSecretAndNoCoreDump) {
  write_application(GetParam().then);
  ProcessOptions options = run();
  options.may_dump_core = true;
  Process process(options);

  const Ending& ending = process.wait();

  EXPECT_EQ(ending.signal, GetParam().signal) << process.errors();
  EXPECT_FALSE(ending.has_dumped);
  std::set<std::string> names = names_in(work());
  const std::set<std::string> reports = take_reports(names);
  EXPECT_EQ(names, std::set<std::string>{});
  ASSERT_EQ(reports.size(), 1U);
  const fs::path report = work() / *reports.begin();
  EXPECT_EQ(fs::status(report).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_NE(read_file(report).find("crash report"), std::string::npos);
  EXPECT_EQ(read_file(report).find(kSecret), std::string::npos);
  EXPECT_EQ(process.errors().find(kSecret), std::string::npos);
}

TEST_P(SecurityOfACrash, LeavesOneWithTheSecretIfDebuggable) {
  rlimit limit{};
  getrlimit(RLIMIT_CORE, &limit);
  const std::string pattern = read_file("/proc/sys/kernel/core_pattern");
  if (limit.rlim_max == 0 || pattern.starts_with('|') || pattern.find('/') != std::string::npos) {
    GTEST_SKIP() << "this machine writes no core dump into the working folder; its pattern is "
                 << pattern;
  }
  write_application(GetParam().then);
  ProcessOptions options = run({"--debuggable"});
  options.may_dump_core = true;
  Process process(options);

  const Ending& ending = process.wait();

  EXPECT_EQ(ending.signal, GetParam().signal) << process.errors();
  ASSERT_TRUE(ending.has_dumped);
  std::set<std::string> names = names_in(work());
  take_reports(names);
  ASSERT_EQ(names.size(), 1U);
  EXPECT_NE(read_file(work() / *names.begin()).find(kSecret), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(By, SecurityOfACrash,
                         testing::Values(Crash{"crash", SIGSEGV}, Crash{"abort", SIGABRT}),
                         [](const auto& crash) { return std::string(crash.param.then); });

// --- What is open, and what stays ---------------------------------------------------------------

TEST_F(Security, NoSocketIsOpenAndNoMemoryIsShared) {
  const std::set<std::string> before = shared_memory_of(user());
  Process process(run_to_look_into());
  ASSERT_TRUE(address_of_secret(process)) << process.errors();

  EXPECT_EQ(sockets_of(process.pid()), std::set<std::string>{});
  EXPECT_EQ(shared_mappings_of(process.pid()), std::set<std::string>{});
  EXPECT_EQ(shared_memory_of(user()), before);
}

// The control of the test above: it sees what this process opens.
TEST_F(Security, SocketsAndSharedMemoryWouldBeSeen) {
  const int tcp = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int local = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const std::string name = "/fastcycle-test-" + std::to_string(getpid());
  const int memory = shm_open(name.c_str(), O_RDWR | O_CREAT | O_EXCL, 0600);
  ASSERT_GE(tcp, 0);
  ASSERT_GE(local, 0);
  ASSERT_EQ(listen(tcp, 1), 0);
  if (memory < 0 || ftruncate(memory, 4096) != 0) {
    GTEST_SKIP() << "this machine has no /dev/shm";
  }
  void* const mapped = mmap(nullptr, 4096, PROT_READ, MAP_SHARED, memory, 0);

  const std::set<std::string> sockets = sockets_of(getpid());

  EXPECT_EQ(sockets.size(), 2U) << testing::PrintToString(sockets);
  EXPECT_TRUE(
      std::ranges::any_of(sockets, [](const auto& text) { return text.starts_with("tcp"); }));
  EXPECT_FALSE(shared_mappings_of(getpid()).empty());
  EXPECT_TRUE(shared_memory_of(geteuid()).contains("/dev/shm" + name));

  munmap(mapped, 4096);
  shm_unlink(name.c_str());
  for (const int descriptor : {tcp, local, memory}) {
    close(descriptor);
  }
}

TEST_F(Security, NothingIsLeftOfAProgramThatIsKilled) {
  const std::set<std::string> files = names_in(installed_.path());
  const std::set<std::string> shared = shared_memory_of(user());
  Process process(run());
  ASSERT_TRUE(address_of_secret(process)) << process.errors();
  ASSERT_GE(processes_of_session(process.pid()), 1);

  process.send(SIGKILL);

  EXPECT_EQ(process.wait().signal, SIGKILL);
  EXPECT_FALSE(fs::exists("/proc/" + std::to_string(process.pid())));
  EXPECT_EQ(processes_of_session(process.pid()), 0);
  EXPECT_EQ(names_in(installed_.path()), files);
  EXPECT_EQ(shared_memory_of(user()), shared);
}

// --- Rights of the file -------------------------------------------------------------------------

/// Gives whoever starts `program` the right to real-time priorities; false if that cannot be.
bool set_capability(const fs::path& program) {
  vfs_cap_data data{};
  data.magic_etc = VFS_CAP_REVISION_2 | VFS_CAP_FLAGS_EFFECTIVE;
  data.data[0].permitted = 1U << CAP_SYS_NICE;
  return setxattr(program.c_str(), "security.capability", &data, XATTR_CAPS_SZ_2, 0) == 0;
}

// The loader ignores its relative run path then.
TEST_F(Security, AProgramWithACapabilityFindsItsLibraries) {
  if (!is_root() || !set_capability(program())) {
    GTEST_SKIP() << "only root can give a file capabilities, where the file system has them";
  }
  const fs::path core = fs::path(FASTCYCLE_BUILD_FOLDER) / "bin/fastcycle";
  if (as_ordinary_user([&] { return access(core.c_str(), X_OK) == 0 ? "yes" : "no"; }) != "yes") {
    GTEST_SKIP() << "other users may not read the build folder";
  }
  Process process(run({"--for", "50ms"}));

  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
}

// --- The window at start-up ---------------------------------------------------------------------

/// Starts the program and opens its memory as soon as it is the program: whether the handle reads
/// the secret later.
bool wins_race(const ProcessOptions& options) {
  Process victim(options);
  const std::string folder = "/proc/" + std::to_string(victim.pid());
  const auto limit = std::chrono::steady_clock::now() + Process::kLongest;
  while (read_file(folder + "/comm") != "fastcycle\n" && std::chrono::steady_clock::now() < limit) {
  }
  const int memory = open((folder + "/mem").c_str(), O_RDONLY | O_CLOEXEC);
  const auto address = address_of_secret(victim);
  std::string text(kSecret.size(), '\0');
  const bool has_won = memory >= 0 && address &&
                       pread(memory, text.data(), text.size(), static_cast<off_t>(*address)) > 0 &&
                       text == kSecret;
  if (memory >= 0) {
    close(memory);
  }
  return has_won;
}

/// The first process that `parent` starts to be the program `name`; -1 if it has ended before.
pid_t find_child(const Process& parent, const std::string& name) {
  const std::string own = std::to_string(parent.pid());
  const std::string children = "/proc/" + own + "/task/" + own + "/children";
  const auto limit = std::chrono::steady_clock::now() + Process::kLongest;
  while (std::chrono::steady_clock::now() < limit && fs::exists(children)) {
    std::istringstream pids(read_file(children));
    for (std::string pid; pids >> pid;) {
      if (read_file("/proc/" + pid + "/comm") == name + "\n") {
        return std::stoi(pid);
      }
    }
  }
  return -1;
}

/// Starts the program and opens the memory of its trial as soon as there is one: whether the handle
/// reads later what a constructor holds there.
bool wins_race_of_trial(const ProcessOptions& options, const fs::path& gate) {
  fs::remove_all(gate);
  fs::create_directory(gate);
  Process victim(options);
  const pid_t trial = find_child(victim, "fastcycle-trial");
  const std::string folder = "/proc/" + std::to_string(trial);
  const int memory = open((folder + "/mem").c_str(), O_RDONLY | O_CLOEXEC);
  const fs::path started = gate / std::to_string(trial);
  while (!fs::exists(started) && read_file(folder + "/comm") == "fastcycle-trial\n") {
    usleep(1000);
  }
  const std::string address = read_file(started);
  std::string text(kSecret.size(), '\0');
  const bool has_won =
      memory >= 0 && address.starts_with("0x") &&
      pread(memory, text.data(), text.size(), std::stol(address, nullptr, 16)) > 0 &&
      text == kSecret;
  std::ofstream(gate / "go") << "\n";
  if (memory >= 0) {
    close(memory);
  }
  EXPECT_TRUE(address.starts_with("0x")) << "no trial was seen";
  return has_won;
}

constexpr int kLaunches = 40;

std::string races_won(const ProcessOptions& options) {
  int won = 0;
  for (int launch = 0; launch < kLaunches; ++launch) {
    won += wins_race(options) ? 1 : 0;
  }
  return std::to_string(won);
}

/// The same for the trial.
std::string trials_won(const ProcessOptions& options, const fs::path& gate) {
  int won = 0;
  for (int launch = 0; launch < kLaunches; ++launch) {
    won += wins_race_of_trial(options, gate) ? 1 : 0;
  }
  return testing::Test::HasFailure() ? "no trial was seen" : std::to_string(won);
}

// A measurement: nothing can be promised here, see SECURITY.md.
TEST_F(Security, AnAttackerWhoWatchesForTheStartOftenWinsTheRace) {
  const std::string won = as_ordinary_user([&] { return races_won(run()); });

  std::printf("the memory of %s of %d launches was read\n", won.c_str(), kLaunches);
  RecordProperty("won", won);
  EXPECT_FALSE(won.empty());
}

TEST_F(Security, NobodyWinsItAgainstAProgramThatTheUserCannotRead) {
  if (!is_root()) {
    GTEST_SKIP() << "only root can install a program that its user cannot read";
  }
  make_unreadable();

  EXPECT_EQ(as_ordinary_user([&] { return races_won(run()); }), "0");
}

/// A component that holds the secret in its constructor.
class SecurityOfTheTrial : public Security {
 protected:
  void SetUp() override {
    Security::SetUp();
    if (IsSkipped()) {
      return;
    }
    if (!fs::exists("/proc/thread-self/children")) {
      GTEST_SKIP() << "this kernel does not report which children a process has";
    }
    installed_.write("app.json", R"({"name": "secrets", "components": [
  {"name": "builder", "library": "security_parts", "class": "Builder", "params": {"gate": ")" +
                                     gate().string() + R"("}}
]})");
  }

  [[nodiscard]] fs::path gate() const { return work() / "gate"; }
};

TEST_F(SecurityOfTheTrial, AnAttackerWhoWatchesForItOftenWinsTheRace) {
  const std::string won =
      as_ordinary_user([&] { return trials_won(run({"--for", "20ms"}), gate()); });

  std::printf("the memory of %s of %d trials was read\n", won.c_str(), kLaunches);
  RecordProperty("won", won);
  EXPECT_TRUE(!won.empty() && won != "no trial was seen") << won;
}

TEST_F(SecurityOfTheTrial, NobodyWinsItAgainstProgramsThatTheUserCannotRead) {
  if (!is_root()) {
    GTEST_SKIP() << "only root can install a program that its user cannot read";
  }
  make_unreadable();

  EXPECT_EQ(as_ordinary_user([&] { return trials_won(run({"--for", "20ms"}), gate()); }), "0");
}

TEST_F(SecurityOfTheTrial, IsAsProtectedAsTheRun) {
  fs::create_directory(gate());
  fs::permissions(gate(), fs::perms(01777));
  Process victim(run({"--for", "20ms"}));
  const pid_t trial = find_child(victim, "fastcycle-trial");
  const std::string address = [&] {
    while (!fs::exists(gate() / std::to_string(trial)) && kill(trial, 0) == 0) {
      usleep(1000);
    }
    return read_file(gate() / std::to_string(trial));
  }();
  ASSERT_TRUE(address.starts_with("0x")) << victim.errors();

  const auto results = from_text(as_ordinary_user(
      [&] { return to_text(attack(trial, std::stoul(address, nullptr, 16), kSecret)); }));

  expect_refused(results);
  std::ofstream(gate() / "go") << "\n";
}

}  // namespace
}  // namespace fastcycle::test
