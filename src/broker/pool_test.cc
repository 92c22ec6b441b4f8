#include "broker/pool.h"

#include <array>
#include <atomic>
#include <cstring>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

namespace fastcycle::detail {
namespace {

using google::protobuf::BytesValue;

TEST(Pool, LendsWhatItHasAndNothingMore) {
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->grow(2);

  Envelope* first = pool->take();
  Envelope* second = pool->take();

  EXPECT_NE(first, nullptr);
  EXPECT_NE(second, nullptr);
  EXPECT_EQ(pool->take(), nullptr);
  pool->put_back(first);
  pool->put_back(second);
  pool->close();
}

TEST(Pool, CountsWhatLateHoldersKeep) {
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->distinguish_holders(1, 2);
  pool->grow(2);
  Envelope* envelope = pool->take();

  for (const Holder holder : {Holder{0}, Holder{1}, Holder{2}, Holder{3}, kNobody}) {
    EXPECT_EQ(pool->kept_by(holder), 0U) << holder;
  }
  pool->declare_kept(2, 1);
  for (const Holder holder : {Holder{0}, Holder{1}, Holder{2}, Holder{3}, kNobody}) {
    pool->count_kept(*envelope, holder);
    EXPECT_EQ(pool->kept_by(holder), holder < 3 ? 1U : 0U) << holder;
    pool->count_let_go(*envelope, holder);
    EXPECT_EQ(pool->kept_by(holder), 0U) << holder;
  }
  pool->put_back(envelope);
  pool->close();
}

TEST(Pool, LendsTheWarmestMessageFirst) {
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->grow(3);
  Envelope* first = pool->take();

  pool->put_back(first);

  EXPECT_EQ(pool->take(), first);
  pool->put_back(first);
  pool->close();
}

TEST(Pool, LendsFirstWhatCameBackLast) {
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->grow(5);
  std::vector<Envelope*> out;
  for (int i = 0; i < 3; ++i) {
    out.push_back(pool->take());
    out.back()->references = 1;
  }
  for (Envelope* envelope : out) {
    release(envelope);
  }
  pool->collect();

  Envelope* first = pool->take();
  EXPECT_EQ(first, out[2]);
  pool->put_back(first);
  first = pool->take();
  EXPECT_EQ(first, out[2]);
  EXPECT_EQ(pool->take(), out[1]);
  out[2]->references = 1;
  release(out[2]);
  pool->collect();
  std::vector<Envelope*> rest;
  while (Envelope* envelope = pool->take()) {
    rest.push_back(envelope);
  }
  EXPECT_EQ(rest.size(), 4U) << "nothing is lost between what came back at different times";
  EXPECT_EQ(rest.front(), out[2]);
  rest.push_back(out[1]);
  for (Envelope* envelope : rest) {
    pool->put_back(envelope);
  }
  pool->close();
}

TEST(Pool, AMessageOfAPrototypeIsEmptyButHasItsCapacity) {
  BytesValue prototype;
  prototype.set_value(std::string(100'000, 'x'));
  auto* pool = new Pool(&BytesValue::default_instance());

  pool->grow(1, &prototype);

  Envelope* envelope = pool->take();
  const auto& message = static_cast<const BytesValue&>(*envelope->own);
  EXPECT_TRUE(message.value().empty());
  EXPECT_GE(message.value().capacity(), 100'000U);
  pool->put_back(envelope);
  pool->close();
}

TEST(APoisonedPool, OverwritesWhatCameBackAndLendsItAnew) {
  BytesValue prototype;
  prototype.set_value(std::string(1'000, 'x'));
  auto* pool = new Pool(&BytesValue::default_instance(), 0, Poison::kPattern);
  pool->grow(1, &prototype);
  Envelope* envelope = pool->take();
  const auto* kept = static_cast<const BytesValue*>(envelope->own);
  static_cast<BytesValue&>(*envelope->own).set_value("secret");
  envelope->references = 1;

  release(envelope);

  std::array<unsigned char, sizeof(BytesValue)> seen{};
  std::memcpy(seen.data(), static_cast<const void*>(kept), seen.size());
  EXPECT_THAT(seen, testing::Each(kPoisonByte));
  Envelope* again = pool->take();
  ASSERT_EQ(again, envelope);
  const auto& message = static_cast<const BytesValue&>(*again->own);
  EXPECT_NE(&message, kept);
  EXPECT_TRUE(message.value().empty());
  EXPECT_GE(message.value().capacity(), 1'000U);
  std::memcpy(seen.data(), static_cast<const void*>(kept), seen.size());
  EXPECT_THAT(seen, testing::Each(kPoisonByte)) << "and not yet used for something else";
  pool->put_back(again);
  pool->close();
}

TEST(APoisonedPool, KeepsTheMemoryOfItsLastMessagesOnly) {
  auto* pool = new Pool(&BytesValue::default_instance(), 0, Poison::kPattern);
  pool->grow(3);
  for (int i = 0; i < 500; ++i) {
    Envelope* envelope = pool->take();
    envelope->references = 1;
    release(envelope);
    pool->collect();
  }
  // Memory checkers judge that all is freed, and only once.
  Envelope* last = pool->take();
  last->references = 1;
  pool->close();
  release(last);
}

TEST(APoisonedPool, LeavesALoanAloneThatWasNotPublished) {
  auto* pool = new Pool(&BytesValue::default_instance(), 0, Poison::kFree);
  pool->grow(1);
  Envelope* envelope = pool->take();
  const google::protobuf::Message* own = envelope->own;

  pool->put_back(envelope);

  EXPECT_EQ(pool->take()->own, own);
  pool->put_back(envelope);
  pool->close();
}

#if defined(__SANITIZE_ADDRESS__)
TEST(APoisonedPool, HasAddressSanitizerReportWhoReadsAMessageThatItLetGo) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  auto* pool = new Pool(&BytesValue::default_instance());  // As a build with it has it.
  pool->grow(1);
  Envelope* envelope = pool->take();
  auto& message = static_cast<BytesValue&>(*envelope->own);
  message.set_value("read in the callback");
  const BytesValue* kept = &message;
  const std::string* part = &message.value();
  envelope->references = 1;

  release(envelope);

  EXPECT_DEATH(std::ignore = kept->GetCachedSize(), "heap-use-after-free");
  EXPECT_DEATH(std::ignore = part->size(), "heap-use-after-free");
  pool->close();
}
#endif

TEST(Pool, OutlivesItsPublisherUntilTheLastMessageComesBack) {
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->grow(2);
  Envelope* first = pool->take();
  Envelope* second = pool->take();
  first->references = 1;
  second->references = 2;
  release(second);

  pool->close();

  // The sanitizers judge: nothing is used after it was freed, nothing leaks.
  release(first);
  release(second);
}

TEST(Pool, GetsBackWhatManyThreadsLetGo) {
  constexpr int kRounds = 2'000;
  constexpr int kThreads = 3;
  auto* pool = new Pool(&BytesValue::default_instance());
  pool->grow(8);
  std::atomic<Envelope*> handed{nullptr};
  std::atomic<bool> is_over{false};
  std::vector<std::thread> readers;
  for (int i = 0; i < kThreads; ++i) {
    readers.emplace_back([&] {
      while (!is_over) {
        if (Envelope* envelope = handed.exchange(nullptr)) {
          release(envelope);
        }
      }
    });
  }

  for (int round = 0; round < kRounds; ++round) {
    Envelope* envelope = pool->take();
    while (envelope == nullptr) {
      envelope = pool->take();
    }
    envelope->references = 1;
    if (Envelope* left = handed.exchange(envelope)) {
      release(left);
    }
  }
  is_over = true;
  for (std::thread& reader : readers) {
    reader.join();
  }
  if (Envelope* left = handed.exchange(nullptr)) {
    release(left);
  }

  EXPECT_EQ(pool->size(), 8U);
  std::vector<Envelope*> all;
  while (Envelope* envelope = pool->take()) {
    all.push_back(envelope);
  }
  EXPECT_EQ(all.size(), 8U);
  for (Envelope* envelope : all) {
    pool->put_back(envelope);
  }
  pool->close();
}

// The sanitizers judge: whoever is last frees the pool, be it a reader or the publisher.
TEST(Pool, IsFreedOnceWhenItsPublisherGoesWhileMessagesComeBack) {
  constexpr int kRounds = 100;
  constexpr int kReaders = 2;
  for (int round = 0; round < kRounds; ++round) {
    auto* pool = new Pool(&BytesValue::default_instance());
    pool->grow(4);
    std::vector<Envelope*> out;
    while (Envelope* envelope = pool->take()) {
      envelope->references = kReaders;
      out.push_back(envelope);
    }
    std::atomic<int> ready{0};
    std::vector<std::thread> readers;
    for (int i = 0; i < kReaders; ++i) {
      readers.emplace_back([&] {
        ++ready;
        while (ready <= kReaders) {
          std::this_thread::yield();
        }
        for (Envelope* envelope : out) {
          release(envelope);
        }
      });
    }
    while (ready < kReaders) {
      std::this_thread::yield();
    }
    ++ready;
    if (round % 2 == 0) {
      std::this_thread::yield();
    }

    pool->close();

    for (std::thread& reader : readers) {
      reader.join();
    }
  }
}

}  // namespace
}  // namespace fastcycle::detail
