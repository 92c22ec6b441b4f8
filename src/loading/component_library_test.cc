#include "loading/component_library.h"

#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>
#include <sys/stat.h>

namespace fastcycle::host {
namespace {

namespace fs = std::filesystem;

/// A folder that lasts as long as a test.
class Libraries : public ::testing::Test {
 protected:
  Libraries() {
    std::string name = (fs::temp_directory_path() / "fastcycle-XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~Libraries() override { fs::remove_all(folder_); }

  void write(const std::string& file, const std::string& content) const {
    std::ofstream(folder_ / file, std::ios::binary) << content;
  }

  /// What opening the library `name` says.
  std::string problem_of(const std::string& name) const {
    config::Problems problems;
    LibraryLoader loader({folder_});
    EXPECT_EQ(loader.open(name, {"app.json", 3, "/components/0"}, problems), nullptr);
    return problems.all().empty() ? "" : config::to_string(problems.all()[0]);
  }

  fs::path folder_;
};

TEST_F(Libraries, AMissingOneIsNamedWithWhereItWasLookedForAndTheNearestName) {
  write("libspeed_limiter.so", "");

  const std::string problem = problem_of("speed_limitter");

  EXPECT_NE(problem.find("app.json:3"), std::string::npos) << problem;
  EXPECT_NE(problem.find(folder_.string()), std::string::npos) << problem;
  EXPECT_NE(problem.find("did you mean \"speed_limiter\"?"), std::string::npos) << problem;
}

TEST_F(Libraries, OneInAFolderAnswersToItsWholeNameAlone) {
  fs::create_directory(folder_ / "ads");
  write("ads/libworld.so", "");

  const std::string problem = problem_of("world");

  EXPECT_NE(problem.find("no libworld.so in"), std::string::npos) << problem;
  EXPECT_NE(problem.find("did you mean \"ads/world\"?"), std::string::npos) << problem;
  EXPECT_NE(problem_of("ads/world").find("ads/libworld.so: not an ELF file"), std::string::npos);
  EXPECT_NE(problem_of("ads/word").find("did you mean \"ads/world\"?"), std::string::npos);
}

TEST_F(Libraries, OfManyFoldersTheFirstAreNamed) {
  std::vector<fs::path> folders;
  for (int i = 0; i < 100; ++i) {
    folders.emplace_back("p" + std::to_string(i));
  }
  config::Problems problems;

  EXPECT_EQ(LibraryLoader(folders).open("speed_limiter", {}, problems), nullptr);

  const std::string problem = config::to_string(problems.all().at(0));
  EXPECT_NE(problem.find("p14, p15 and 84 more"), std::string::npos) << problem;
}

TEST_F(Libraries, WhatIsNoLibraryIsNamed) {
  write("libempty.so", "");
  write("libtext.so", "#!/bin/sh\n");
  write("libcut.so", std::string("\177ELF\2\1\1", 7));
  fs::create_directory(folder_ / "libfolder.so");
  fs::create_symlink("nowhere", folder_ / "libdangling.so");
  mkfifo((folder_ / "libfifo.so").c_str(), 0600);

  EXPECT_NE(problem_of("empty").find("not an ELF file"), std::string::npos);
  EXPECT_NE(problem_of("text").find("not an ELF file"), std::string::npos);
  EXPECT_NE(problem_of("cut").find("not an ELF file"), std::string::npos);
  EXPECT_NE(problem_of("folder").find("not a regular file"), std::string::npos);
  EXPECT_NE(problem_of("dangling").find("No such file"), std::string::npos);
  EXPECT_NE(problem_of("fifo").find("not a regular file"), std::string::npos);
}

TEST_F(Libraries, OneThatWasTriedIsOpenedOnlyAsLongAsItIsThatFile) {
  const auto problem_with = [this](const LibraryFiles& tried) {
    config::Problems problems;
    LibraryLoader loader({folder_});
    loader.expect(tried);
    EXPECT_EQ(loader.open("speed", {}, problems), nullptr);
    return config::to_string(problems.all().at(0));
  };
  write("libspeed.so", "as it was tried");
  config::Problems ignored;
  LibraryLoader trial({folder_});
  EXPECT_EQ(trial.open("speed", {}, ignored), nullptr);
  EXPECT_NE(problem_with(trial.files()).find("not an ELF file"), std::string::npos);

  write("new.so", "as it was tried");
  fs::rename(folder_ / "new.so", folder_ / "libspeed.so");
  const std::string problem = problem_with(trial.files());
  EXPECT_NE(problem.find("library \"speed\" was exchanged or written since it was tried"),
            std::string::npos)
      << problem;
  EXPECT_NE(problem.find((folder_ / "libspeed.so").string()), std::string::npos) << problem;

  EXPECT_EQ(trial.open("speed", {}, ignored), nullptr);
  write("libspeed.so", "written anew");
  EXPECT_NE(problem_with(trial.files()).find("was exchanged"), std::string::npos);
}

TEST_F(Libraries, ALibraryWithoutANoteIsNoComponentLibrary) {
  fs::create_symlink(core_library_folder() / "libfastcycle.so", folder_ / "libcore.so");

  EXPECT_NE(problem_of("core").find("no component library"), std::string::npos);
}

TEST_F(Libraries, ALibraryCutShortAnywhereIsRefusedWithoutACrash) {
  std::ifstream whole(core_library_folder() / "libfastcycle.so", std::ios::binary);
  std::string bytes(4096, '\0');
  whole.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  for (std::size_t size = 0; size < bytes.size(); size += 13) {
    write("libpart.so", bytes.substr(0, size));

    EXPECT_FALSE(problem_of("part").empty()) << size;
  }
}

}  // namespace
}  // namespace fastcycle::host
