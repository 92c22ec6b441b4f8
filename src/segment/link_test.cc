// Messages between processes: publishers in children of the test, or in the test itself, with real
// segments and real forks.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/struct.pb.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/shared_memory.h"
#include "broker/topics.h"
#include "fastcycle/loan_scope.h"
#include "segment/export.h"
#include "segment/import.h"
#include "segment/layout.h"
#include "segment/segments.h"
#include "segment/wire.h"

namespace fastcycle::segment {
namespace {

using google::protobuf::SourceCodeInfo_Location;
using google::protobuf::Struct;

constexpr ProcessIndex kPublisher = 1;
constexpr ProcessIndex kReceiver = 2;
constexpr ProcessIndex kSecondReceiver = 3;

/// How far a test has come: seen and reported by all of its processes.
class Progress {
 public:
  Progress()
      : step_(*new(mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_ANONYMOUS, -1, 0)) std::atomic<int>(0)) {}

  void reach(int step) { step_.store(step); }
  [[nodiscard]] bool has_reached(int step) const { return step_.load() >= step; }
  /// Fails the test after a minute.
  void await(int step) const {
    for (int i = 0; i < 300'000 && !has_reached(step); ++i) {
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    EXPECT_TRUE(has_reached(step)) << "step " << step << " was not reached within a minute";
  }

 private:
  std::atomic<int>& step_;
};

/// A process with a link to another one, or to two; each test runs in a child of its own, since a
/// process has segments once.
struct Processes {
  Segments segments;
  WirePlan plan;
  Progress progress;

  explicit Processes(std::uint32_t depth = 4, std::uint32_t capacity = 12,
                     bool drops_newest = false, unsigned receivers = 1,
                     std::uint32_t depth_of_large = 16, bool is_serialized = false,
                     std::size_t roots = 0) {
    plan.roots = roots;
    plan.processes = kReceiver + receivers;
    plan.executors = 1;
    for (unsigned i = 0; i < receivers; ++i) {
      plan.links.push_back({.from = kPublisher,
                            .to = static_cast<ProcessIndex>(kReceiver + i),
                            .depth = depth,
                            .capacity = capacity,
                            .depth_of_large = depth_of_large,
                            .drops_newest = drops_newest,
                            .is_serialized = is_serialized});
    }
    plan.lay_out();
    const auto refused = segments.reserve({.processes = plan.processes,
                                           .control_bytes = plan.control_bytes,
                                           .bytes = std::size_t{256} << 20});
    if (refused) {
      ADD_FAILURE() << *refused;
    }
  }

