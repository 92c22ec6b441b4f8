#include "estimate/analysis.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "estimate/test_simulator.h"
#include "estimate/text.h"

namespace fastcycle::estimate {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using testing::Contains;
using testing::HasSubstr;

/// A source → filter → control, and whatever else there is, on one executor with one worker.
System small_system() {
  System system;
  system.cpus = 1;
  system.executors = {{.name = "main"}};
  system.components = {{"filter"}, {"control"}, {"mapper"}};
  system.topics = {"points", "objects"};
  system.sources = {{"a driver", 0, Arrivals{milliseconds(100)}}};
  Callback filter;
  filter.name = "\"points\"";
  filter.run_time = milliseconds(10);
  filter.inputs = {{0}};
  filter.publishes = {{1}};
  Callback control;
  control.name = "\"objects\"";
  control.component = 1;
  control.run_time = milliseconds(1);
  control.inputs = {{1}};
  Callback mapper;
  mapper.name = "its timer";
  mapper.component = 2;
  mapper.run_time = milliseconds(5);
  mapper.arrivals = Arrivals{milliseconds(50)};
  system.callbacks = {filter, control, mapper};
  system.chains = {{"braking", 0, 1, milliseconds(40)}};
  return system;
}

Duration oldest_of(const System& system) {
  Duration oldest{};
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Simulator simulator(system, {.seed = seed, .is_worst = true});
    simulator.run(milliseconds(1000));
    oldest = std::max(oldest, *simulator.oldest(0));
  }
  return oldest;
}

TEST(AnEstimate, IsCloseWhereOneThingWaitsForAnother) {
  const System system = small_system();
  const ChainEstimate chain = analyze(system).chains[0];
  // The filter waits for control and mapper, and takes 10 ms; the control waits for mapper and,
  // since messages may be published before their callback has ended, for the filter.
  EXPECT_EQ(chain.verdict, Verdict::kHolds) << to_text(system, analyze(system));
  EXPECT_EQ(chain.bound, milliseconds(31)) << to_text(system, analyze(system));
  const Duration observed = oldest_of(system);
  EXPECT_LE(observed, *chain.bound);
  EXPECT_GE(observed * 5 / 2, *chain.bound);
}

TEST(AnEstimate, SaysWhoHoldsAChainUpAndWhatWouldHelp) {
  System system = small_system();
  system.callbacks[2].run_time = milliseconds(20);
  system.chains[0].deadline = milliseconds(25);
  const ChainEstimate chain = analyze(system).chains[0];
  EXPECT_EQ(chain.verdict, Verdict::kNotShown);
  EXPECT_THAT(chain.reasons, Contains(HasSubstr("while \"mapper\" runs")));
  EXPECT_THAT(chain.remedies, Contains(HasSubstr("if \"mapper\" took at most")));
  EXPECT_GT(oldest_of(system), milliseconds(25));
}

TEST(AnEstimate, KnowsWhatCannotHold) {
  System system = small_system();
  system.chains[0].deadline = milliseconds(9);
  EXPECT_EQ(analyze(system).chains[0].verdict, Verdict::kCannotHold);
}

TEST(AnEstimate, KnowsAComponentThatHasMoreToDoThanTime) {
  System system = small_system();
  system.sources[0].arrivals->period = milliseconds(9);
  const ChainEstimate chain = analyze(system).chains[0];
  EXPECT_EQ(chain.verdict, Verdict::kCannotHold);
  EXPECT_THAT(chain.reasons, Contains(HasSubstr("\"filter\" has work for 111 %")));
}

TEST(AnEstimate, CallsNothingSafeThatItKnowsTooLittleOf) {
  System unknown_time = small_system();
  unknown_time.callbacks[2].run_time.reset();
  EXPECT_THAT(analyze(unknown_time).chains[0].reasons,
              Contains("the run time of its timer of \"mapper\" is unknown"));
  System unknown_rate = small_system();
  unknown_rate.sources[0].arrivals.reset();
  EXPECT_THAT(analyze(unknown_rate).chains[0].reasons,
              Contains("the rate of \"points\" from a driver is unknown"));
  EXPECT_EQ(analyze(unknown_time).chains[0].verdict, Verdict::kNotShown);
  EXPECT_EQ(analyze(unknown_rate).chains[0].verdict, Verdict::kNotShown);
}

