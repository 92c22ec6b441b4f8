#include "standby/read_assembly.h"

#include <string>

#include <gtest/gtest.h>

namespace fastcycle::standby {
namespace {

using detail::ReadKind;
using detail::ReadRing;

TEST(ReadAssemblyTest, GivesEachActivationWhatItLearned) {
  ReadRing ring(64);
  ReadAssembly assembly(ring);
  ring.begin(1);
  ring.add(ReadKind::kTaken, 2, 7, 11);
  ring.begin(2);
  ring.add(ReadKind::kObserved, 0, "a text that takes more than one slot of the ring");
  ring.add(ReadKind::kTaken, 0, 7, 12);
  EXPECT_TRUE(assembly.read());

  const auto first = assembly.take(1);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].read.place, 2U);
  EXPECT_EQ(first[0].read.value, 11U);
  const auto second = assembly.take(2);
  ASSERT_EQ(second.size(), 2U);
  EXPECT_EQ(second[0].text, "a text that takes more than one slot of the ring");
  EXPECT_EQ(second[1].read.value, 12U);
  EXPECT_TRUE(assembly.take(3).empty());
}

TEST(ReadAssemblyTest, SaysThatSomethingWasWrittenOver) {
  ReadRing ring(8);
  ReadAssembly assembly(ring);
  ring.begin(1);
  for (std::uint64_t i = 0; i < 9; ++i) {
    ring.add(ReadKind::kTaken, 0, 7, i);
  }
  EXPECT_FALSE(assembly.read());
}

}  // namespace
}  // namespace fastcycle::standby
