#include "processes/notices.h"

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "segment/segments.h"

namespace fastcycle::processes {
namespace {

using ::testing::ElementsAre;
using ::testing::Optional;

constexpr segment::ProcessIndex kMain = 1;

/// Two processes, of which the second is this one: it reads what it says.
struct Process {
  segment::WirePlan plan;
  segment::Segments segments;
  segment::Wire wire{segments, plan};

  Process() {
    plan.processes = 2;
    plan.executors = 1;
    plan.lay_out();
    if (const auto refused = segments.reserve({.processes = plan.processes,
                                               .control_bytes = plan.control_bytes,
                                               .bytes = std::size_t{64} << 20U})) {
      ADD_FAILURE() << *refused;
    }
    wire.incarnation(kMain).store(1);
    if (const auto refused = segments.become(kMain, segment::Wire::generation_of(1))) {
      ADD_FAILURE() << *refused;
    }
  }
};

/// A process has segments once: each test runs in a child.
void run_in_child(const std::function<void()>& body) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    body();
    std::fflush(nullptr);
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

std::vector<std::string> all_of(Notices& notices) {
  std::vector<std::string> records;
  while (auto record = notices.next(kMain)) {
    records.push_back(std::move(*record));
  }
  return records;
}

TEST(NoticesOfAProcess, ComeWholeAndInOrder) {
  run_in_child([] {
    Process process;
    Notices writer(process.wire, kMain, 1);
    Notices reader(process.wire, kMain, 1);
    reader.follow(kMain, 1, 0);
    const auto word = reader.word_of(kMain);

    EXPECT_TRUE(writer.send("one"));
    EXPECT_TRUE(writer.send(""));
    EXPECT_TRUE(writer.send(std::string(8, 'x')));

    EXPECT_NE(word.word->load(), word.seen);
    EXPECT_THAT(all_of(reader), ElementsAre("one", "", "xxxxxxxx"));
    EXPECT_THAT(all_of(reader), ElementsAre());
    EXPECT_EQ(reader.position_of(kMain), writer.sent());
    EXPECT_FALSE(reader.take_loss());
  });
}

TEST(NoticesOfAProcess, AreReadUpToWhereTheyWereSaid) {
  run_in_child([] {
    Process process;
    Notices notices(process.wire, kMain, 1);
    notices.follow(kMain, 1, 0);
    EXPECT_TRUE(notices.send("of this round"));
    const std::uint64_t end = notices.sent();
    EXPECT_TRUE(notices.send("of the next one"));

    EXPECT_THAT(notices.next(kMain, end), Optional(std::string("of this round")));
    EXPECT_EQ(notices.next(kMain, end), std::nullopt);
    EXPECT_THAT(all_of(notices), ElementsAre("of the next one"));
  });
}

TEST(NoticesOfAProcess, GoAroundTheRingAndAreMissedByWhoIsLate) {
  run_in_child([] {
    Process process;
    Notices writer(process.wire, kMain, 1);
    Notices quick(process.wire, kMain, 1);
    Notices late(process.wire, kMain, 1);
    quick.follow(kMain, 1, 0);
    late.follow(kMain, 1, 0);

    for (int i = 0; i < 100; ++i) {
      const std::string record(std::size_t{10'000} + static_cast<std::size_t>(i),
                               static_cast<char>('a' + i % 26));
      EXPECT_TRUE(writer.send(record));
      EXPECT_THAT(quick.next(kMain), Optional(record));
    }

    EXPECT_FALSE(quick.take_loss());
    EXPECT_EQ(late.next(kMain), std::nullopt);
    EXPECT_TRUE(late.take_loss());
    EXPECT_TRUE(writer.send("after it"));
    EXPECT_THAT(all_of(late), ElementsAre("after it"));
    EXPECT_FALSE(late.take_loss());
  });
}

TEST(NoticesOfAProcess, AreRefusedWhereTheyAreTooLarge) {
  run_in_child([] {
    Process process;
    Notices notices(process.wire, kMain, 1);
    notices.follow(kMain, 1, 0);

    EXPECT_FALSE(notices.send(std::string(Notices::kMaxRecord + 1, 'x')));
    EXPECT_TRUE(notices.send(std::string(Notices::kMaxRecord, 'y')));

    EXPECT_THAT(notices.next(kMain), Optional(std::string(Notices::kMaxRecord, 'y')));
  });
}

TEST(NoticesOfAProcess, ThatAreNoneCountAsMissed) {
  run_in_child([] {
    Process process;
    Notices notices(process.wire, kMain, 1);
    notices.follow(kMain, 1, 0);
    EXPECT_TRUE(notices.send("whole"));
    process.wire.notices(kMain, 1).ring[0].store(~std::uint64_t{0});

    EXPECT_EQ(notices.next(kMain), std::nullopt);
    EXPECT_TRUE(notices.take_loss());
    EXPECT_TRUE(notices.send("later"));
    EXPECT_THAT(all_of(notices), ElementsAre("later"));
  });
}

TEST(ASnapshot, IsTheOneThatWasPutLast) {
  run_in_child([] {
    Process process;
    Notices notices(process.wire, kMain, 1);
    EXPECT_EQ(notices.snapshot_of(kMain), std::nullopt);

    EXPECT_TRUE(notices.put_snapshot(std::string(1000, 'a')));
    EXPECT_TRUE(notices.put_snapshot("short"));
    EXPECT_THAT(notices.snapshot_of(kMain), Optional(std::string("short")));

    EXPECT_FALSE(notices.put_snapshot(std::string(100'000, 'b')));
    EXPECT_THAT(notices.snapshot_of(kMain), Optional(std::string("short")));
  });
}

TEST(ASnapshot, ThatIsBeingWrittenIsNotTaken) {
  run_in_child([] {
    Process process;
    Notices notices(process.wire, kMain, 1);
    EXPECT_TRUE(notices.put_snapshot("whole"));

    process.wire.snapshot(kMain, 1).version.fetch_add(1);

    EXPECT_EQ(notices.snapshot_of(kMain), std::nullopt);
  });
}

}  // namespace
}  // namespace fastcycle::processes
