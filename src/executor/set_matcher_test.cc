#include "executor/set_matcher.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "executor/test_synchronization.h"
#include "fastcycle/version.h"

namespace fastcycle::detail {
namespace {

// ---- What the matcher does ----

/// Messages are names only: the matcher does not read them.
class Matching {
 public:
  Matching(std::size_t topics, const SynchronizerOptions& options)
      : topics_(topics), matcher_(topics, options) {}

  void arrive(const TestArrival& arrival) {
    Envelope* envelope = &envelopes()[count_];
    const bool is_complete = matcher_.add(arrival.topic, Time(Duration(arrival.time)), envelope);
    note_departed();
    if (is_complete) {
      std::vector<std::size_t> set;
      for (std::size_t i = 0; i < topics_; ++i) {
        const SetMatcher::Member& member = matcher_.set()[i];
        set.push_back(name(member.envelope));
        delivered_ += member.is_new ? 1 : 0;
        in_hand_ += member.is_held ? 0 : 1;
      }
      matched_.sets.push_back(set);
    }
    ++count_;
  }

  /// Every message was delivered, gave way or was held, and is given back exactly once.
  [[nodiscard]] bool accounts_for_all() {
    const std::size_t given_way = matched_.unmatched.size();
    matcher_.clear();
    std::size_t held_and_new = 0;
    for (const SetMatcher::Departed& departed : matcher_.departed()) {
      held_and_new += departed.was_used ? 0 : 1;
      ++in_hand_;
    }
    return delivered_ + given_way + held_and_new == count_ && in_hand_ == count_;
  }

  [[nodiscard]] const Matched& matched() const { return matched_; }

 private:
  static constexpr std::size_t kMaxMessages = 128;
  static Envelope* envelopes() {
    static std::array<Envelope, kMaxMessages> all;
    return all.data();
  }
  [[nodiscard]] static std::size_t name(const Envelope* envelope) {
    return static_cast<std::size_t>(envelope - envelopes());
  }

  void note_departed() {
    for (const SetMatcher::Departed& departed : matcher_.departed()) {
      ++in_hand_;
      if (!departed.was_used) {
        matched_.unmatched[name(departed.envelope)] = count_;
      }
    }
  }