  [[nodiscard]] Wire wire() const { return {segments, plan}; }
  /// That to `receiver`.
  [[nodiscard]] const LinkPlan& link(ProcessIndex receiver = kReceiver) const {
    return plan.links[std::size_t{receiver} - kReceiver];
  }
  void announce(ProcessIndex process, std::uint32_t incarnation) const {
    wire().incarnation(process).store(incarnation);
  }
};

/// Runs `body` in a child; true if that failed nothing and ended.
bool holds_in_child(const std::function<void()>& body) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    body();
    std::fflush(nullptr);
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// How a child that runs `body` ended.
int status_of(const std::function<void()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    body();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

/// A component that publishes, and its topic: in the publisher's process.
class Publishing {
 public:
  Publishing(const Processes& processes, std::uint32_t incarnation,
             const google::protobuf::Message& type)
      : wire_(processes.wire()) {
    owner_.name = "sender";
    owner_.clock = &clock_;
    core_ = &topics_.add_publisher("topic", owner_, type, nullptr, false);
    core_->use_credits(processes.link().credits);
    for (const LinkPlan& link : processes.plan.links) {
      exports_.push_back(std::make_unique<Export>(wire_, link, incarnation, type));
      core_->add_export(*exports_.back());
    }
    topics_.connect_all();
  }

  void publish(const std::function<void(google::protobuf::Message&)>& fill) {
    owner_.enter();
    owner_.now = clock_.now();
    owner_.publish_count = 0;
    detail::Envelope* const loan = core_->loan(true);
    fill(*loan->own);
    core_->publish(loan, {});
    owner_.leave();
  }
  /// The same, but the loan is from an activation before.
  void publish_later(const std::function<void(google::protobuf::Message&)>& fill) {
    owner_.enter();
    detail::Envelope* const loan = core_->loan(true);
    owner_.leave();
    owner_.enter();
    owner_.now = clock_.now();
    owner_.publish_count = 0;
    fill(*loan->own);
    core_->publish(loan, {});
    owner_.leave();
  }
  void publish_file(const std::string& name) {
    publish([&](auto& message) {
      static_cast<SourceCodeInfo_Location&>(message).set_leading_comments(name);
    });
  }

  detail::Credits& credits() { return *core_->credits(); }

  Export& to(ProcessIndex receiver = kReceiver) {
    return *exports_[std::size_t{receiver} - kReceiver];
  }

 private:
  const Wire wire_;
  base::Clock clock_ = base::Clock::live();
  detail::PublishingComponent owner_;
  std::vector<std::unique_ptr<Export>> exports_;
  detail::Topics topics_;
  detail::PublisherCore* core_ = nullptr;
};

/// A subscription of the topic: in the receiver's process.
class Receiving {
 public:
  Receiving(const Processes& processes, std::uint32_t incarnation,
            const google::protobuf::Message& type, std::size_t depth = 16,
            ProcessIndex process = kReceiver)
      : wire_(processes.wire()) {
    owner_.name = "sender";
    owner_.clock = &clock_;
    topics_.set_chains(std::vector<std::string>(processes.plan.roots, "topic"), {});
    core_ = &topics_.add_publisher("topic", owner_, type, nullptr, true);
    core_->is_imported = true;
    auto subscription = std::make_unique<detail::Subscription>(core_->topic, inbox_, "receiver",
                                                               detail::Subscription::Kind::kTap,
                                                               SubscriberOptions{.depth = depth});
    subscription_ = subscription.get();
    core_->topic.add(std::move(subscription));
    topics_.connect_all();
    import_ = std::make_unique<Import>(wire_, processes.link(process), incarnation, *core_);
    import_->attach();
  }
  ~Receiving() {
    while (detail::Envelope* const envelope = next()) {
      detail::release(envelope);
    }
  }

  Import& from() { return *import_; }
  [[nodiscard]] PublisherId publisher() const { return core_->id; }
  /// The oldest that came, or null.
  detail::Envelope* next() {
    detail::Lane& lane = *subscription_->lanes().front();
    detail::Lane::Head head;
    if (!lane.peek(head) || !lane.pop(head)) {
      return nullptr;
    }
    lane.delivered.add();
    return head.envelope;
  }
  /// The same, as soon as there is one.
  detail::Envelope* await() {
    for (int i = 0; i < 50'000; ++i) {
      import_->attach();
      import_->take();
      if (detail::Envelope* const envelope = next()) {
        return envelope;
      }
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    ADD_FAILURE() << "nothing came for ten seconds";
    return nullptr;
  }
  [[nodiscard]] detail::Ledger ledger() const { return subscription_->ledger(); }

 private:
  const Wire wire_;
  base::Clock clock_ = base::Clock::live();
  detail::PublishingComponent owner_;
  detail::Topics topics_;
  detail::Inbox inbox_;
  detail::PublisherCore* core_ = nullptr;
  detail::Subscription* subscription_ = nullptr;
  std::unique_ptr<Import> import_;
};

std::string name_of(const detail::Envelope& envelope) {
  return static_cast<const SourceCodeInfo_Location&>(*envelope.payload).leading_comments();
}

std::string long_name(int number) {
  return "a name that does not fit into a string itself, number " + std::to_string(number);
}

/// Runs `publisher` and `receiver` in a process each; both must hold.
void run_both(Processes& processes, const std::function<void()>& publisher,
              const std::function<void()>& receiver) {
  processes.announce(kPublisher, 1);
  processes.announce(kReceiver, 1);
  const pid_t child = fork();
  if (child == 0) {
    ASSERT_EQ(processes.segments.become(kPublisher, 0), std::nullopt);
    publisher();
    std::fflush(nullptr);
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  EXPECT_TRUE(holds_in_child([&] {
    ASSERT_EQ(processes.segments.become(kReceiver, 0), std::nullopt);
    receiver();
  }));
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "the publisher: " << status;
}

/// Reads it once when it is there: a receiver that forges may take it back at any time.
void await_connection(Publishing& publishing, ProcessIndex receiver = kReceiver) {
  for (int i = 0; i < 50'000; ++i) {
    if (publishing.to(receiver).is_connected()) {
      return;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  FAIL() << "the receiver has not connected";
}

/// Writes `count` words of nonsense, most of it nearly right, into all that the receiver of the
/// link may write.
void forge(const Processes& processes, std::uint64_t count, std::mt19937_64& random) {
  const Wire wire = processes.wire();
  const LinkPlan& link = processes.link();
  LinkIn& in = wire.in(link, 1);
  std::atomic<std::uint64_t>* const returns = wire.returns(link, 1, 1);
  const std::uint64_t return_count = Wire::return_count(link);
  const LinkOut& out = wire.out(link, 1);
  constexpr std::uint64_t kReady = std::uint64_t{1} << 32 | 1;
  in.ready.store(kReady);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t tail = out.tail.load();
    const std::uint64_t any = random();
    const std::uint64_t near = tail + any % 64 - 48;
    switch (random() % 16) {
      case 0:
        in.taking.store(any % 2 == 0 ? near : any);
        break;
      case 1:
        in.ready.store(any % 4 == 0 ? any : kReady);
        break;
      case 2:
        in.oldest.store(static_cast<std::uint32_t>(any));
        break;
      case 3:
        wire.sleepers(kReceiver, 1, 0).store(static_cast<std::uint32_t>(any));
        break;
      case 4:
        in.finished.store(any % 2 == 0 ? near : any);
        break;
      default: {
        const std::uint64_t place = any % (return_count * 2);
        const std::uint64_t word =
            random() % 8 == 0 ? random() : to_word(near, random() % (link.capacity + 4));
        returns[place % return_count].store(
            (word & ~kLapBit) |
            (any % 8 == 0 ? any & kLapBit : lap_of_return(place, return_count)));
      }
    }
  }
  in.ready.store(kReady);
}

TEST(MessagesBetweenProcesses, ArriveAsTheSameObjectInOrderAndWithoutACopy) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(16, 48);
    constexpr int kCount = 2000;
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          for (int i = 1; i <= kCount; ++i) {
            publishing.publish([i](auto& message) {
              auto& file = static_cast<SourceCodeInfo_Location&>(message);
              file.set_leading_comments(long_name(i));
              for (int j = 0; j < i % 5; ++j) {
                file.add_leading_detached_comments(long_name(j));
              }
            });
            if (i % 8 == 0) {
              std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
          }
          const ExportCounts counts = publishing.to().counts();
          EXPECT_EQ(counts.copied, 0U);
          EXPECT_EQ(counts.repaired, 0U);
          EXPECT_EQ(counts.refused, 0U);
          EXPECT_EQ(counts.given + counts.over_quota, std::uint64_t{kCount});
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          std::uint64_t last = 0;
          while (last < kCount - 16) {
            detail::Envelope* const envelope = receiving.await();
            ASSERT_NE(envelope, nullptr);
            EXPECT_GT(envelope->info.sequence, last);
            last = envelope->info.sequence;
            const auto& file = static_cast<const SourceCodeInfo_Location&>(*envelope->payload);
            ASSERT_EQ(file.leading_comments(), long_name(static_cast<int>(last)));
            ASSERT_EQ(file.leading_detached_comments_size(), static_cast<int>(last) % 5);
            detail::release(envelope);
          }
          EXPECT_TRUE(receiving.ledger().adds_up());
        });
  }));
}

TEST(MessagesBetweenProcesses, AreCountedAlsoIfTheLastOnesAreLost) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 12, true);
    constexpr std::uint64_t kCount = 20;
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          for (std::uint64_t i = 0; i < kCount; ++i) {
            publishing.publish_file("name");
          }
          EXPECT_GT(publishing.to().counts().overflowed, 0U);
          processes.progress.reach(1);
          processes.progress.await(2);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          processes.progress.await(1);
          while (receiving.from().take()) {
          }
          const std::uint64_t taken = receiving.ledger().published;
          EXPECT_LT(taken, kCount);

          receiving.from().count_rest();
          receiving.from().count_rest();  // Nothing is counted twice.

          while (detail::Envelope* const envelope = receiving.next()) {
            detail::release(envelope);
          }
          const detail::Ledger ledger = receiving.ledger();
          EXPECT_EQ(ledger.published, kCount);
          EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(detail::DropReason::kProcess)],
                    kCount - taken);
          EXPECT_TRUE(ledger.adds_up());
          processes.progress.reach(2);
        });
  }));
}

