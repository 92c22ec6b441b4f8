#include "trace/trace_file.h"

#include <stdexcept>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "config/test_folder.h"
#include "trace/test_trace.h"

namespace fastcycle::trace {
namespace {

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

TEST(ATraceFile, ThatCannotBeMadeIsAnError) {
  TraceFile file("/nowhere/a.pftrace", 1000);

  EXPECT_THROW(file.open(), std::runtime_error);
}

}  // namespace
}  // namespace fastcycle::trace
