// Component libraries with an error: whatever they do when they are loaded or when their
// components are constructed, the program names them and starts nothing.
//
// Every folder of cases/ is one: `app.json`, `expected.txt` with the lines that have to be said
// ("…" stands for any text), and for some `arguments.txt`, one word a line.

#include <algorithm>
#include <iterator>
#include <sstream>
#include <string>
#include <tuple>
#include <vector>

#include <elf.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "expectation.h"
#include "process/process.h"

namespace fastcycle::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kCases = fs::path(FASTCYCLE_SOURCE_FOLDER) / "tests/libraries/cases";
const fs::path kLibraries = FASTCYCLE_BROKEN_LIBRARIES;

/// Leak detection needs a process that can be traced, which the program is not.
#if defined(__SANITIZE_ADDRESS__)
const std::vector<std::string> kEnvironment = {"ASAN_OPTIONS=detect_leaks=0"};
#else
const std::vector<std::string> kEnvironment = {};
#endif

/// A good library, changed by `change`, as another library beside the application.
template <typename Change>
void make_library(const Folder& folder, const std::string& name, Change change) {
  std::string bytes = read_file(kLibraries / "libbroken_start_marker.so");
  change(bytes);
  folder.write("lib" + name + ".so", bytes);
}

template <typename T>
void overwrite(std::string& bytes, std::size_t offset, T value) {
  bytes.replace(offset, sizeof(T), reinterpret_cast<const char*>(&value), sizeof(T));
}

/// What is no library at all, or none for this machine.
void make_files(const Folder& folder) {
  folder.write("libmade_text.so", "INPUT(libbroken_start_marker.so)\n");
  make_library(folder, "made_truncated", [](std::string& bytes) { bytes.resize(4096); });
  make_library(folder, "made_32_bits", [](auto& bytes) { bytes[EI_CLASS] = ELFCLASS32; });
  make_library(folder, "made_object", [](auto& bytes) {
    overwrite<Elf64_Half>(bytes, offsetof(Elf64_Ehdr, e_type), ET_REL);
  });
  make_library(folder, "made_processor", [](auto& bytes) {
    overwrite<Elf64_Half>(bytes, offsetof(Elf64_Ehdr, e_machine), EM_S390);
  });
  fs::create_directory(folder / "libmade_folder.so");
  mkfifo((folder / "libmade_fifo.so").c_str(), 0600);
}

/// What is mentioned of what takes long; on a slow machine that may be anything.
bool is_notice(const std::string& line) {
  return line.starts_with("fastcycle: ") && line.find(" takes longer than 900 ms to ") != line.npos;
}

/// What the program said, and whether it ended as a program ends that starts nothing. Notices are
/// appended to `notices`.
std::vector<std::string> refusal_of(const Folder& folder, const std::string& command,
                                    const std::vector<std::string>& more,
                                    std::vector<std::string>* notices = nullptr) {
  ProcessOptions options{.program = FASTCYCLE_PROGRAM,
                         .arguments = {command, "app.json", "--library-path", kLibraries.string()},
                         .folder = folder.path(),
                         .environment = kEnvironment};
  options.arguments.insert(options.arguments.end(), more.begin(), more.end());
  Process process(options);
  const Ending& ending = process.wait();

  EXPECT_FALSE(ending.was_too_late);
  EXPECT_EQ(ending.signal, 0);
  EXPECT_EQ(ending.exit_code, 2) << process.errors();
  EXPECT_EQ(process.output(), "");
  EXPECT_FALSE(fs::exists(folder / "started"));
  std::vector<std::string> said = lines_of(std::istringstream(process.errors()));
  if (notices != nullptr) {
    std::ranges::copy_if(said, std::back_inserter(*notices), is_notice);
  }
  std::erase_if(said, is_notice);
  return said;
}

class BrokenLibrary : public testing::TestWithParam<std::tuple<std::string, const char*>> {};

