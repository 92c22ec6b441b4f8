// Configurations with an error, as somebody meets them who calls the program: those of
// tests/config/broken, and those that cannot be kept as a file.

#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "expectation.h"
#include "process/process.h"

namespace fastcycle::test {
namespace {

namespace fs = std::filesystem;

const fs::path kCases = fs::path(FASTCYCLE_SOURCE_FOLDER) / "tests/config/broken";

/// What `fastcycle check app.json` says in `folder`, which must be a refusal.
std::vector<std::string> refusal_in(const fs::path& folder,
                                    const std::vector<std::string>& more = {}) {
  ProcessOptions options{
      .program = FASTCYCLE_PROGRAM, .arguments = {"check", "app.json"}, .folder = folder};
  options.arguments.insert(options.arguments.end(), more.begin(), more.end());
  Process process(options);
  const Ending& ending = process.wait();

  EXPECT_FALSE(ending.was_too_late);
  EXPECT_EQ(ending.exit_code, 2) << process.errors();
  std::vector<std::string> said = lines_of(std::istringstream(process.errors()));
  EXPECT_TRUE(!said.empty() && said.back().ends_with("; nothing was started")) << process.errors();
  return said;
}

class BrokenConfiguration : public testing::TestWithParam<std::string> {};

TEST_P(BrokenConfiguration, IsRefusedByCheckWithEveryErrorNamed) {
  const fs::path folder = kCases / GetParam();

  const std::vector<std::string> said = refusal_in(folder, lines_of(folder / "arguments.txt"));

  for (const std::string& part : lines_of(folder / "expected.txt")) {
    EXPECT_TRUE(std::ranges::any_of(
        said, [&](const auto& line) { return line.find(part) != std::string::npos; }))
        << part << "\n"
        << testing::PrintToString(said);
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, BrokenConfiguration, testing::ValuesIn(folders_in(kCases)),
                         [](const auto& name) { return name.param; });

struct MadeFile {
  const char* name;
  std::function<void(const Folder& folder)> make;
  const char* expected;
};

void PrintTo(const MadeFile& file, std::ostream* stream) {
  *stream << file.name;
}

class MadeConfiguration : public testing::TestWithParam<MadeFile> {};

TEST_P(MadeConfiguration, IsRefusedByCheck) {
  const Folder folder;
  GetParam().make(folder);

  const std::vector<std::string> said = refusal_in(folder.path());

  EXPECT_TRUE(any_contains(said, GetParam().expected)) << testing::PrintToString(said);
}

std::string repeated(std::string_view piece, std::size_t count) {
  std::string text;
  text.reserve(piece.size() * count);
  for (std::size_t i = 0; i < count; ++i) {
    text += piece;
  }
  return text;
}

/// An application that holds `value`.
void write_value(const Folder& folder, const std::string& value) {
  folder.write("app.json", "{\"name\": \"a\", \"shared_params\": {\"value\": " + value +
                               "}, \"components\": []}");
}

const MadeFile kMadeFiles[] = {
    {"Nothing", [](const Folder&) {}, "app.json…No such file or directory"},
    {"AFolder", [](const Folder& folder) { fs::create_directory(folder / "app.json"); },
     "it is a folder"},
    {"AFifo", [](const Folder& folder) { mkfifo((folder / "app.json").c_str(), 0600); },
     "it is not a regular file"},
    {"ADevice", [](const Folder& folder) { fs::create_symlink("/dev/zero", folder / "app.json"); },
     "it is not a regular file"},
    {"ALinkToItself",
     [](const Folder& folder) { fs::create_symlink("app.json", folder / "app.json"); },
     "Too many levels of symbolic links"},
    {"MoreThan16MiB",
     [](const Folder& folder) {
       fs::resize_file(folder.write("app.json", "{}"), 16 * 1024 * 1024 + 1);
     },
     "it is larger than 16 MiB"},
    {"MillionsOfBrackets",
     [](const Folder& folder) { folder.write("app.json", repeated("[", 4'000'000)); },
     "nested deeper than 64"},
    {"MillionsOfObjects",
     [](const Folder& folder) { folder.write("app.json", repeated("{\"a\":", 2'000'000)); },
     "nested deeper than 64"},
    {"Utf32",
     [](const Folder& folder) { folder.write("app.json", std::string("{\0\0\0}\0\0\0", 8)); },
     "app.json:1:"},
    {"Latin1",
     [](const Folder& folder) {
       write_value(folder,
                   "\"Stra\xdf"
                   "e\"");
     },
     "app.json:1:"},
    {"AHugeNumber", [](const Folder& folder) { write_value(folder, '1' + repeated("0", 400)); },
     "app.json:1:"},
    {"AHugeExponent", [](const Folder& folder) { write_value(folder, "1e99999999999"); },
     "is out of range"},
    {"ANumberOfAMillionDigits",
     [](const Folder& folder) { write_value(folder, repeated("9", 1'000'000)); }, "app.json:1:"},
};

INSTANTIATE_TEST_SUITE_P(Files, MadeConfiguration, testing::ValuesIn(kMadeFiles),
                         [](const auto& file) { return std::string(file.param.name); });

}  // namespace
}  // namespace fastcycle::test
