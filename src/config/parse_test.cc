#include "config/parse.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/utf8.h"
#include "config/test_folder.h"

namespace fastcycle::config {
namespace {

std::string problem_of(const std::filesystem::path& file) {
  Problems problems;
  EXPECT_FALSE(parse_file(file, {}, problems));
  return text_of(problems);
}

std::string problem_of_text(std::string_view text) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});
  EXPECT_FALSE(parse(text, source, problems));
  return text_of(problems);
}

TEST(ReadFile, FolderIsNoFile) {
  const TestFolder folder;

  const std::string problem = problem_of(folder.path());

  EXPECT_NE(problem.find("it is a folder"), std::string::npos) << problem;
}

TEST(ReadFile, FifoIsRefusedWithoutWaiting) {
  const TestFolder folder;
  const auto fifo = folder / "app.json";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);

  const std::string problem = problem_of(fifo);

  EXPECT_NE(problem.find("it is not a regular file"), std::string::npos) << problem;
}

TEST(ReadFile, DeviceIsRefused) {
  const std::string problem = problem_of("/dev/zero");

  EXPECT_NE(problem.find("it is not a regular file"), std::string::npos) << problem;
}

TEST(ReadFile, FileWithoutPermissionIsNamed) {
  if (::geteuid() == 0) {
    GTEST_SKIP() << "root may read everything";
  }
  const TestFolder folder;
  const auto file = folder.write("app.json", "{}");
  ASSERT_EQ(::chmod(file.c_str(), 0), 0);

  const std::string problem = problem_of(file);

  EXPECT_NE(problem.find("Permission denied"), std::string::npos) << problem;
}

TEST(ReadFile, MissingFileIsReportedWhereItIsAskedFor) {
  Problems problems;

  EXPECT_FALSE(read_file("/nowhere/a.json", {"app.json", 7, "/include/0/file"}, problems));

  EXPECT_EQ(text_of(problems),
            "app.json:7: /include/0/file: cannot read \"/nowhere/a.json\": "
            "No such file or directory\n");
}

TEST(ReadFile, FileThatIsTooLargeIsNotRead) {
  const TestFolder folder;
  const auto file = folder.write("app.json", "{}");
  std::filesystem::resize_file(file, kMaxFileBytes + 1);

  const std::string problem = problem_of(file);

  EXPECT_NE(problem.find("it is larger than 16 MiB"), std::string::npos) << problem;
}

TEST(ReadFile, FileThatLoopsBackIsNamed) {
  const TestFolder folder;
  std::filesystem::create_symlink("app.json", folder / "app.json");

  const std::string problem = problem_of(folder / "app.json");

  EXPECT_NE(problem.find("Too many levels of symbolic links"), std::string::npos) << problem;
}

TEST(Parse, CommentsAreAllowed) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});

  const auto value = parse("// one\n{\"a\": /* two */ 1} // three\n", source, problems);

  EXPECT_EQ(value->to_text(), R"({"a":1})");
  EXPECT_FALSE(problems.has_errors());
}

TEST(Parse, SixtyFourLevelsAreAllowedAndNoMore) {
  const std::string fits = std::string(64, '[') + std::string(64, ']');
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});

  EXPECT_TRUE(parse(fits, source, problems));

  EXPECT_NE(problem_of_text('[' + fits + ']').find("nested deeper than 64"), std::string::npos);
}

TEST(Parse, MillionsOfBracketsAreNoDanger) {
  const std::string problem = problem_of_text(std::string(4'000'000, '['));

  EXPECT_NE(problem.find("nested deeper than 64"), std::string::npos) << problem;
}

TEST(Parse, ValuesAndKeysAreCounted) {
  std::string values = "[1";
  for (std::size_t i = 0; i < kMaxValues; ++i) {
    values += ",1";
  }
  std::string keys = "{\"a\": 0";
  for (std::size_t i = 0; i < kMaxKeysOfObject; ++i) {
    keys += ",\"k" + std::to_string(i) + "\": 0";
  }

  EXPECT_NE(problem_of_text(values + ']').find("more than a million values"), std::string::npos);
  EXPECT_NE(problem_of_text(keys + '}').find("more than 10000 keys"), std::string::npos);
}

TEST(Parse, OfAKeyThatIsGivenTwiceTheFirstStands) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});

  const auto value = parse("{\"a\": 1,\n\"a\": {\"b\": 2}, \"c\": 3}", source, problems);

  EXPECT_EQ(value->to_text(), R"({"a":1,"c":3})");
  EXPECT_EQ(text_of(problems), "app.json:2: /a: the key \"a\" is given twice, first in line 1\n");
}

TEST(Parse, LinesAreRightBehindNumbersAtTheEndOfALine) {
  Problems problems;
  const auto source = std::make_shared<const Source>(Source{"app.json", "", true});

  const auto value = parse("[\n1\n,\n2.5\n,\ntrue\n,\n\"x\"\n]", source, problems);

  EXPECT_EQ((*value)[0].place().line, 2);
  EXPECT_EQ((*value)[1].place().line, 4);
  EXPECT_EQ((*value)[2].place().line, 6);
  EXPECT_EQ((*value)[3].place().line, 8);
}

TEST(Parse, Utf8IsTakenStrictly) {
  EXPECT_TRUE(base::is_utf8("aü€😀"));
  EXPECT_FALSE(base::is_utf8("\xC0\xAF"));          // Overlong.
  EXPECT_FALSE(base::is_utf8("\xED\xA0\x80"));      // A surrogate.
  EXPECT_FALSE(base::is_utf8("\xF4\x90\x80\x80"));  // Beyond the last character.
  EXPECT_FALSE(base::is_utf8("\xE2\x82"));          // Cut off.
}

TEST(ParseOption, TextThatIsNoJsonIsAString) {
  EXPECT_EQ(parse_option("20", "--set a.b=20").as_int64(), 20);
  EXPECT_EQ(parse_option("[1, 2]", "--set a.b=[1, 2]").size(), 2U);
  EXPECT_EQ(parse_option("fast", "--set a.b=fast").as_string(), "fast");
  EXPECT_EQ(parse_option("", "--set a.b=").as_string(), "");
  EXPECT_EQ(parse_option("1.2.3", "--set a.b=1.2.3").as_string(), "1.2.3");
}

}  // namespace
}  // namespace fastcycle::config