TEST(MessagesBetweenProcesses, CannotBeWrittenByWhoReceivesThem) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes;
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          publishing.publish_file(long_name(1));
          processes.progress.await(1);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          detail::Envelope* const envelope = receiving.await();
          ASSERT_NE(envelope, nullptr);
          auto* const message = const_cast<google::protobuf::Message*>(envelope->payload);
          const int status = status_of([&] {
            std::signal(SIGSEGV, SIG_DFL);
            static_cast<SourceCodeInfo_Location*>(message)->set_leading_comments("forged");
          });
          EXPECT_FALSE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
          // Nor can it be made writable.
          const auto page = reinterpret_cast<std::uintptr_t>(message) & ~std::uintptr_t{4095};
          EXPECT_NE(mprotect(reinterpret_cast<void*>(page), 4096, PROT_READ | PROT_WRITE), 0);
          EXPECT_EQ(name_of(*envelope), long_name(1));
          detail::release(envelope);
          processes.progress.reach(1);
        });
  }));
}

TEST(MessagesBetweenProcesses, AreCopiedWhereTheyDidNotLieInTheSegment) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes;
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, Struct::default_instance());
          await_connection(publishing);
          publishing.publish([](auto& message) {  // Its type has a map, which is not looked into.
            (*static_cast<Struct&>(message).mutable_fields())["speed"].set_number_value(12.5);
          });
          EXPECT_EQ(publishing.to().counts().copied, 1U);
          EXPECT_STREQ(publishing.to().always_copied(), "its type has maps");
          processes.progress.await(1);
        },
        [&] {
          Receiving receiving(processes, 1, Struct::default_instance());
          detail::Envelope* const envelope = receiving.await();
          ASSERT_NE(envelope, nullptr);
          const auto& fields = static_cast<const Struct&>(*envelope->payload).fields();
          EXPECT_DOUBLE_EQ(fields.at("speed").number_value(), 12.5);
          detail::release(envelope);
          processes.progress.reach(1);
        });
  }));
}

