#include "loading/pinned_libraries.h"

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

namespace fastcycle::host {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// FIPS 180-2, appendix B.1.
constexpr const char* kSumOfAbc =
    "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

/// A file that holds "abc".
class APinnedLibrary : public ::testing::Test {
 protected:
  APinnedLibrary() {
    std::string name = (fs::temp_directory_path() / "fastcycle-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    file_ = folder_ / "libabc.so";
    std::ofstream(file_) << "abc";
  }
  ~APinnedLibrary() override { fs::remove_all(folder_); }

  /// What opening it says where "abc" is to have `sum`.
  [[nodiscard]] std::string problem_with(const std::string& name, const std::string& sum) const {
    config::LibrariesDescription pins;
    pins.sha256[name] = sum;
    pins.place = {"app.json", 3, "/libraries"};
    config::Problems problems;
    EXPECT_EQ(PinnedLibraries(pins).open("abc", file_, problems), nullptr);
    EXPECT_THAT(problems.all(), SizeIs(1));
    return problems.all().empty() ? "" : config::to_string(problems.all()[0]);
  }

  fs::path folder_;
  fs::path file_;
};

TEST_F(APinnedLibrary, HasTheSumOfTheStandard) {
  EXPECT_EQ(sha256_of(file_), kSumOfAbc);
  EXPECT_EQ(sha256_of(folder_ / "missing"), "");
  EXPECT_EQ(sha256_of(folder_), "");
}

TEST_F(APinnedLibrary, IsLookedAtBeforeItIsLoaded) {
  const std::string other(64, '0');
  const std::string refused = problem_with("abc", other);
  EXPECT_THAT(refused, HasSubstr("app.json:3: /libraries"));
  EXPECT_THAT(refused, HasSubstr("other contents than are pinned"));
  EXPECT_THAT(refused, HasSubstr(other));
  EXPECT_THAT(refused, HasSubstr(kSumOfAbc));

  // With the right one it comes to the loader, which finds that it is none.
  EXPECT_THAT(problem_with("abc", kSumOfAbc), HasSubstr("cannot be loaded"));
}

TEST(AFileInMemory, IsSealedOnceTheKernelHoldsNoneOfItsPagesAnyMore) {
  const int file = memfd_create("pages", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  int ends[2] = {};
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  ASSERT_EQ(write(file, "page", 4), 4);
  loff_t offset = 0;
  ASSERT_EQ(splice(file, &offset, ends[1], nullptr, 4, 0), 4);  // The pipe holds the page now.
  if (fcntl(file, F_ADD_SEALS, F_SEAL_WRITE) == 0) {
    GTEST_SKIP() << "this kernel copies what is spliced";
  }
  ASSERT_EQ(errno, EBUSY);

  std::thread reader([end = ends[0]] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // Longer than the kernel waits.
    char text[4];
    EXPECT_EQ(read(end, text, 4), 4);
  });
  EXPECT_TRUE(seal(file));
  reader.join();

  EXPECT_NE(fcntl(file, F_GET_SEALS) & F_SEAL_WRITE, 0);
  close(file);
  close(ends[0]);
  close(ends[1]);
}

TEST_F(APinnedLibrary, MustBeNamed) {
  EXPECT_THAT(problem_with("abd", kSumOfAbc),
              HasSubstr("\"abc\" is not among those that may be loaded"));
}

TEST_F(APinnedLibrary, ThatIsGoneIsNamedWithTheReason) {
  fs::remove(file_);
  EXPECT_THAT(problem_with("abc", kSumOfAbc), HasSubstr("No such file"));
}

TEST_F(APinnedLibrary, NeedsNothingIfItIsNoLibrary) {
  EXPECT_THAT(needed_libraries(file_), SizeIs(0));
  EXPECT_THAT(needed_libraries(folder_ / "missing"), SizeIs(0));
}

}  // namespace
}  // namespace fastcycle::host
