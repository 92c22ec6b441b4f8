#include "base/log.h"

#include <chrono>
#include <cstdint>
#include <latch>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

/// A log in simulated time that begins at 100 s, and the lines that come out at standard error.
class LogTest : public testing::Test {
 protected:
  LogTest() : clock_(base::Clock::simulated(Time(100s))) {
    testing::internal::CaptureStderr();
    queue_.emplace(clock_);
    queue_->set_start(Time(100s));
  }
  ~LogTest() override {
    if (queue_) {
      static_cast<void>(printed());
    }
  }

  std::string printed() {
    queue_.reset();
    return testing::internal::GetCapturedStderr();
  }

  base::Clock clock_;
  std::optional<LogQueue> queue_;
};

TEST_F(LogTest, ALineHasTimeLevelAndComponent) {
  LogSource source(*queue_, "planner", clock_, LogLevel::kInfo);
  Log(source).info("{} lanes", 3);
  clock_.set_simulated(Time(112'345'678'901ns));
  Log(source).error("no lane\n");
  EXPECT_EQ(printed(), "0.000000 info planner: 3 lanes\n12.345678 error planner: no lane\n");
}

TEST_F(LogTest, BeforeTheStartTheTimeIsZero) {
  EXPECT_EQ(to_string({.time = Time(5s), .component = "a", .text = "b"}, Time(7s)),
            "0.000000 info a: b");
}

TEST_F(LogTest, NothingThatAComponentWritesSteersTheTerminal) {
  LogSource source(*queue_, "chatty\x1b", clock_, LogLevel::kInfo);
  Log(source).info("{}",
                   "\x1b[2J\xc2\x9b"
                   "31m\r\xff two\nlines \xe2\x80\xae");
  EXPECT_EQ(printed(),
            "0.000000 info chatty\\x1b: \\x1b[2J\\xc2\\x9b31m\\x0d\\xff two\\x0alines "
            "\\xe2\\x80\\xae\n");
}

TEST_F(LogTest, WhatIsBelowTheLevelIsNotWritten) {
  LogSource source(*queue_, "planner", clock_, LogLevel::kWarning);
  Log(source).debug("not this one");
  Log(source).info("nor this one");
  Log(source).warning("this one");
  EXPECT_EQ(printed(), "0.000000 warning planner: this one\n");
}

TEST_F(LogTest, AThrottledTextComesOnceInItsTimeAndSaysHowOftenItDidNot) {
  LogSource source(*queue_, "planner", clock_, LogLevel::kInfo);
  const Log log(source);
  for (int ms = 0; ms <= 2000; ms += 100) {
    clock_.set_simulated(Time(100s + std::chrono::milliseconds(ms)));
    log.throttle(1s).warning("no lane for {} ms", ms);
    log.throttle(1500ms).info("another text");
  }
  EXPECT_EQ(printed(),
            "0.000000 warning planner: no lane for 0 ms\n"
            "0.000000 info planner: another text\n"
            "1.000000 warning planner: no lane for 1000 ms (9 more left out)\n"
            "1.500000 info planner: another text (14 more left out)\n"
            "2.000000 warning planner: no lane for 2000 ms (9 more left out)\n");
}

TEST_F(LogTest, TextsThatHaveNoPlaceShareOne) {
  LogThrottle throttle;
  const std::string texts(LogThrottle::kTexts + 2, 'x');
  for (std::size_t i = 0; i < LogThrottle::kTexts + 1; ++i) {
    EXPECT_EQ(throttle.admit(&texts[i], Time(100s), 1s), 0U);
  }
  EXPECT_EQ(throttle.admit(&texts[LogThrottle::kTexts + 1], Time(100s), 1s), std::nullopt);
  EXPECT_EQ(throttle.admit(&texts[LogThrottle::kTexts + 1], Time(101s), 1s), 1U);
}

TEST_F(LogTest, KnowsWhetherAllIsPrinted) {
  EXPECT_TRUE(queue_->is_printed());
  std::latch gate(1);
  queue_->set_listener(this, [&](const LogLine&) { gate.wait(); });
  LogSource source(*queue_, "planner", clock_, LogLevel::kInfo);
  Log(source).info("one");
  Log(source).info("two");
  EXPECT_FALSE(queue_->is_printed());
  gate.count_down();
  while (!queue_->is_printed()) {
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(printed(), "0.000000 info planner: one\n0.000000 info planner: two\n");
}

TEST_F(LogTest, AFloodIsBoundedAndWhatIsLostIsReportedAndCounted) {
  constexpr std::uint64_t kLines = 1'000'000;
  std::uint64_t received = 0;
  std::uint64_t reported = 0;
  queue_->set_listener(this, [&](const LogLine& line) {
    if (line.component == LogQueue::kOwnName) {
      reported += std::stoull(std::string(line.text));
    } else {
      ++received;
    }
  });
  LogSource source(*queue_, "flood", clock_, LogLevel::kInfo);
  const auto flood = [&] {
    for (std::uint64_t i = 0; i < kLines / 2; ++i) {
      source.write(LogLevel::kInfo, "water");
    }
  };
  std::thread other(flood);
  flood();
  other.join();
  EXPECT_THAT(printed(), HasSubstr("water"));
  EXPECT_EQ(received + reported, kLines);
}

TEST_F(LogTest, EachListenerIsCalledUntilItIsTakenAway) {
  std::vector<std::string> first;
  std::vector<std::string> second;
  queue_->set_listener(&first, [&](const LogLine& line) { first.emplace_back(line.text); });
  queue_->set_listener(&second, [&](const LogLine& line) { second.emplace_back(line.text); });
  LogSource source(*queue_, "a", clock_, LogLevel::kInfo);
  source.write(LogLevel::kInfo, "one");
  static_cast<void>(printed());
  EXPECT_THAT(first, ElementsAre("one"));
  EXPECT_THAT(second, ElementsAre("one"));

  testing::internal::CaptureStderr();
  queue_.emplace(clock_);
  queue_->set_listener(&first, [&](const LogLine& line) { first.emplace_back(line.text); });
  queue_->set_listener(&first, {});
  queue_->write({.time = clock_.now(), .component = "a", .text = "two"});
  EXPECT_THAT(printed(), HasSubstr("two"));
  EXPECT_THAT(first, ElementsAre("one"));
}

TEST_F(LogTest, KeptLinesAreBounded) {
  LogSource source(*queue_, "a", clock_, LogLevel::kInfo);
  source.write(LogLevel::kInfo, "before");
  source.keep();
  for (std::size_t i = 0; i < LogSource::kMostKept + 3; ++i) {
    source.write(LogLevel::kWarning, "kept");
  }
  const LogSource::AllKept kept = source.take_kept();
  EXPECT_EQ(kept.lines.size(), LogSource::kMostKept);
  EXPECT_EQ(kept.lines.front().text, "kept");
  EXPECT_EQ(kept.lost, 3U);
  EXPECT_TRUE(source.take_kept().lines.empty());
}

}  // namespace
}  // namespace fastcycle::detail