TEST(MessagesBetweenProcesses, AreCopiedWhereTheyWereFilledInALaterActivation) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes;
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          publishing.publish_later([](auto& message) {
            auto& location = static_cast<SourceCodeInfo_Location&>(message);
            location.set_leading_comments(long_name(1));
            for (int i = 0; i < 1000; ++i) {
              location.add_path(i);
            }
          });
          EXPECT_EQ(publishing.to().counts().copied, 1U);
          EXPECT_EQ(publishing.to().counts().unshared, 0U);
          processes.progress.await(1);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          detail::Envelope* const envelope = receiving.await();
          ASSERT_NE(envelope, nullptr);
          EXPECT_EQ(name_of(*envelope), long_name(1));
          detail::release(envelope);
          processes.progress.reach(1);
        });
  }));
}

TEST(MessagesBetweenProcesses, AreDroppedOldestFirstAndCountedWhereTheReceiverIsLate) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 12);
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          for (int i = 1; i <= 10; ++i) {
            publishing.publish_file(long_name(i));
          }
          EXPECT_EQ(publishing.to().counts().overflowed, 6U);
          processes.progress.reach(1);
          processes.progress.await(2);  // All that waited was taken.
          publishing.publish_file(long_name(11));
          processes.progress.await(3);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          processes.progress.await(1);
          std::vector<std::uint64_t> sequences;
          while (sequences.empty() || sequences.back() < 11) {
            detail::Envelope* const envelope = receiving.await();
            ASSERT_NE(envelope, nullptr);
            sequences.push_back(envelope->info.sequence);
            detail::release(envelope);
            if (sequences.back() == 10) {
              processes.progress.reach(2);
            }
          }
          processes.progress.reach(3);
          EXPECT_THAT(sequences, testing::ElementsAre(7, 8, 9, 10, 11));
          const detail::Ledger ledger = receiving.ledger();
          EXPECT_EQ(ledger.published, 11U);
          EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(detail::DropReason::kProcess)], 6U);
        });
  }));
}