TEST_P(BrokenLibrary, IsNamedAndNothingStarts) {
  const auto& [name, command] = GetParam();
  const Folder folder;
  make_files(folder);
  fs::copy(kCases / name / "app.json", folder.path());
  const std::vector<std::string> expected = lines_of(kCases / name / "expected.txt");

  std::vector<std::string> notices;
  const std::vector<std::string> said =
      refusal_of(folder, command, lines_of(kCases / name / "arguments.txt"), &notices);

  if (any_contains(said, " did not come back within ")) {
    EXPECT_TRUE(any_contains(notices, ", and may take 2 s")) << testing::PrintToString(notices);
  }
  // One line for each error, and the last one.
  ASSERT_EQ(said.size(), expected.size() + 1) << testing::PrintToString(said);
  for (const std::string& part : expected) {
    EXPECT_TRUE(any_contains(said, part)) << part << "\n" << testing::PrintToString(said);
  }
  EXPECT_EQ(said.back(), "app.json: 1 error; nothing was started");
}

INSTANTIATE_TEST_SUITE_P(Cases, BrokenLibrary,
                         testing::Combine(testing::ValuesIn(folders_in(kCases)),
                                          testing::Values("run", "check")),
                         [](const auto& name) {
                           return std::get<0>(name.param) + "_in_" + std::get<1>(name.param);
                         });

/// One application with the components of all cases, and what has to be said of them.
std::string all_cases(std::vector<std::string>& expected) {
  json components = json::array();
  for (const std::string& name : folders_in(kCases)) {
    const json application = json::parse(read_file(kCases / name / "app.json"));
    for (json component : application["components"]) {
      if (component["name"] != "start_marker") {
        component["name"] = name + "_" + component["name"].get<std::string>();
        components.push_back(std::move(component));
      }
    }
    for (std::string part : lines_of(kCases / name / "expected.txt")) {
      part.erase(0, part.find(": /components/"));
      part.erase(0, part.find(": ", 2));
      const std::string component = "component \"suspect\"";
      if (const auto at = part.find(component); at != std::string::npos) {
        part.replace(at, component.size(), "component \"" + name + "_suspect\"");
      }
      expected.push_back(part);
    }
  }
  components.push_back({{"name", "start_marker"}, {"library", "broken_start_marker"}});
  return json{{"name", "all"}, {"components", components}}.dump(1);
}

TEST(BrokenLibraries, AllOfOneApplicationAreNamedAtOnce) {
  const Folder folder;
  make_files(folder);
  std::vector<std::string> expected;
  folder.write("app.json", all_cases(expected));

  const std::vector<std::string> said = refusal_of(folder, "run", {"--load-timeout", "2s"});

  for (const std::string& part : expected) {
    EXPECT_TRUE(any_contains(said, part)) << part << "\n" << testing::PrintToString(said);
  }
  ASSERT_FALSE(said.empty());
  EXPECT_EQ(said.back(),
            "app.json: " + std::to_string(expected.size()) + " errors; nothing was started");
}

TEST(BrokenLibraries, OneWithoutPermissionIsNamed) {
  const Folder folder;
  folder.write("libsecret.so", "");
  chmod((folder / "libsecret.so").c_str(), 0);
  folder.write("app.json", R"({"name": "a", "components": [{"name": "a", "library": "secret"}]})");
  Process process({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"check", "app.json"},
                   .folder = folder.path(),
                   .environment = kEnvironment,
                   .is_ordinary_user = true});

  const Ending& ending = process.wait();

  if (ending.exit_code == 127) {
    GTEST_SKIP() << "root may read everything, and other users may not read the build folder";
  }
  EXPECT_EQ(ending.exit_code, 2);
  EXPECT_TRUE(contains(process.errors(),
                       "app.json:1: /components/0: library \"secret\"…"
                       "libsecret.so: Permission denied"))
      << process.errors();
}

