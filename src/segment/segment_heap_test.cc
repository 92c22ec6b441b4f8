#include "segment/segment_heap.h"

#include <cstdint>
#include <cstring>
#include <new>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace fastcycle::segment {
namespace {

class ASegmentHeap : public testing::Test {
 protected:
  static constexpr std::size_t kBytes = std::size_t{1} << 20;

  ASegmentHeap() : memory_(kBytes) { heap_.begin(memory_.data(), memory_.size()); }

  std::vector<char> memory_;
  SegmentHeap heap_;
};

TEST_F(ASegmentHeap, GivesWhatWasFreedAgain) {
  void* const first = heap_.allocate(1000, 16);
  heap_.free(first);

  EXPECT_EQ(heap_.allocate(1000, 16), first);
  EXPECT_EQ(heap_.statistics().allocations, 2U);
  EXPECT_EQ(heap_.statistics().frees, 1U);
}

TEST_F(ASegmentHeap, KeepsAlignmentsOfAllSizes) {
  for (std::size_t alignment = 16; alignment <= 4096; alignment *= 2) {
    void* const memory = heap_.allocate(40, alignment);

    ASSERT_NE(memory, nullptr);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(memory) % alignment, 0U);
    heap_.free(memory);
  }
}

TEST_F(ASegmentHeap, SaysThatItIsFullAndCountsThat) {
  std::vector<void*> blocks;
  while (void* const block = heap_.allocate(10'000, 16)) {
    blocks.push_back(block);
  }

  EXPECT_GT(blocks.size(), 80U);
  EXPECT_EQ(heap_.statistics().exhausted, 1U);
  EXPECT_EQ(heap_.allocate(2 * kBytes, 16), nullptr);
  heap_.free(blocks.back());
  EXPECT_NE(heap_.allocate(10'000, 16), nullptr);
}

// Blocks of random sizes, each filled with its own byte, come and go.
TEST_F(ASegmentHeap, GivesNoByteToTwo) {
  std::mt19937 random(7);
  std::vector<std::pair<unsigned char*, std::size_t>> blocks;
  for (int i = 0; i < 20'000; ++i) {
    if (blocks.size() > 100 || (!blocks.empty() && random() % 2 == 0)) {
      const std::size_t place = random() % blocks.size();
      const auto [block, size] = blocks[place];
      for (std::size_t byte = 0; byte < size; byte += 7) {
        ASSERT_EQ(block[byte], static_cast<unsigned char>(size));
      }
      heap_.free(block);
      blocks[place] = blocks.back();
      blocks.pop_back();
    } else if (const std::size_t size = 1 + random() % 2000;
               void* const block = heap_.allocate(size, 16)) {
      std::memset(block, static_cast<unsigned char>(size), size);
      blocks.emplace_back(static_cast<unsigned char*>(block), size);
    }
  }
}

// Of the program's operators, which this test program is linked with too.
TEST(OperatorNew, GivesAlignedMemoryOfNoBytesAndRefusesMoreThanThereIs) {
  constexpr std::align_val_t kAlignment{64};
  const volatile std::size_t none = 0;
  void* const empty = ::operator new(none, kAlignment);
  EXPECT_NE(empty, nullptr);
  ::operator delete(empty, kAlignment);

  const volatile std::size_t too_many = SIZE_MAX - 8;
  EXPECT_EQ(::operator new(too_many, kAlignment, std::nothrow), nullptr);
  void* volatile given = nullptr;  // Or the compiler leaves the call out.
  EXPECT_THROW(given = ::operator new(too_many, kAlignment), std::bad_alloc);
  EXPECT_EQ(given, nullptr);
}

}  // namespace
}  // namespace fastcycle::segment