// Many small ones may wait, but large ones must not take all memory where the receiver stands
// still.
TEST(MessagesBetweenProcesses, AreDroppedSoonerWhereTheyAreLarge) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(64, 100, false, 1, 4);
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          for (int i = 1; i <= 16; ++i) {
            publishing.publish_file(long_name(i));
          }
          EXPECT_EQ(publishing.to().counts().overflowed, 0U);
          processes.progress.reach(1);
          processes.progress.await(2);  // All that waited was taken, and came back.
          for (int i = 17; i <= 26; ++i) {
            publishing.publish_file(std::string(kBytesOut / 5, 'x'));
          }
          EXPECT_EQ(publishing.to().counts().overflowed, 5U);
          processes.progress.reach(3);
          processes.progress.await(4);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          processes.progress.await(1);
          const auto receive = [&](std::uint64_t first, std::uint64_t last) {
            for (std::uint64_t sequence = first; sequence <= last; ++sequence) {
              detail::Envelope* const envelope = receiving.await();
              ASSERT_NE(envelope, nullptr);
              EXPECT_EQ(envelope->info.sequence, sequence);
              detail::release(envelope);
            }
          };
          receive(1, 16);
          processes.progress.reach(2);
          processes.progress.await(3);
          receive(17, 21);
          processes.progress.reach(4);
        });
  }));
}

// Who keeps all that it gets loses further messages; its publisher and others go on.
TEST(MessagesBetweenProcesses, AreBoundedByAQuotaOfTheReceiver) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 8);
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          std::uint64_t published = 0;
          while (!processes.progress.has_reached(1)) {  // Until the receiver keeps its quota.
            publishing.publish_file(long_name(static_cast<int>(++published)));
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
          }
          const std::uint64_t given = publishing.to().counts().given;
          for (int i = 0; i < 40; ++i) {
            publishing.publish_file(long_name(static_cast<int>(++published)));
          }
          EXPECT_EQ(publishing.to().counts().given, given);
          EXPECT_EQ(given + publishing.to().counts().over_quota, published);
          processes.progress.reach(2);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance(), 64);
          std::vector<detail::Envelope*> kept;
          for (int i = 0; i < 8; ++i) {
            kept.push_back(receiving.await());
            ASSERT_NE(kept.back(), nullptr);
          }
          processes.progress.reach(1);
          processes.progress.await(2);
          receiving.from().take();
          EXPECT_EQ(receiving.from().held(), 8U);
          for (std::size_t i = 0; i < kept.size(); ++i) {
            EXPECT_EQ(name_of(*kept[i]), long_name(static_cast<int>(kept[i]->info.sequence)));
            detail::release(kept[i]);
          }
        });
  }));
}