/// The application of a library, or class, that may be loaded, with the marker of the start.
std::string application_of(const std::string& suspect) {
  return R"({"name": "good", "components": [
  {"name": "suspect", )" +
         suspect + R"(},
  {"name": "start_marker", "library": "broken_start_marker", "serve_period_ms": 5}
]})";
}

ProcessOptions good_run(const Folder& folder) {
  return {.program = FASTCYCLE_PROGRAM,
          .arguments = {"run", "app.json", "--library-path", kLibraries.string(), "--for", "100ms",
                        "--report", "report.json"},
          .folder = folder.path(),
          .environment = kEnvironment};
}

constexpr const char* kThrowing = R"("library": "broken_constructors", "class": "Throws")";

TEST(AConstructorThatThrows, IsAnErrorForCheck) {
  const Folder folder;
  folder.write("app.json", application_of(kThrowing));

  const std::vector<std::string> said = refusal_of(folder, "check", {});

  EXPECT_TRUE(any_contains(said,
                           "app.json:2: /components/0: component \"suspect\": its constructor "
                           "threw: the map has no roads"))
      << testing::PrintToString(said);
}

TEST(AConstructorThatThrows, IsAnErrorForCheckHoweverLongItsMessage) {
  const Folder folder;
  folder.write("app.json",
               application_of(R"("library": "broken_constructors", "class": "ThrowsMuch")"));

  const std::vector<std::string> said = refusal_of(folder, "check", {});

  EXPECT_TRUE(
      any_contains(said, "component \"suspect\": its constructor threw: no road from aaaa…a… ("))
      << testing::PrintToString(said);
  EXPECT_TRUE(any_contains(said, " bytes more)"));
  ASSERT_FALSE(said.empty());
  EXPECT_LT(said.front().size(), 10'000U);
}

TEST(AServeOfItsOwn, IsWarnedOfWhereNothingCallsIt) {
  const std::string suspect = R"("library": "broken_constructors", "class": "Serves")";
  for (const std::string period : {"", R"(, "serve_period_ms": 5)"}) {
    const Folder folder;
    folder.write("app.json", application_of(suspect + period));
    for (const std::string command : {"check", "run"}) {
      ProcessOptions options = good_run(folder);
      if (command == "check") {
        options.arguments = {"check", "app.json", "--library-path", kLibraries.string()};
      }
      Process process(options);

      EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
      EXPECT_EQ(contains(process.errors(),
                         "app.json:2: /components/0: warning: component \"suspect\": serve() of "
                         "its class Serves is never called, because the component has no "
                         "\"serve_period_ms\"; say how often it is called"),
                period.empty())
          << process.errors();
    }
  }
}

// As `fastcycle new app` lays it out: the application file, and a folder `build` beside it.
TEST(ASourceFile, FindsTheLibrariesInTheBuildFolderBesideItAndSaysWhichFileEachIs) {
  const Folder folder;
  fs::create_directory(folder / "build");
  fs::copy(kLibraries / "libbroken_start_marker.so", folder / "build");
  folder.write("app.json", R"({"name": "a", "components": [
  {"name": "a", "library": "broken_start_marker"}, {"name": "b", "library": "broken_start_marker"}]})");
  for (const std::string option : {"-v", "--verbose"}) {
    Process process({.program = FASTCYCLE_PROGRAM,
                     .arguments = {"run", "app.json", "--for", "50ms", "--quiet", option},
                     .folder = folder.path(),
                     .environment = kEnvironment});

    EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
    const std::string line =
        "library \"broken_start_marker\": " + fs::canonical(folder.path()).string() +
        "/build/libbroken_start_marker.so\n";
    EXPECT_EQ(process.errors().find(line),
              process.errors().rfind("library \"broken_start_marker\""))
        << process.errors();
  }
}

TEST(AConstructorThatThrows, IsAFaultOfItsComponentForRun) {
  const Folder folder;
  folder.write("app.json", application_of(kThrowing));
  Process process(good_run(folder));

  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
  EXPECT_NE(process.errors().find("the map has no roads"), std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "started"));
}

