// Damaged files: whatever stands in them, loading ends soon, and either takes them or says why not.

#include <random>
#include <string>

#include <gtest/gtest.h>

#include "config/compose.h"
#include "config/describe.h"
#include "config/parse.h"
#include "config/print.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

constexpr std::string_view kGood = R"({
  "name": "demo", "variables": {"data": "maps", "port": 2368}, "library_path": ["lib"],
  "include": [{"file": "lidar.json", "namespace": "front", "variables": {"rate": 10}}],
  "executors": [{"name": "fast", "threads": 1, "cpus": [1], "policy": "fifo", "priority": 80}],
  "processes": [{"name": "sensing", "cpus": [0], "memory_mb": 512, "on_exit": "restart",
                 "restart": {"limit": 2}, "sandbox": {"read": ["p.json"]}, "trusted": true}],
  "topics": {"planning/speed": {"latched": 1, "ages": true, "pool_max": 64}},
  "shared_params": {"width_m": 2.0}, "on_fault": "stop", // A comment.
  "components": [
    {"name": "limiter", "library": "speed_limiter", "executor": "fast", "serve_period_ms": 10,
     "params": {"map": "${data}/town.osm", "limits": {"jerk": [1, -2, 3.5e3]}, "p": "${port}"},
     "subscribers": {"planning/speed": {"depth": 4, "overflow": "drop_oldest"}}},
    {"name": "planner", "library": "p", "process": "sensing", "remap": {"goal": "/mission/goal"}, "file": "p.json"}
  ]
})";

// Sanitizers find more in each round, and take twenty times as long for it.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int kRounds = 1'000;
#else
constexpr int kRounds = 20'000;
#endif

constexpr std::string_view kPieces[] = {"{",
                                        "}",
                                        "[",
                                        "]",
                                        ",",
                                        ":",
                                        "\"",
                                        "null",
                                        "true",
                                        "-",
                                        "1e999",
                                        "99999999999999999999",
                                        "${",
                                        "$${",
                                        "}",
                                        "//",
                                        "/*",
                                        "*/",
                                        "\\",
                                        "\\u0000",
                                        "\\ud800",
                                        "\xff",
                                        "\xEF\xBB\xBF",
                                        "\"name\"",
                                        "\"components\"",
                                        "\"file\": \"app.json\",",
                                        "\"namespace\": \"a\",",
                                        "\n",
                                        "0",
                                        "[[[[[[[["};

class Damage {
 public:
  explicit Damage(unsigned seed) : random_(seed) {}

  std::string damaged(std::string text) {
    for (std::size_t i = 0, count = 1 + below(4); i < count && !text.empty(); ++i) {
      damage_once(text);
    }
    return text;
  }

  std::string noise() {
    std::string text(below(200), ' ');
    for (char& c : text) {
      c = static_cast<char>(below(256));
    }
    return text;
  }

 private:
  std::size_t below(std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(0, end - 1)(random_);
  }

  void damage_once(std::string& text) {
    const std::size_t at = below(text.size());
    switch (below(6)) {
      case 0:
        text[at] = static_cast<char>(below(256));
        break;
      case 1:
        text.erase(at, 1 + below(20));
        break;
      case 2:
        text.insert(at, kPieces[below(std::size(kPieces))]);
        break;
      case 3:
        text.insert(at, text.substr(below(text.size()), below(60)));
        break;
      case 4:
        text.resize(at);
        break;
      default:
        std::swap(text[at], text[below(text.size())]);
    }
  }

  std::mt19937 random_;
};

struct Robustness : testing::Test {
  // All that is done with a file: whatever survives has to be described and printed too.
  void load_text(const std::string& text) {
    const auto file = folder.write("app.json", text);
    Problems problems;
    const auto tree = Composer(schema, problems)
                          .compose({.file = file, .sets = {"limiter.x=1"}, .isolated = {"all"}});
    if (!tree) {
      EXPECT_TRUE(problems.has_errors()) << text;
      return;
    }
    check_sense(describe(*tree), problems);
    if (!problems.has_errors()) {
      Problems again;
      const auto source = std::make_shared<const Source>(Source{"printed.json", "", true});
      EXPECT_TRUE(parse(print(*tree), source, again)) << text_of(again) << text;
    }
    for (const Problem& problem : problems.all()) {
      EXPECT_EQ(to_string(problem).find('\n'), std::string::npos);
    }
  }

  void SetUp() override {
    folder.write("lidar.json", R"({"variables": {"rate": null}, "components": []})");
    folder.write("p.json", R"({"serve_period_ms": 100})");
  }

  TestFolder folder;
  Problems schema_problems;
  Schema schema{{}, schema_problems};
};

/// The same in every plain run; another one with --gtest_shuffle, for long runs.
unsigned run_seed() {
  return static_cast<unsigned>(::testing::UnitTest::GetInstance()->random_seed());
}

TEST_F(Robustness, GoodFileIsTaken) {
  Problems problems;

  (void)load({.file = folder.write("app.json", kGood)}, problems);

  EXPECT_EQ(text_of(problems), "");
}

TEST_F(Robustness, EveryBeginningOfAFileIsSurvived) {
  for (std::size_t length = 0; length < kGood.size(); ++length) {
    load_text(std::string(kGood.substr(0, length)));
  }
}

TEST_F(Robustness, ThousandsOfDamagedFilesAreSurvived) {
  Damage damage(1 + run_seed());
  for (int round = 0; round < kRounds; ++round) {
    load_text(damage.damaged(std::string(kGood)));
  }
}

TEST_F(Robustness, NoiseIsSurvived) {
  Damage damage(2 + run_seed());
  for (int round = 0; round < kRounds / 10; ++round) {
    load_text(damage.noise());
  }
}

}  // namespace
}  // namespace fastcycle::config