TEST(MessagesBetweenProcesses, AreUnharmedByAReceiverThatWritesNonsenseIntoAllThatItMay) {
  const char* const given = std::getenv("FASTCYCLE_FORGERIES");
  const std::uint64_t forgeries = given == nullptr ? 200'000 : std::stoull(given);
  ASSERT_TRUE(holds_in_child([forgeries] {
    Processes processes(8, 16, false, 2);
    processes.plan.links.front().credits = 4;
    for (const ProcessIndex process : {kPublisher, kReceiver, kSecondReceiver}) {
      processes.announce(process, 1);
    }
    const pid_t publisher = fork();
    if (publisher == 0) {
      EXPECT_EQ(processes.segments.become(kPublisher, 0), std::nullopt);
      Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
      await_connection(publishing);
      await_connection(publishing, kSecondReceiver);
      int number = 0;
      // Until the forger has ended.
      while (processes.wire().incarnation(kReceiver).load() == 1) {
        publishing.publish_file(long_name(++number));
        EXPECT_LE(publishing.credits().left(0), 4U);
        publishing.credits().await();
        static_cast<void>(publishing.credits().take_foreign());
        static_cast<void>(publishing.credits().take_returned());
        if (publishing.to().counts().refused > 1000) {
          processes.progress.reach(1);
        }
      }
      // Again and again: the other one may be behind, and lose it.
      while (processes.wire().incarnation(kSecondReceiver).load() == 1) {
        publishing.publish_file("the last");
      }
      std::fflush(nullptr);
      _exit(testing::Test::HasFailure() ? 1 : 0);
    }
    const pid_t honest = fork();
    if (honest == 0) {
      EXPECT_EQ(processes.segments.become(kSecondReceiver, 0), std::nullopt);
      Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance(), 16,
                          kSecondReceiver);
      std::vector<detail::Envelope*> kept;  // While the publisher goes on.
      for (bool is_last = false; !is_last && !testing::Test::HasFailure();) {
        detail::Envelope* const envelope = receiving.await();
        kept.push_back(envelope);
        is_last = envelope == nullptr || name_of(*envelope) == "the last";
        if (kept.size() == 4 || is_last) {
          for (detail::Envelope* const each : kept) {
            if (each != nullptr && name_of(*each) != "the last") {
              EXPECT_EQ(name_of(*each), long_name(static_cast<int>(each->info.sequence)));
              detail::release(each);
            }
          }
          kept.clear();
        }
      }
      std::fflush(nullptr);
      _exit(testing::Test::HasFailure() ? 1 : 0);
    }
    const pid_t forger = fork();
    if (forger == 0) {
      if (!processes.segments.become(kReceiver, 0)) {
        std::mt19937_64 random(forgeries);
        const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
        forge(processes, forgeries, random);
        while (!processes.progress.has_reached(1)) {  // The publisher may have begun late.
          if (std::chrono::steady_clock::now() > until) {
            _exit(1);
          }
          forge(processes, 10'000, random);
        }
      }
      _exit(0);
    }
    int status = 0;
    waitpid(forger, &status, 0);
    EXPECT_EQ(status, 0) << "the publisher refused hardly any of it";
    processes.announce(kReceiver, 0);
    waitpid(honest, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
    processes.announce(kSecondReceiver, 0);
    waitpid(publisher, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }));
}

// Over a serialized link the receiver has a copy of its own, and holds nothing of the publisher.
TEST(MessagesBetweenProcesses, AreCopiedAndParsedWhereTheirPublisherIsNotTrusted) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 12, false, 1, 16, true);
    run_both(
        processes,
        [&] {
          Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
          await_connection(publishing);
          for (int i = 1; i <= 100; ++i) {
            processes.progress.await(i - 1);
            publishing.publish_file(long_name(i));
          }
          processes.progress.await(100);
          publishing.to().collect();
          const ExportCounts counts = publishing.to().counts();
          EXPECT_EQ(counts.given, 100U);
          EXPECT_EQ(counts.copied, 100U);
          EXPECT_EQ(counts.refused, 0U);
        },
        [&] {
          Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
          std::vector<detail::Envelope*> kept;
          for (int i = 1; i <= 100; ++i) {
            detail::Envelope* const envelope = receiving.await();
            ASSERT_NE(envelope, nullptr);
            EXPECT_EQ(name_of(*envelope), long_name(i));
            EXPECT_EQ(envelope->info.sequence, static_cast<std::uint64_t>(i));
            EXPECT_FALSE(base::shared_memory.has(envelope->payload));
            kept.push_back(envelope);
            if (kept.size() == 4) {
              detail::release(kept.front());
              kept.erase(kept.begin());
            }
            processes.progress.reach(i);
          }
          EXPECT_EQ(receiving.from().refused(), 0U);
          EXPECT_EQ(receiving.from().held(), 0U);
          for (detail::Envelope* const envelope : kept) {
            detail::release(envelope);
          }
        });
  }));
}

