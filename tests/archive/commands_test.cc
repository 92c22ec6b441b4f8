#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/test_log.h"
#include "process/process.h"

namespace fastcycle::archive {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

/// Logs in a folder of their own, and what came of the last command.
class Commands : public ::testing::Test {
 protected:
  int run(const std::vector<std::string>& words) {
    test::Process process(
        {.program = FASTCYCLE_PROGRAM, .arguments = words, .folder = folder_.path()});
    const int exit_code = process.wait().exit_code;
    output_ = process.output();
    errors_ = process.errors();
    return exit_code;
  }
  /// A shell's command; $F is the program.
  int shell(const std::string& line) {
    test::Process process({.program = "/bin/bash",
                           .arguments = {"-c", "set -o pipefail; " + line},
                           .folder = folder_.path(),
                           .environment = {std::string("F=") + FASTCYCLE_PROGRAM}});
    const int exit_code = process.wait().exit_code;
    output_ = process.output();
    errors_ = process.errors();
    return exit_code;
  }
  void write(const std::string& name, const std::string& content) { folder_.write(name, content); }
  [[nodiscard]] std::string read(const std::string& name) const {
    return test::read_file(folder_ / name);
  }
  [[nodiscard]] bool exists(const std::string& name) const { return fs::exists(folder_ / name); }
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }

  test::Folder folder_;
  std::string output_;
  std::string errors_;
};

std::string damaged(std::string file) {
  const std::size_t chunk = mcap::find_record(file, mcap::Opcode::kChunk, 1);
  file[chunk + 80] = static_cast<char>(file[chunk + 80] ^ 1);
  return file;
}

std::string times(int count, const std::string& text) {
  std::string result;
  for (int i = 0; i < count; ++i) {
    result += text;
  }
  return result;
}

// ---- info ----

TEST_F(Commands, InfoTellsWhatIsInAFile) {
  write("a.mcap", good_log());

  EXPECT_EQ(run({"info", "a.mcap"}), 0) << errors_;

  EXPECT_THAT(output_, StartsWith("a.mcap\n  size "));
  EXPECT_THAT(output_, HasSubstr("  begin       1970-01-01T00:00:00.000000100Z\n"));
  EXPECT_THAT(output_, HasSubstr("  messages    12\n"));
  EXPECT_THAT(output_, HasSubstr("closed, all of it can be read"));
  EXPECT_THAT(output_, HasSubstr("demo.Scene"));
  EXPECT_THAT(output_, HasSubstr("a.txt"));
}

TEST_F(Commands, InfoOfASplitRecordingTellsTheGaps) {
  write("d_0001.mcap", scenes({"stamp: 1", "stamp: 2"}));
  write("d_0002.mcap.active", mcap::drive(mcap::small_chunks(), false));

  EXPECT_EQ(run({"info", "d.mcap", "--json"}), 0) << errors_;

  const json info = json::parse(output_);
  ASSERT_EQ(info["files"].size(), 2U);
  EXPECT_EQ(info["files"][0]["problem"], nullptr);
  EXPECT_THAT(info["files"][1]["problem"].get<std::string>(), HasSubstr("the end of the file"));
  EXPECT_EQ(info["files"][0]["topics"]["scene"]["messages"], 2);
  EXPECT_EQ(info["together"]["messages"], 14);
  EXPECT_EQ(info["together"]["gaps"][0]["ns"], -1010) << "from 1010 ns back to 0 ns";
}

TEST_F(Commands, InfoOfWhatIsNoLogSaysSo) {
  write("a.mcap", "no log at all");

  EXPECT_EQ(run({"info", "a.mcap"}), 1);
  EXPECT_THAT(errors_, HasSubstr("expected the magic bytes of MCAP"));
  EXPECT_EQ(run({"info", "b.mcap"}), 1);
  EXPECT_THAT(errors_, HasSubstr("b.mcap"));
  EXPECT_EQ(run({"info"}), 2);
}

// ---- echo ----

TEST_F(Commands, EchoPrintsMessagesByTheSchemasOfTheFile) {
  write("a.mcap", scenes({"name: 'a' origin { x: 1.5 }", "ranges: [1, 2]"}));

  EXPECT_EQ(run({"echo", "a.mcap"}), 0) << errors_;

  EXPECT_EQ(output_,
            "1970-01-01T00:00:00.000001000Z  scene  #1  painter\n"
            "  name: \"a\"\n"
            "  origin {\n"
            "    x: 1.5\n"
            "  }\n"
            "1970-01-01T00:00:00.000001010Z  scene  #2  painter\n"
            "  ranges: [1, 2]\n");
}

