#include "driving_states.h"

#include <limits>

#include <gtest/gtest.h>

namespace ads {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

Observation all_is_well(double time_s) {
  return {.time_s = time_s,
          .engage_at_s = 2.0,
          .inputs = {{.what = "the ego pose", .age_s = 0.01, .limit_s = 0.1},
                     {.what = "the plan", .age_s = 0.1, .limit_s = 0.5}},
          .failures = {},
          .weaknesses = {},
          .speed_mps = 15.0};
}

DrivingStates engaged() {
  DrivingStates states({});
  states.look_at(all_is_well(2.0));
  return states;
}

TEST(DrivingStates, ItIsOffUntilEverythingHasCome) {
  DrivingStates states({});
  Observation observation = all_is_well(0.0);
  observation.inputs[1].age_s = kNever;

  EXPECT_FALSE(states.look_at(observation));

  EXPECT_EQ(states.state(), DrivingState::kOff);
  EXPECT_EQ(states.reason(), "the plan has never come");
  EXPECT_FALSE(is_autonomous(states.state()));
}

TEST(DrivingStates, ItEngagesWhenItWasAskedForAndNotBefore) {
  DrivingStates states({});

  EXPECT_TRUE(states.look_at(all_is_well(1.9)));
  EXPECT_EQ(states.state(), DrivingState::kAvailable);
  EXPECT_TRUE(states.look_at(all_is_well(2.0)));

  EXPECT_EQ(states.state(), DrivingState::kEngaged);
  EXPECT_EQ(states.since_s(), 2.0);
  EXPECT_TRUE(states.reason().empty());
}

TEST(DrivingStates, WithoutAMissionItOnlyBecomesAvailable) {
  DrivingStates states({});
  Observation observation = all_is_well(9.0);
  observation.engage_at_s.reset();

  states.look_at(observation);

  EXPECT_EQ(states.state(), DrivingState::kAvailable);
}

TEST(DrivingStates, WhatIsWeakAsksForCareUntilItHasBeenGoodForAWhile) {
  DrivingStates states = engaged();
  Observation weak = all_is_well(3.0);
  weak.weaknesses = {"the position is uncertain"};

  EXPECT_TRUE(states.look_at(weak));
  EXPECT_EQ(states.state(), DrivingState::kEngagedDegraded);
  EXPECT_FALSE(states.look_at(all_is_well(3.9)));
  EXPECT_EQ(states.reason(), "the position is uncertain");
  EXPECT_TRUE(states.look_at(all_is_well(4.0)));

  EXPECT_EQ(states.state(), DrivingState::kEngaged);
}

TEST(DrivingStates, WhatIsMissingLeadsToAStopThatNothingTakesBack) {
  DrivingStates states = engaged();
  Observation late = all_is_well(3.0);
  late.inputs[0].age_s = 0.15;

  EXPECT_TRUE(states.look_at(late));
  EXPECT_EQ(states.state(), DrivingState::kMinimalRiskStop);
  EXPECT_EQ(states.reason(), "the ego pose is 150 ms old, more than 100");
  EXPECT_FALSE(states.look_at(all_is_well(3.1)));

  EXPECT_EQ(states.state(), DrivingState::kMinimalRiskStop);
}

TEST(DrivingStates, AnAgeThatIsNoNumberIsMissing) {
  DrivingStates states = engaged();
  Observation strange = all_is_well(3.0);
  strange.inputs[0].age_s = std::numeric_limits<double>::quiet_NaN();

  states.look_at(strange);

  EXPECT_EQ(states.state(), DrivingState::kMinimalRiskStop);
}

TEST(DrivingStates, AFailureEndsAutonomousDrivingWhateverTheAges) {
  DrivingStates states = engaged();
  Observation failed = all_is_well(3.0);
  failed.failures = {"perception has failed: out of memory"};

  states.look_at(failed);

  EXPECT_EQ(states.state(), DrivingState::kMinimalRiskStop);
  EXPECT_EQ(states.reason(), "perception has failed: out of memory");
}

TEST(DrivingStates, AfterTheStopItStandsForHalfASecondBeforeItIsStopped) {
  DrivingStates states = engaged();
  Observation failed = all_is_well(3.0);
  failed.failures = {"x"};
  states.look_at(failed);
  failed.speed_mps = 0.01;

  for (const double time_s : {6.0, 6.4}) {
    failed.time_s = time_s;
    EXPECT_FALSE(states.look_at(failed));
  }
  failed.time_s = 6.5;
  EXPECT_TRUE(states.look_at(failed));

  EXPECT_EQ(states.state(), DrivingState::kStopped);
  EXPECT_EQ(states.reason(), "x");
  EXPECT_TRUE(is_autonomous(states.state()));
}

TEST(DrivingStates, OneThatLoadsWhatAnotherSavedGoesOnAsItDoes) {
  DrivingStates old = engaged();
  Observation observation = all_is_well(3.0);
  const auto look = [&](double time_s) {
    supervision::DrivingMemory memory;
    old.save(memory);
    DrivingStates loaded({});
    loaded.load(memory);
    observation.time_s = time_s;
    EXPECT_EQ(loaded.look_at(observation), old.look_at(observation)) << time_s;
    EXPECT_EQ(loaded.state(), old.state()) << time_s;
    EXPECT_EQ(loaded.reason(), old.reason()) << time_s;
    EXPECT_EQ(loaded.since_s(), old.since_s()) << time_s;
  };

  observation.weaknesses = {"the position is uncertain"};
  look(3.0);
  observation.weaknesses.clear();
  look(3.9);
  look(4.0);
  observation.failures = {"x"};
  look(5.0);
  observation.speed_mps = 0.01;
  look(6.0);
  look(6.4);
  look(6.5);

  EXPECT_EQ(old.state(), DrivingState::kStopped);
}

}  // namespace
}  // namespace ads
