#include "trace/trace_file.h"

#include <csignal>
#include <filesystem>
#include <stdexcept>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "config/test_folder.h"
#include "trace/test_trace.h"

namespace fastcycle::trace {
namespace {

/// No file may grow beyond `bytes` meanwhile, as on a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = bytes, .rlim_max = before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = std::signal(SIGXFSZ, SIG_IGN);
};

TEST(ATraceFile, HoldsAllThatWasTakenInItsOrder) {
  const config::TestFolder folder;
  TraceFile file(folder / "a.pftrace", 10'000'000);
  file.open();
  std::vector<base::Refusal> refusals;
  file.start(refusals);
  std::string all;
  for (int i = 0; i < 20'000; ++i) {
    const std::string part = std::to_string(i) + ",";
    ASSERT_TRUE(file.append(part, true));
    all += part;
  }

  file.close();

  EXPECT_EQ(bytes_of(folder / "a.pftrace"), all);
  EXPECT_EQ(file.written(), all.size());
  EXPECT_EQ(file.problem(), "");
}

TEST(ATraceFile, CanBeReadByItsOwnerAlone) {
  const config::TestFolder folder;
  TraceFile file(folder / "a.pftrace", 1000);

  file.open();

  struct stat status{};
  ASSERT_EQ(::stat((folder / "a.pftrace").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST(ATraceFile, TakesNothingBeyondItsBuffer) {
  const config::TestFolder folder;
  TraceFile file(folder / "a.pftrace", 1000);
  file.open();

  // Nobody writes yet.
  EXPECT_TRUE(file.append(std::string(900, 'a'), false));
  EXPECT_FALSE(file.append(std::string(101, 'b'), false));
  EXPECT_TRUE(file.append(std::string(100, 'c'), false));
  std::vector<base::Refusal> refusals;
  file.start(refusals);
  file.close();

  EXPECT_EQ(bytes_of(folder / "a.pftrace"), std::string(900, 'a') + std::string(100, 'c'));
}

TEST(ATraceFile, ThatCannotBeWrittenSaysSoAndTakesNothingMore) {
  TraceFile file("/dev/full", 1'000'000);
  file.open();
  std::vector<base::Refusal> refusals;
  file.start(refusals);

  // It waits for room as long as there may be some.
  while (file.append(std::string(100'000, 'a'), true)) {
  }
  file.close();

  EXPECT_NE(file.problem().find("/dev/full: "), std::string::npos) << file.problem();
}

TEST(ATraceFile, ThatCannotBeWrittenCompletelyIsRemoved) {
  const config::TestFolder folder;
  TraceFile file(folder / "a.pftrace", 1'000'000);
  file.open();
  std::vector<base::Refusal> refusals;
  {
    const FullDisk disk(1000);
    file.start(refusals);
    EXPECT_TRUE(file.append(std::string(100'000, 'a'), false));
    file.close();
  }

  EXPECT_NE(file.problem().find("a.pftrace: "), std::string::npos) << file.problem();
  EXPECT_NE(file.problem().find("it was removed"), std::string::npos) << file.problem();
  EXPECT_FALSE(std::filesystem::exists(folder / "a.pftrace"));
  EXPECT_EQ(file.written(), 0U);
}

TEST(ATraceFile, ThatCannotBeWrittenLeavesAnotherFileOfItsNameAlone) {
  const config::TestFolder folder;
  TraceFile file(folder / "a.pftrace", 1'000'000);
  file.open();
  std::filesystem::rename(folder / "a.pftrace", folder / "b.pftrace");
  folder.write("a.pftrace", "another");
  std::vector<base::Refusal> refusals;
  {
    const FullDisk disk(1000);
    file.start(refusals);
    EXPECT_TRUE(file.append(std::string(100'000, 'a'), false));
    file.close();
  }

  EXPECT_NE(file.problem(), "");
  EXPECT_EQ(bytes_of(folder / "a.pftrace"), "another");
}

TEST(ATraceFile, ThatCannotBeMadeIsAnError) {
  TraceFile file("/nowhere/a.pftrace", 1000);

  EXPECT_THROW(file.open(), std::runtime_error);
}

}  // namespace
}  // namespace fastcycle::trace