  const std::size_t topics_;
  SetMatcher matcher_;
  std::size_t count_ = 0;
  std::size_t delivered_ = 0;
  std::size_t in_hand_ = 0;  ///< Messages that the matcher gave back.
  Matched matched_;
};

Matched match(const std::vector<TestArrival>& arrivals, std::size_t topics,
              const SynchronizerOptions& options) {
  Matching matching(topics, options);
  for (const TestArrival& arrival : arrivals) {
    matching.arrive(arrival);
  }
  return matching.matched();
}

SynchronizerOptions approximate(int max_difference, std::size_t depth = 8) {
  return {.policy = SyncPolicy::kApproximate,
          .max_difference = Duration(max_difference),
          .depth = depth};
}

using Sets = std::vector<std::vector<std::size_t>>;

TEST(SetMatcher, CallsASetWhenTheLastOfItArrives) {
  Matching matching(2, approximate(30));
  for (int i = 0; i < 10; ++i) {
    matching.arrive({0, 100 * i});
    EXPECT_EQ(matching.matched().sets.size(), static_cast<std::size_t>(i));

    matching.arrive({1, 100 * i + 20});

    EXPECT_EQ(matching.matched().sets.size(), static_cast<std::size_t>(i + 1));
  }
  EXPECT_TRUE(matching.matched().unmatched.empty());
}

TEST(SetMatcher, TakesTheNearestPartner) {
  EXPECT_EQ(match({{0, 0}, {0, 8}, {0, 15}, {1, 10}}, 2, approximate(10)).sets, (Sets{{1, 3}}));
}

TEST(SetMatcher, WhatIsOlderThanAMemberGivesWay) {
  const Matched matched = match({{0, 0}, {0, 8}, {1, 9}, {1, 9}}, 2, approximate(10));
  EXPECT_EQ(matched.sets, (Sets{{1, 2}}));
  EXPECT_EQ(matched.unmatched, (std::map<std::size_t, std::size_t>{{0, 2}}));
}

TEST(SetMatcher, AMessageGivesWayOnceItsPartnerCannotComeAnyMore) {
  Matching matching(2, approximate(10));
  matching.arrive({0, 0});
  matching.arrive({1, 10});  // Within reach: a set.
  matching.arrive({0, 100});
  matching.arrive({1, 110});
  matching.arrive({0, 200});
  EXPECT_EQ(matching.matched().sets.size(), 2U);
  EXPECT_TRUE(matching.matched().unmatched.empty());

  matching.arrive({1, 211});

  EXPECT_EQ(matching.matched().unmatched, (std::map<std::size_t, std::size_t>{{4, 5}}));
}

TEST(SetMatcher, WhatComesBeforeAnEarlierOneOfItsTopicComesTooLate) {
  const Matched matched = match({{0, 10}, {0, 9}, {1, 9}}, 2, {.policy = SyncPolicy::kExact});
  EXPECT_TRUE(matched.sets.empty());
  EXPECT_TRUE(matched.unmatched.contains(1));
}

/// What departs, in words: "topic why partner difference", for each arrival that lets some go.
std::string reasons(const std::vector<TestArrival>& arrivals, std::size_t topics,
                    const SynchronizerOptions& options) {
  SetMatcher matcher(topics, options);
  std::array<Envelope, 64> messages;
  std::string text;
  std::size_t next = 0;
  for (const TestArrival& arrival : arrivals) {
    static_cast<void>(matcher.add(arrival.topic, Time(Duration(arrival.time)), &messages[next++]));
    for (const SetMatcher::Departed& departed : matcher.departed()) {
      constexpr std::array<const char*, 5> kWords{"too_far", "depth", "overtaken", "late",
                                                  "no_message"};
      const auto why = static_cast<std::size_t>(departed.why);
      text += std::to_string(departed.topic) + " " + kWords[why];
      if (departed.why == Unmatched::kTooFar || departed.why == Unmatched::kDepth) {
        text += " " + std::to_string(departed.partner) + " " +
                (departed.difference ? std::to_string(departed.difference->count()) : "none");
      }
      text += "; ";
    }
  }
  return text;
}

TEST(SetMatcher, SaysWhyAMessageGivesWay) {
  EXPECT_EQ(reasons({{0, 100}, {1, 75}, {0, 200}, {1, 175}}, 2, approximate(10)),
            "1 too_far 0 25; 1 too_far 0 25; 0 too_far 1 25; ");
  EXPECT_EQ(reasons({{0, 0}, {0, 100}, {0, 200}}, 2, approximate(10, 2)), "0 depth 1 none; ");
  EXPECT_EQ(reasons({{1, 0}, {0, 50}, {0, 100}, {0, 200}}, 2, approximate(10, 2)),
            "1 too_far 0 50; 0 depth 1 50; ");
  EXPECT_EQ(reasons({{0, 0}, {0, 5}, {1, 5}}, 2, approximate(10)), "0 overtaken; ");
  EXPECT_EQ(reasons({{0, 50}, {0, 20}}, 2, approximate(10)), "0 late; ");
  EXPECT_EQ(reasons({{0, 0}, {1, 0}}, 2, {.policy = SyncPolicy::kLatest}), "0 no_message; ");
}

TEST(SetMatcher, BlamesTheTopicThatIsTheFarthest) {
  EXPECT_EQ(reasons({{0, 100}, {1, 104}, {2, 130}}, 3, approximate(10)),
            "0 too_far 2 30; 1 too_far 2 26; ");
}

TEST(SetMatcher, AFullRingLetsItsOldestGo) {
  const Matched matched =
      match({{0, 1}, {0, 2}, {0, 3}, {1, 1}}, 2, {.policy = SyncPolicy::kExact, .depth = 2});
  EXPECT_TRUE(matched.sets.empty());
  EXPECT_EQ(matched.unmatched.at(0), 2U);
}

TEST(SetMatcher, LatestGivesEveryMessageOfTheFirstTopicTheNewestOfTheOthers) {
  const Matched matched = match({{0, 1}, {1, 0}, {0, 2}, {0, 3}, {1, 0}, {1, 9}, {0, 4}}, 2,
                                {.policy = SyncPolicy::kLatest});
  EXPECT_EQ(matched.sets, (Sets{{2, 1}, {3, 1}, {6, 5}}));
  EXPECT_EQ(matched.unmatched, (std::map<std::size_t, std::size_t>{{0, 0}, {4, 5}}));
}

// ---- Any streams ----

std::string described(const std::vector<TestArrival>& arrivals) {
  std::string text;
  for (const TestArrival& arrival : arrivals) {
    text += "{" + std::to_string(arrival.topic) + ", " + std::to_string(arrival.time) + "}, ";
  }
  return text;
}

TEST(ManySynchronizedStreams, AreMatchedAsTheRuleSays) {
  // A sanitizer makes each of them take ten times as long.
  constexpr bool is_slow = std::string_view(FASTCYCLE_SANITIZER) != "none";
  constexpr std::size_t kStreams = is_slow ? 25'000 : 100'000;
  std::mt19937_64 random(17);
  std::size_t sets = 0;
  std::size_t given_way = 0;
  std::array<std::size_t, 3> sets_of{};
  for (std::size_t i = 0; i < kStreams; ++i) {
    const auto policy = static_cast<SyncPolicy>(random() % 3);
    // Four topics give the oracle many sets to try.
    const std::size_t topics = 2 + (random() % 8 < 5 ? 0 : random() % 3);
    const int difference =
        policy == SyncPolicy::kApproximate ? 1 + static_cast<int>(random() % 15) : 0;
    const std::size_t depth = 1 + random() % 6;
    const std::vector<TestArrival> arrivals = random_streams(random, topics);
    Matching matching(topics,
                      {.policy = policy, .max_difference = Duration(difference), .depth = depth});
    for (const TestArrival& arrival : arrivals) {
      matching.arrive(arrival);
    }

    const Matched expected = Oracle(arrivals, topics, policy, difference, depth).run();

    ASSERT_EQ(matching.matched(), expected)
        << "stream " << i << ", policy " << static_cast<int>(policy) << ", difference "
        << difference << ", depth " << depth << ": " << described(arrivals);
    ASSERT_TRUE(matching.accounts_for_all()) << "stream " << i;
    sets += expected.sets.size();
    sets_of[static_cast<std::size_t>(policy)] += expected.sets.size();
    given_way += expected.unmatched.size();
  }
  // All kinds of things happened.
  EXPECT_GT(sets, 5 * kStreams);
  EXPECT_GT(given_way, 5 * kStreams);
  EXPECT_GT(*std::ranges::min_element(sets_of), kStreams / 5);
}

}  // namespace
}  // namespace fastcycle::detail