/// Writes `count` words of nonsense, most of it nearly right, into all that the publisher of the
/// link may write. `valid` are the bytes of a message there.
void forge_messages(const Processes& processes, std::uint64_t count, std::string_view valid,
                    std::mt19937_64& random) {
  const Wire wire = processes.wire();
  const LinkPlan& link = processes.link();
  LinkOut& out = wire.out(link, 1);
  std::atomic<std::uint64_t>* const slots = wire.slots(link, 1);
  WireMessage* const messages = wire.messages(link, 1);
  auto* const trails = reinterpret_cast<std::uint64_t*>(wire.trails(link, 1));
  const std::size_t trail_words = link.capacity * sizeof(detail::Trail) / sizeof(std::uint64_t);
  const char* const own = processes.segments.control(kPublisher, 0);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t any = random();
    const std::uint64_t tail = out.tail.load();
    WireMessage& message = messages[any % link.capacity];
    switch (random() % 8) {
      case 0:
        // With a random tail it would only lose its own messages, from then on.
        out.tail.store(tail + any % (any % 16 == 0 ? 100'000 : 12));
        break;
      case 1:
        message.bytes.store(any % 4 == 0   ? reinterpret_cast<const char*>(any)
                            : any % 4 == 1 ? own + any % (std::uint64_t{1} << 30)
                                           : valid.data());
        break;
      case 2:
        message.byte_count.store(any % 4 == 0   ? random()
                                 : any % 4 == 1 ? random() % 4096
                                                : valid.size());
        break;
      case 3:
        std::memcpy(static_cast<void*>(&message.info), &any, sizeof(any));
        message.info.sequence = random() % 8 == 0 ? random() : any % 1000;
        break;
      case 4:
        std::atomic_ref(trails[any % trail_words]).store(random() % 3 == 0 ? random() : any % 40);
        break;
      default: {
        const std::uint64_t position = tail + any % 4;
        const std::uint64_t number = random() % (link.capacity + 1);
        if (number < link.capacity) {
          messages[number].position.store(position);
          messages[number].receiver.store(1);
        }
        slots[position % Wire::slot_count(link)].store(to_word(position, number));
        out.tail.store(position + 1);
      }
    }
  }
}

// Whatever a publisher that is not trusted writes, at any time: its receiver gets valid messages or
// none, and is not held up.
TEST(MessagesBetweenProcesses, OfAPublisherThatWritesNonsenseHarmNobodyWhereItIsNotTrusted) {
  const char* const given = std::getenv("FASTCYCLE_FORGERIES");
  const std::uint64_t forgeries = given == nullptr ? 200'000 : std::stoull(given);
  ASSERT_TRUE(holds_in_child([forgeries] {
    Processes processes(8, 16, false, 1, 16, true, 1);
    for (const ProcessIndex process : {kPublisher, kReceiver}) {
      processes.announce(process, 1);
    }
    const pid_t forger = fork();
    if (forger == 0) {
      if (!processes.segments.become(kPublisher, 0)) {
        SourceCodeInfo_Location message;
        message.set_leading_comments(long_name(1));
        const std::string bytes = message.SerializeAsString();
        auto* const place = static_cast<char*>(processes.segments.allocate(bytes.size(), 16));
        std::ranges::copy(bytes, place);
        std::mt19937_64 random(forgeries);
        for (std::uint64_t done = 0; done < forgeries || !processes.progress.has_reached(1);
             done += 1000) {
          forge_messages(processes, 1000, {place, bytes.size()}, random);
        }
        processes.progress.reach(2);
      }
      _exit(0);
    }
    EXPECT_TRUE(holds_in_child([&] {
      ASSERT_EQ(processes.segments.become(kReceiver, 0), std::nullopt);
      Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
      const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
      std::uint64_t valid = 0;
      while (!processes.progress.has_reached(2) && std::chrono::steady_clock::now() < until) {
        receiving.from().take();
        while (detail::Envelope* const envelope = receiving.next()) {
          ++valid;
          EXPECT_TRUE(name_of(*envelope).empty() || name_of(*envelope) == long_name(1));
          EXPECT_LE(envelope->trails[0].hops().size(), detail::Trail::kMaxHops);
          EXPECT_EQ(envelope->info.publisher, receiving.publisher());
          detail::release(envelope);
        }
        if (!processes.progress.has_reached(1) && valid > 100 &&
            receiving.from().refused() > 1000) {
          processes.progress.reach(1);
        }
      }
      EXPECT_TRUE(processes.progress.has_reached(2))
          << valid << " valid messages, " << receiving.from().refused() << " refused";
    }));
    kill(forger, SIGKILL);
    int status = 0;
    waitpid(forger, &status, 0);
  }));
}

// What a receiver held, or was on its way to it, comes back when it has ended; the next one gets
// what is published from then on.
TEST(MessagesBetweenProcesses, ComeBackFromAReceiverThatWasKilled) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 8);
    processes.announce(kPublisher, 1);
    processes.announce(kReceiver, 1);
    const auto receive = [&](std::uint32_t incarnation) {
      const pid_t child = fork();
      if (child == 0) {
        if (processes.segments.become(kReceiver, Wire::generation_of(incarnation))) {
          _exit(1);
        }
        Receiving receiving(processes, incarnation, SourceCodeInfo_Location::default_instance());
        std::vector<detail::Envelope*> kept;
        for (;;) {
          kept.push_back(receiving.await());
          processes.progress.reach(static_cast<int>(incarnation));
          if (incarnation > 1 && kept.back() != nullptr) {
            _exit(name_of(*kept.back()).empty() ? 1 : 0);
          }
        }
      }
      return child;
    };
    const pid_t first = receive(1);
    const pid_t publisher = fork();
    if (publisher == 0) {
      EXPECT_EQ(processes.segments.become(kPublisher, 0), std::nullopt);
      Publishing publishing(processes, 1, SourceCodeInfo_Location::default_instance());
      await_connection(publishing);
      for (int i = 1; !processes.progress.has_reached(2); ++i) {
        publishing.publish_file(long_name(i));
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
      EXPECT_GT(publishing.to().counts().taken_back, 0U);
      _exit(testing::Test::HasFailure() ? 1 : 0);
    }
    processes.progress.await(1);
    kill(first, SIGKILL);
    int status = 0;
    waitpid(first, &status, 0);
    processes.announce(kReceiver, 0);
    const pid_t second = receive(2);
    processes.announce(kReceiver, 2);
    waitpid(second, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    waitpid(publisher, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }));
}

