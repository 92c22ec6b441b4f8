// Predictions of the component `prediction` beside constant velocity, for the scenarios that are
// named.

#include <algorithm>
#include <exception>
#include <filesystem>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "evaluation.h"

namespace {

constexpr const char* kHelp =
    R"(Predicts the road users of CommonRoad scenarios, and compares with where they were then.

  evaluate_prediction FILE_OR_FOLDER...

Prints a table by kind of road and time ahead, with the errors of straight on at constant speed beside.
)";

std::vector<std::filesystem::path> files_of(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    const std::filesystem::path path = argv[i];
    if (!std::filesystem::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(path)) {
      if (entry.path().extension() == ".xml") {
        files.push_back(entry.path());
      }
    }
  }
  std::ranges::sort(files);
  return files;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || std::string_view(argv[1]) == "--help") {
    fmt::print("{}", kHelp);
    return argc < 2 ? 2 : 0;
  }
  try {
    ads::PredictionScores scores;
    for (const auto& file : files_of(argc, argv)) {
      scores.add(ads::Scenario::read(file), {});
    }
    fmt::print("{}", scores.table());
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "evaluate_prediction: {}\n", error.what());
    return 1;
  }
}