TEST(AConstructorThatThrows, EndsTheRunIfThatIsThePolicy) {
  const Folder folder;
  folder.write("app.json", application_of(std::string(kThrowing) + R"(, "on_fault": "stop")"));
  Process process(good_run(folder));

  EXPECT_EQ(process.wait().exit_code, 1) << process.errors();
  EXPECT_NE(process.errors().find("the map has no roads"), std::string::npos);
}

TEST(ALibraryThatFlushesSmallNumbersToZero, DoesSoForNobodyElse) {
#if !defined(__SSE2__)
  GTEST_SKIP() << "it sets the mode of SSE";
#endif
  const Folder folder;
  folder.write("app.json", application_of(R"("library": "broken_fast_math")"));
  Process process(good_run(folder));

  ASSERT_EQ(process.wait().exit_code, 0) << process.errors();
  const json results = json::parse(read_file(folder / "report.json"))["results"];
  EXPECT_EQ(results["kept_while_loading"], false) << "the library did not change the mode";
  EXPECT_EQ(results["kept_in_constructor"], true);
  EXPECT_EQ(results["kept_in_start"], true);
  EXPECT_EQ(results["kept_in_timer"], true);
}

TEST(ALibraryThatStartsAProcess, HoldsNothingUpAndLeavesNothingBehind) {
  const Folder folder;
  folder.write("app.json", application_of(R"("library": "broken_forks")"));
  Process process({.program = FASTCYCLE_PROGRAM,
                   .arguments = {"check", "app.json", "--library-path", kLibraries.string(),
                                 "--load-timeout", "10min"},
                   .folder = folder.path()});

  EXPECT_EQ(process.wait().exit_code, 0) << process.errors();
  // It was sent the signal that ends it, which takes a moment.
  for (int look = 0; look < 1000 && processes_of_session(process.pid()) > 0; ++look) {
    usleep(10'000);
  }
  EXPECT_EQ(processes_of_session(process.pid()), 0);
}

TEST(TheTrial, NeedsNoStandardStreams) {
  const Folder folder;
  folder.write("app.json", application_of(R"("library": "broken_fast_math")"));
  ProcessOptions options = good_run(folder);
  options.has_no_streams = true;
  Process process(options);

  EXPECT_EQ(process.wait().exit_code, 0);
  // Nothing that is printed went into a file that got the number of a stream.
  EXPECT_EQ(read_file(folder / "started"), "yes\n");
  EXPECT_TRUE(json::accept(read_file(folder / "report.json")));
}

TEST(TheTrial, IsGivenMoreOptionsThanOneArgumentHolds) {
  const Folder folder;
  folder.write("app.json", application_of(R"("library": "broken_fast_math")"));
  ProcessOptions options = good_run(folder);
  for (int i = 0; i < 3000; ++i) {
    options.arguments.emplace_back("--set");
    options.arguments.push_back("suspect.text=" + std::string(60, 'a'));
  }
  Process process(options);

  process.wait();

  // The component has no such parameter, which only the trial can detect.
  EXPECT_TRUE(contains(process.errors(), "text…; nothing was started")) << process.errors();
  EXPECT_EQ(process.errors().find("could not be started"), std::string::npos) << process.errors();
}

TEST(LoadTimeout, MustBeATime) {
  const Folder folder;
  folder.write("app.json", application_of(R"("library": "broken_start_marker")"));
  for (const char* text : {"2", "soon", "-1s", "0s"}) {
    Process process({.program = FASTCYCLE_PROGRAM,
                     .arguments = {"check", "app.json", "--load-timeout", text},
                     .folder = folder.path()});

    EXPECT_EQ(process.wait().exit_code, 2) << text;
    EXPECT_TRUE(contains(process.errors(), "--load-timeout…expects a time above zero"))
        << process.errors();
  }
}

}  // namespace
}  // namespace fastcycle::test