TEST(MessagesBetweenProcesses, StayWholeForWhoHoldsThemWhenTheirPublisherIsMadeAnew) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes(4, 8);
    processes.announce(kPublisher, 1);
    processes.announce(kReceiver, 1);
    const auto publish = [&](std::uint32_t incarnation) {
      const pid_t child = fork();
      if (child == 0) {
        if (processes.segments.become(kPublisher, Wire::generation_of(incarnation))) {
          _exit(1);
        }
        Publishing publishing(processes, incarnation, SourceCodeInfo_Location::default_instance());
        await_connection(publishing);
        for (;;) {
          publishing.publish_file(long_name(static_cast<int>(incarnation) * 1000));
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
      }
      return child;
    };
    const pid_t first = publish(1);
    const pid_t receiver = fork();
    if (receiver == 0) {
      EXPECT_EQ(processes.segments.become(kReceiver, 0), std::nullopt);
      Receiving receiving(processes, 1, SourceCodeInfo_Location::default_instance());
      detail::Envelope* const old = receiving.await();
      processes.progress.reach(1);
      std::string newest;
      while (old != nullptr && newest != long_name(2000)) {
        detail::Envelope* const fresh = receiving.await();
        if (fresh == nullptr) {
          break;
        }
        newest = name_of(*fresh);
        detail::release(fresh);
      }
      EXPECT_EQ(newest, long_name(2000));
      EXPECT_EQ(name_of(*old), long_name(1000));
      std::fflush(nullptr);
      _exit(testing::Test::HasFailure() ? 1 : 0);
    }
    processes.progress.await(1);
    kill(first, SIGKILL);
    int status = 0;
    waitpid(first, &status, 0);
    processes.announce(kPublisher, 0);
    const pid_t second = publish(2);
    processes.announce(kPublisher, 2);
    waitpid(receiver, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    kill(second, SIGKILL);
    waitpid(second, &status, 0);
  }));
}

TEST(ALayout, FindsWhatReflectionFinds) {
  EXPECT_TRUE(Layout::holds_here());
}

TEST(ALoanScope, PutsWhatLibrariesAllocateIntoTheSegment) {
  ASSERT_TRUE(holds_in_child([] {
    Processes processes;
    ASSERT_EQ(processes.segments.become(kPublisher, 0), std::nullopt);
    std::string outside(100, 'a');
    EXPECT_FALSE(base::shared_memory.has(outside.data()));
    const LoanScope scope;
    std::string inside;
    inside.append(1000, 'b');  // Grows within libstdc++.
    SourceCodeInfo_Location parsed;
    EXPECT_TRUE(
        parsed.ParseFromString("\x1a\x03"
                               "abc"));
    EXPECT_TRUE(base::shared_memory.is_own(inside.data()));
    EXPECT_TRUE(base::shared_memory.is_own(&parsed.leading_comments()));
  }));
}

}  // namespace
}  // namespace fastcycle::segment
