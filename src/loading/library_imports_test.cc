#include "loading/library_imports.h"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::host {
namespace {

namespace fs = std::filesystem;

/// This program wants it from the C library, so that there is a file that does.
[[maybe_unused]] int (*const volatile chance)() = &std::rand;

/// A folder with this program under the name of a library.
class LibraryImports : public ::testing::Test {
 protected:
  LibraryImports() {
    std::string name = (fs::temp_directory_path() / "fastcycle-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    fs::create_symlink(fs::read_symlink("/proc/self/exe"), folder_ / "libdice.so");
  }
  ~LibraryImports() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(LibraryImports, AreReadFromTheFileWithoutLoadingIt) {
  const std::vector<std::string> names = imported_functions(folder_ / "libdice.so");

  EXPECT_NE(std::ranges::find(names, "rand"), names.end());
  EXPECT_EQ(std::ranges::find(names, "lrand48"), names.end());
}

TEST_F(LibraryImports, OfWhatIsNoLibraryAreNone) {
  EXPECT_TRUE(imported_functions(folder_).empty());
  EXPECT_TRUE(imported_functions(folder_ / "missing").empty());
  EXPECT_TRUE(imported_functions("/proc/self/status").empty());
}

TEST_F(LibraryImports, ThatMakeARunUnrepeatableAreWarnedOfOnceForEachLibrary) {
  config::ApplicationDescription description;
  for (const std::string name : {"first", "second"}) {
    config::ComponentDescription& component = description.components.emplace_back();
    component.name = name;
    component.library = "dice";
    component.place = {"app.json", 3, "/components/" + name};
  }
  config::Problems problems;

  warn_of_imports(description, LibraryLoader({folder_}), problems);

  EXPECT_FALSE(problems.has_errors());
  std::vector<std::string> found;
  for (const config::Problem& problem : problems.all()) {
    EXPECT_TRUE(problem.warning);
    if (problem.message.find("random numbers") != std::string::npos) {
      found.push_back(config::to_string(problem));
    }
  }
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NE(found[0].find("/components/first"), std::string::npos) << found[0];
  EXPECT_NE(found[0].find("(rand)"), std::string::npos) << found[0];
  EXPECT_NE(found[0].find("context.random()"), std::string::npos) << found[0];
}

}  // namespace
}  // namespace fastcycle::host