TEST_F(Commands, EchoTakesTopicsTimesAndACount) {
  write("a.mcap", good_log());

  EXPECT_EQ(run({"echo", "a.mcap", "camera/*", "--count", "2"}), 0) << errors_;
  const std::string hex = times(40, "63");
  EXPECT_EQ(output_, "1970-01-01T00:00:00.000000300Z  camera/front  #1\n  " + hex +
                         "\n1970-01-01T00:00:00.000000600Z  camera/front  #2\n  " + hex + "\n");
  EXPECT_EQ(run({"echo", "a.mcap", "--start", "1000ns", "--end", "1101ns"}), 0) << errors_;
  EXPECT_THAT(output_, StartsWith("1970-01-01T00:00:00.000001100Z  scene  #8  painter\n"));
  EXPECT_THAT(output_, HasSubstr("camera/front  #4"));
  EXPECT_EQ(run({"echo", "a.mcap", "walk/*"}), 1);
  EXPECT_THAT(errors_, HasSubstr("no topic of a.mcap matches walk/*"));
  EXPECT_EQ(run({"echo", "a.mcap", "--start", "soon"}), 2);
}

TEST_F(Commands, EchoOfALogThatIsCutInItsFirstChunkFails) {
  const std::string log = good_log();
  const std::size_t chunk = mcap::find_record(log, mcap::Opcode::kChunk, 0);
  write("a.mcap", log.substr(0, chunk + 40));

  EXPECT_EQ(run({"echo", "a.mcap"}), 1);
  EXPECT_EQ(output_, "");
  EXPECT_THAT(errors_, HasSubstr("a.mcap"));
  EXPECT_THAT(errors_, HasSubstr("expected at least one whole message before the file ends"));

  write("whole.mcap", log.substr(0, log.size() - 40));
  EXPECT_EQ(run({"echo", "whole.mcap"}), 0);
  EXPECT_THAT(errors_, HasSubstr("the messages before it are printed"));
}

TEST_F(Commands, EchoAsJsonIsOneObjectALine) {
  write("a.mcap", scenes({"image: '" + std::string(100, 'x') + "'", "stamp: 7"}));

  EXPECT_EQ(run({"echo", "a.mcap", "--json"}), 0) << errors_;

  std::istringstream lines(output_);
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  json message = json::parse(line);
  EXPECT_EQ(message["topic"], "scene");
  EXPECT_EQ(message["log_time_ns"], 1000);
  EXPECT_EQ(message["elided"][0], (json{{"field", "image"}, {"left_out", 100}}));
  ASSERT_TRUE(std::getline(lines, line));
  message = json::parse(line);
  EXPECT_EQ(message["data"], (json{{"stamp", "7"}}));
  EXPECT_FALSE(message.contains("elided"));
}

