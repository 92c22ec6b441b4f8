// Every folder of tests/config/broken is an application with an error, and what has to be said of
// it.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "config/load.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

const std::filesystem::path kCases =
    std::filesystem::path(FASTCYCLE_SOURCE_FOLDER) / "tests/config/broken";

std::vector<std::string> all_cases() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(kCases)) {
    names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

LoadOptions options_of(const std::filesystem::path& folder) {
  LoadOptions options{.file = folder / "app.json"};
  const std::vector<std::string> words = lines_of(folder / "arguments.txt");
  for (std::size_t i = 0; i + 1 < words.size(); i += 2) {
    if (words[i] == "--overlay") {
      options.overlays.push_back(folder / words[i + 1]);
    } else {
      (words[i] == "--set"       ? options.sets
       : words[i] == "--isolate" ? options.isolated
                                 : options.variables)
          .push_back(words[i + 1]);
    }
  }
  return options;
}

// What the tool would print in the case's own folder.
std::string without_folder(std::string text, const std::string& folder) {
  for (std::size_t at = text.find(folder); at != std::string::npos; at = text.find(folder, at)) {
    text.erase(at, folder.size());
  }
  return text;
}

class BrokenConfiguration : public testing::TestWithParam<std::string> {};

TEST_P(BrokenConfiguration, HasTheExpectedErrorsAndNoOthers) {
  const std::filesystem::path folder = kCases / GetParam();
  const std::vector<std::string> expected = lines_of(folder / "expected.txt");
  Problems problems;

  (void)load(options_of(folder), problems);

  EXPECT_TRUE(problems.has_errors());
  std::vector<std::string> found;
  for (const Problem& problem : problems.all()) {
    found.push_back(without_folder(to_string(problem), folder.string() + '/'));
  }
  const auto is_in = [](const std::string& line, const std::string& part) {
    return line.find(part) != std::string::npos;
  };
  for (const std::string& part : expected) {
    EXPECT_TRUE(std::ranges::any_of(found, [&](const auto& line) { return is_in(line, part); }))
        << "not found: " << part << "\n"
        << text_of(problems);
  }
  for (const std::string& line : found) {
    EXPECT_TRUE(std::ranges::any_of(expected, [&](const auto& part) { return is_in(line, part); }))
        << "not expected: " << line;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, BrokenConfiguration, testing::ValuesIn(all_cases()),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace fastcycle::config
