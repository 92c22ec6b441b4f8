// Component libraries of which an application says the contents: others are refused, whatever they
// are called, and before any code of theirs runs.

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "fastcycle/version.h"
#include "process/process.h"

namespace fastcycle::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

/// An application with a library of its own beside it, and of those that are built here.
class PinnedLibraries : public ::testing::Test {
 protected:
  PinnedLibraries() {
    std::filesystem::copy_file(
        std::filesystem::path(FASTCYCLE_BROKEN_LIBRARIES) / "libbroken_start_marker.so",
        folder_ / "libown.so");
    folder_.write("app.json", R"({"name": "pinned", "components": [
      {"name": "talker", "library": "examples/hello_talker", "serve_period_ms": 10},
      {"name": "own", "library": "own"}]})");
  }

  struct Ended {
    int code = 0;
    std::string output;
    std::string errors;
  };
  [[nodiscard]] Ended call(const std::vector<std::string>& words) const {
    Process process({.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()});
    const int code = process.wait().exit_code;
    return {code, process.output(), process.errors()};
  }
  /// What pins the libraries as they are.
  [[nodiscard]] json pins() const {
    const Ended checked = call({"check", "app.json", "--print-pins"});
    EXPECT_EQ(checked.code, 0) << checked.errors;
    return json::parse(checked.output, nullptr, false);
  }
  [[nodiscard]] Ended run(const json& overlay) const {
    folder_.write("pins.json", overlay.dump());
    std::vector<std::string> words{"run", "app.json", "--overlay", "pins.json", "--for", "50ms"};
    if (std::string_view(FASTCYCLE_SANITIZER) != "none") {
      words.emplace_back("--debuggable");
    }
    return call(words);
  }

  Folder folder_;
};

TEST_F(PinnedLibraries, RunWithAllThatTheyNeed) {
  const json overlay = pins();
  const json& sums = overlay["libraries"]["sha256"];
  for (const char* name : {"own", "examples/hello_talker"}) {
    EXPECT_EQ(sums[name].get<std::string>().size(), 64U) << overlay;
  }
  EXPECT_GT(sums.size(), 2U) << overlay;  // The messages of the talker.

  const Ended ended = run(overlay);

  EXPECT_EQ(ended.code, 0) << ended.errors;
}

TEST_F(PinnedLibraries, AreAlsoThoseOfShadows) {
  folder_.write("app.json", R"({"name": "pinned", "components": [
      {"name": "talker", "library": "examples/hello_talker", "serve_period_ms": 10}],
      "shadow": [{"of": "talker", "library": "own"}]})");

  EXPECT_TRUE(pins()["libraries"]["sha256"].contains("own")) << pins();
}

TEST_F(PinnedLibraries, AreRefusedWithOtherContents) {
  const json overlay = pins();
  folder_.write("libown.so", read_file(folder_ / "libown.so") + "x");

  const Ended ended = run(overlay);

  EXPECT_EQ(ended.code, 2);
  EXPECT_THAT(ended.errors, HasSubstr("library \"own\" has other contents than are pinned"));
  EXPECT_THAT(ended.errors, HasSubstr(overlay["libraries"]["sha256"]["own"].get<std::string>()));
  EXPECT_THAT(ended.errors, HasSubstr("pins.json"));
}

TEST_F(PinnedLibraries, AreRefusedWhereNothingIsSaidOfThem) {
  json overlay = pins();
  overlay["libraries"]["sha256"].erase("own");

  const Ended ended = run(overlay);

  EXPECT_EQ(ended.code, 2);
  EXPECT_THAT(ended.errors, HasSubstr("library \"own\" is not among those that may be loaded"));
}

TEST_F(PinnedLibraries, AreRefusedWithOneThatTheyNeedAndThatIsNotSaid) {
  json overlay = pins();
  for (const auto& [name, sum] : overlay["libraries"]["sha256"].items()) {
    if (name.starts_with("libfastcycle_example_messages")) {
      overlay["libraries"]["sha256"].erase(name);
      break;
    }
  }

  const Ended ended = run(overlay);

  EXPECT_EQ(ended.code, 2);
  EXPECT_THAT(ended.errors, HasSubstr("is not among those that may be loaded"));
}

}  // namespace
}  // namespace fastcycle::test