TEST_F(Commands, EchoEndsQuietlyWhenNobodyReadsAnyMore) {
  write("a.mcap",
        scenes(std::vector<std::string>(20'000, "name: 'one of very many messages'"), {}));

  EXPECT_EQ(shell("$F echo a.mcap | head -n 1"), 0);

  EXPECT_THAT(output_, HasSubstr("scene  #1"));
  EXPECT_THAT(errors_, IsEmpty());
}

// ---- export ----

TEST_F(Commands, ExportWritesTables) {
  write("a.mcap", good_log());

  EXPECT_EQ(run({"export", "a.mcap", "--topic", "scene", "-o", "scene.csv"}), 0) << errors_;
  EXPECT_THAT(read("scene.csv"),
              StartsWith("log_time_ns,publish_time_ns,sequence,name,image,kind,stamp\r\n"
                         "100,100,1,scene number 1,0,ROAD,1\r\n"));
  EXPECT_EQ(run({"export", "a.mcap", "--topic", "scene"}), 0) << errors_;
  EXPECT_EQ(output_, read("scene.csv"));
  EXPECT_EQ(run({"export", "a.mcap", "--topic", "scene", "-o", "scene.csv"}), 1);
  EXPECT_THAT(errors_, HasSubstr("--force"));
  EXPECT_EQ(run({"export", "a.mcap", "--topic", "scene", "--topic", "camera/front", "-o", "dir"}),
            1);
  EXPECT_TRUE(exists("dir/scene.csv"));
  EXPECT_FALSE(exists("dir/camera.front.csv")) << "it is no protobuf";
  EXPECT_EQ(run({"export", "a.mcap", "--topic", "a", "--topic", "b"}), 2);
}

// ---- convert, filter, merge, split ----

TEST_F(Commands, WholeGoesThroughPiecesAndBack) {
  write("a.mcap", good_log());

  EXPECT_EQ(run({"split", "a.mcap", "p", "--time", "300ns"}), 0) << errors_;
  EXPECT_TRUE(exists("p_0004.mcap"));
  EXPECT_FALSE(exists("p_0005.mcap"));
  EXPECT_EQ(run({"merge", "p_0001.mcap", "p_0002.mcap", "p_0003.mcap", "p_0004.mcap", "m.mcap",
                 "--compression", "zstd"}),
            0)
      << errors_;
  EXPECT_EQ(run({"convert", "m.mcap", "c.mcap", "--compression", "none", "--chunk-size", "1KiB"}),
            0)
      << errors_;

  EXPECT_EQ(content_of(read("c.mcap")), content_of(read("a.mcap")));
  EXPECT_EQ(run({"doctor", "c.mcap", "m.mcap", "p_0001.mcap"}), 0) << output_;
}

TEST_F(Commands, FilterKeepsTopicsAndTime) {
  write("a.mcap", good_log());

  EXPECT_EQ(run({"filter", "a.mcap", "b.mcap", "--topics", "camera/*", "--end", "600ns"}), 0)
      << errors_;

  EXPECT_EQ(mcap::only(content_of(read("b.mcap")), "Message").size(), 2U);
  EXPECT_EQ(run({"filter", "a.mcap", "c.mcap", "--start", "2s", "--end", "1s"}), 2);
}

TEST_F(Commands, OutputIsNeverAnInputNorReplacedUnasked) {
  write("a.mcap", good_log());
  write("b.mcap", "precious");

  EXPECT_EQ(run({"convert", "a.mcap", "a.mcap", "--force"}), 1);
  EXPECT_THAT(errors_, HasSubstr("expected another file than those that are read"));
  EXPECT_EQ(run({"convert", "a.mcap", "b.mcap"}), 1);
  EXPECT_THAT(errors_, HasSubstr("a name that is free"));
  EXPECT_EQ(read("b.mcap"), "precious");
  EXPECT_EQ(run({"convert", "a.mcap", "b.mcap", "--force"}), 0) << errors_;
  EXPECT_EQ(content_of(read("b.mcap")), content_of(read("a.mcap")));
  EXPECT_EQ(files(), 2);
}

TEST_F(Commands, DamagedInputLeavesNothingBehind) {
  write("a.mcap", damaged(good_log()));

  EXPECT_EQ(run({"convert", "a.mcap", "b.mcap"}), 1);

  EXPECT_THAT(errors_, HasSubstr("a.mcap: byte "));
  EXPECT_EQ(files(), 1);
}

TEST_F(Commands, ALogThatIsCutOffBeforeItsFirstMessageIsAnErrorAndLeavesNothing) {
  const std::string whole = good_log(mcap::small_chunks(mcap::Compression::kLz4));
  write("cut.mcap", whole.substr(0, mcap::find_record(whole, mcap::Opcode::kChunk, 0) + 40));
  write("empty.mcap", "");

  for (const char* const log : {"cut.mcap", "empty.mcap"}) {
    EXPECT_EQ(run({"convert", log, "b.mcap"}), 1) << log;
    EXPECT_THAT(errors_, HasSubstr(std::string(log) + ": "));
    EXPECT_EQ(run({"filter", log, "b.mcap", "--topics", "scene"}), 1) << log;
    EXPECT_EQ(run({"split", log, "b", "--time", "1s"}), 1) << log;
    EXPECT_EQ(run({"export", log, "--topic", "scene", "-o", "b.csv"}), 1) << log;
    EXPECT_EQ(run({"export", log, "--topic", "scene"}), 1) << log;
    EXPECT_EQ(output_, "");
  }
  EXPECT_EQ(files(), 2);
}

TEST_F(Commands, WrongWordsAreExitCodeTwo) {
  write("a.mcap", good_log());
  const std::vector<std::vector<std::string>> wrong{
      {"convert", "a.mcap"},
      {"convert", "a.mcap", "b.mcap", "--compression", "gzip"},
      {"convert", "a.mcap", "b.mcap", "--chunk-size", "big"},
      {"merge", "a.mcap"},
      {"split", "a.mcap", "p"},
      {"split", "a.mcap", "p", "--size", "0MB"},
      {"recover", "a.mcap", "b.mcap", "--compression", "x"},
      {"doctor", "--for", "1s", "c.mcap"}};
  for (const auto& words : wrong) {
    EXPECT_EQ(run(words), 2) << words[0];
    EXPECT_THAT(errors_, HasSubstr("fastcycle " + words[0]));
  }
  EXPECT_EQ(files(), 1);
}

// ---- recover, doctor ----

TEST_F(Commands, RecoverSaysWhatBecameOfAFile) {
  write("good.mcap", good_log());
  write("open.mcap.active", mcap::drive(mcap::small_chunks(), false));
  write("bad.mcap", damaged(good_log()));
  write("none.mcap", "no log at all, but some bytes");

  EXPECT_EQ(run({"recover", "good.mcap", "1.mcap"}), 0) << errors_;
  EXPECT_THAT(output_, HasSubstr("1.mcap: 12 messages, 1 attachments, 1 metadata, verified; lost: "
                                 "nothing"));
  EXPECT_EQ(run({"recover", "open.mcap.active", "2.mcap"}), 0) << errors_;
  EXPECT_THAT(errors_, HasSubstr("mended: open.mcap.active: "));
  EXPECT_EQ(run({"recover", "bad.mcap", "3.mcap"}), 3);
  EXPECT_THAT(errors_, HasSubstr("messages: bad.mcap: byte "));
  EXPECT_EQ(run({"doctor", "1.mcap", "3.mcap", "good.mcap"}), 0) << output_;
  EXPECT_EQ(run({"recover", "none.mcap", "4.mcap"}), 1);
  EXPECT_THAT(errors_, HasSubstr("nothing could be recovered from none.mcap"));
  EXPECT_FALSE(exists("4.mcap"));
  EXPECT_EQ(files(), 7);
}

TEST_F(Commands, RecoverCountsASecondLogInTheFileAsLost) {
  const std::string log = good_log();
  write("two.mcap", log + log);

  EXPECT_EQ(run({"recover", "two.mcap", "1.mcap"}), 3);

  const std::string bytes = std::to_string(log.size());
  EXPECT_THAT(errors_, HasSubstr(": expected the end of the file, found " + bytes +
                                 " more bytes, another log from byte " + bytes + " on"));
  EXPECT_THAT(errors_, HasSubstr("lost "));
  EXPECT_THAT(errors_, Not(HasSubstr("mended")));
  EXPECT_THAT(output_, HasSubstr("1.mcap: 12 messages"));
  EXPECT_THAT(output_, HasSubstr(" at 1 place, an unknown number of messages"));
}

TEST_F(Commands, DoctorNamesWhatIsWrong) {
  write("bad.mcap", damaged(good_log()));

  EXPECT_EQ(run({"doctor", "bad.mcap"}), 3);
  EXPECT_THAT(output_, HasSubstr("bad.mcap: byte "));
  EXPECT_THAT(output_, HasSubstr("Chunk: expected CRC "));
  EXPECT_EQ(run({"doctor", "--json", "bad.mcap"}), 3);
  const json finding = json::parse(output_.substr(0, output_.find('\n')));
  EXPECT_EQ(finding["record"], "Chunk");
  EXPECT_EQ(finding["severity"], "error");
  EXPECT_EQ(run({"doctor", "missing.mcap"}), 1);
}

TEST_F(Commands, ShippedFilesOfTheSuiteGoThroughAll) {
  std::size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(FASTCYCLE_TEST_DATA) / "mcap")) {
    if (entry.path().extension() != ".mcap") {
      continue;
    }
    const std::string file = entry.path().string();
    const std::string name = std::to_string(++count);
    EXPECT_EQ(run({"info", file}), 0) << errors_;
    EXPECT_EQ(run({"doctor", file}), 0) << output_;
    EXPECT_EQ(run({"echo", file}), 0) << errors_;
    EXPECT_EQ(run({"convert", file, name + "c.mcap"}), 0) << errors_;
    EXPECT_EQ(run({"recover", file, name + "r.mcap"}), 0) << errors_;
    EXPECT_EQ(content_of(read(name + "c.mcap")), content_of(read(name + "r.mcap")));
  }
  EXPECT_EQ(count, 12U);
}

}  // namespace
}  // namespace fastcycle::archive