TEST(AnEstimate, CountsOnTheRotationWhereAnotherHasTooMuchToDo) {
  System system = small_system();
  system.callbacks[2].run_time = milliseconds(2);
  system.callbacks[2].arrivals =
      Arrivals{milliseconds(1)};  // Ticks that come too late are skipped.
  const ChainEstimate chain = analyze(system).chains[0];
  ASSERT_TRUE(chain.bound) << to_text(system, analyze(system));
  EXPECT_LE(oldest_of(system), *chain.bound);
}

TEST(AnEstimate, AddsTheTimeUntilATimerLooksAtWhatCame) {
  System system = small_system();
  system.components.push_back({"brakes"});
  system.topics.push_back("command");
  system.callbacks[1].publishes = {};
  Callback timer;
  timer.name = "its timer";
  timer.component = 1;
  timer.run_time = milliseconds(1);
  timer.arrivals = Arrivals{milliseconds(20)};
  timer.publishes = {{2}};
  Callback brakes;
  brakes.name = "\"command\"";
  brakes.component = 3;
  brakes.run_time = microseconds(100);
  brakes.inputs = {{2}};
  system.callbacks.push_back(timer);
  system.callbacks.push_back(brakes);
  system.chains = {{"braking", 0, 2, milliseconds(200)}};
  const ChainEstimate chain = analyze(system).chains[0];
  ASSERT_EQ(chain.verdict, Verdict::kHolds) << to_text(system, analyze(system));
  EXPECT_EQ(chain.hops[2].held, milliseconds(100));
  const Duration observed = oldest_of(system);
  EXPECT_LE(observed, *chain.bound);
  EXPECT_GE(observed * 3 / 2, *chain.bound);
}

TEST(AnEstimate, CountsFromWhatLedToTheFirstTopic) {
  System system = small_system();
  system.sources[0].age = milliseconds(7);
  system.chains[0].from = 1;
  const ChainEstimate chain = analyze(system).chains[0];
  // As long as from "points", whose age when the driver publishes counts too.
  EXPECT_EQ(chain.bound, milliseconds(38)) << to_text(system, analyze(system));
}

TEST(AnEstimate, RefusesCpusThatSomebodyElseNeverLeaves) {
  System system = small_system();
  system.executors.push_back({.name = "spinner", .is_spinning = true});
  system.components[2].executor = 1;
  const ChainEstimate chain = analyze(system).chains[0];
  EXPECT_EQ(chain.verdict, Verdict::kNotShown);
  EXPECT_THAT(chain.reasons, Contains(HasSubstr("looks for work without pause")));
  system.cpus = 2;
  EXPECT_EQ(analyze(system).chains[0].verdict, Verdict::kHolds);
}

TEST(AnEstimate, CountsHigherPrioritiesAndNotLowerOnes) {
  System system = small_system();
  system.executors.push_back({.name = "other"});
  system.components[2].executor = 1;
  system.callbacks[2].run_time = milliseconds(20);
  EXPECT_EQ(analyze(system).chains[0].verdict, Verdict::kNotShown);
  system.executors[0].priority = 10;
  EXPECT_EQ(analyze(system).chains[0].verdict, Verdict::kHolds);
}

TEST(AnEstimate, SaysWhereMessagesGoRound) {
  System system = small_system();
  system.callbacks[1].publishes = {{0}};
  const ChainEstimate chain = analyze(system).chains[0];
  EXPECT_EQ(chain.verdict, Verdict::kNotShown);
  EXPECT_THAT(chain.reasons, Contains(HasSubstr("go round in a circle")));
}

TEST(AnEstimate, SaysWhereAQueueIsTooShort) {
  System system = small_system();
  system.sources[0].arrivals->burst = 3;
  system.callbacks[0].inputs[0].depth = 2;
  system.chains[0].deadline = milliseconds(500);
  const ChainEstimate chain = analyze(system).chains[0];
  EXPECT_EQ(chain.verdict, Verdict::kNotShown);
  EXPECT_THAT(chain.reasons, Contains(HasSubstr("whose queue has a depth of 2")));
}

}  // namespace
}  // namespace fastcycle::estimate
