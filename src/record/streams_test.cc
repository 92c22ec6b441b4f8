#include "record/streams.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::record {
namespace {

using detail::ActivationRecord;
using detail::ActivationRing;
using detail::Outcome;
using detail::ReadKind;
using detail::ReadRing;
using testing::ElementsAre;
using testing::IsEmpty;

/// A process of two components of which the second one runs there, by one worker.
class Peer final : public detail::PeerActivity {
 public:
  static constexpr std::uint32_t kTheirs = 1;

  Peer() {
    for (Incarnation& one : incarnations_) {
      one.rings = {.workers = {&one.worker}, .reads = {nullptr, &one.learned}};
    }
  }

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] const std::vector<std::string>& worker_names() const override { return names_; }
  [[nodiscard]] std::int64_t pid() const override { return 1; }
  [[nodiscard]] std::uint32_t incarnation() const override { return present_; }
  [[nodiscard]] const Rings& rings(std::uint32_t incarnation) const override {
    return incarnations_[incarnation - 1].rings;
  }

  void restart() { ++present_; }
  void end() { present_ = 0; }
  void come_as(std::uint32_t incarnation) { present_ = incarnation; }

  void begin(ActivationRecord record) {
    Incarnation& present = incarnations_[present_ - 1];
    record.number = ++present.count;
    present.record = record;
    present.place = present.worker.begin(record);
    present.learned.begin(record.number);
  }
  void learn(std::uint64_t value) {
    incarnations_[present_ - 1].learned.add(ReadKind::kMode, 0, 0, value);
  }
  void finish() {
    Incarnation& present = incarnations_[present_ - 1];
    present.record.outcome = Outcome::kDone;
    present.worker.end(present.place, present.record);
  }
  void run(std::uint32_t component = kTheirs) {
    begin({.component = component});
    finish();
  }

 private:
  struct Incarnation {
    ActivationRing worker;
    ReadRing learned{16};
    Rings rings;
    ActivationRecord record;
    std::uint64_t place = 0;
    std::uint64_t count = 0;
  };
  const std::string name_ = "peer";
  const std::vector<std::string> names_{"worker"};
  std::array<Incarnation, kReadable> incarnations_;
  std::uint32_t present_ = 1;
};

class ActivationsOfOthers : public testing::Test {
 protected:
  /// What the reader gives: worker, incarnation, number and what was learned, of each activation.
  std::vector<std::string> read() {
    std::vector<std::string> all;
    reader_.read([&](const NewActivations& its) {
      for (const ActivationRecord& record : its.records) {
        std::string text = std::to_string(its.worker) + "/" + std::to_string(its.incarnation) +
                           "#" + std::to_string(record.number);
        text += record.outcome == Outcome::kRunning ? " runs" : "";
        for (const detail::Read& read : reader_.seen_in(record).reads) {
          text += " " + std::to_string(read.value);
        }
        all.push_back(text);
      }
    });
    return all;
  }

  ActivationRing own_;
  Peer peer_;
  ActivationReader reader_{
      Activity{.rings = {&own_}, .reads = {nullptr, nullptr}, .peers = {&peer_}}};
};

TEST_F(ActivationsOfOthers, ComeWithWhatTheyLearned) {
  peer_.begin({.component = Peer::kTheirs});
  peer_.learn(7);
  peer_.finish();
  peer_.begin({.component = Peer::kTheirs});

  EXPECT_THAT(read(), ElementsAre("1/1#1 7"));

  peer_.learn(8);
  peer_.finish();
  EXPECT_THAT(read(), ElementsAre("1/1#2 8"));
  EXPECT_THAT(read(), IsEmpty());
}

TEST_F(ActivationsOfOthers, EndWithTheOneInWhichTheProcessEnded) {
  peer_.run();
  peer_.begin({.component = Peer::kTheirs});
  EXPECT_THAT(read(), ElementsAre("1/1#1"));

  peer_.end();

  EXPECT_THAT(read(), ElementsAre("1/1#2 runs"));
  EXPECT_THAT(read(), IsEmpty());
}

TEST_F(ActivationsOfOthers, GoOnWithThoseOfTheRestartedProcess) {
  peer_.run();
  peer_.restart();
  peer_.run();

  EXPECT_THAT(read(), ElementsAre("1/1#1", "1/2#1"));

  peer_.run();
  peer_.end();
  EXPECT_THAT(read(), ElementsAre("1/2#2"));
  peer_.come_as(3);
  peer_.run();
  EXPECT_THAT(read(), ElementsAre("1/3#1"));
}

TEST_F(ActivationsOfOthers, OfAllRunsThatEndedMeanwhileAreThere) {
  for (int i = 0; i < 3; ++i) {
    peer_.run();
    peer_.restart();
  }
  peer_.run();

  EXPECT_THAT(read(), ElementsAre("1/1#1", "1/2#1", "1/3#1", "1/4#1"));
}

TEST_F(ActivationsOfOthers, OfComponentsThatRunElsewhereAreLeftOut) {
  peer_.run(0);
  peer_.run(2);
  peer_.run(0xffff'ffff);
  peer_.begin({.component = Peer::kTheirs, .cause = static_cast<detail::Cause>(200)});
  peer_.finish();
  peer_.run();
  own_.end(own_.begin({.component = Peer::kTheirs, .number = 1}), {.outcome = Outcome::kDone});

  EXPECT_THAT(read(), ElementsAre("1/1#5"));
}

TEST_F(ActivationsOfOthers, CannotKeepTheReaderFromItsEnd) {
  for (const int byte : {0x01, 0x7f, 0xff}) {
    const auto words = std::make_unique<ActivationRing>();
    std::memset(static_cast<void*>(words.get()), byte, sizeof(ActivationRing));
    std::vector<ActivationRecord> records;
    std::uint64_t next = 0;
    EXPECT_GT(words->read(next, records), 0U);
    EXPECT_THAT(records, IsEmpty());

    alignas(64) std::array<char, 4096> memory{};
    std::memset(memory.data(), byte, memory.size());
    const ReadRing learned(memory.data(), 16);
    std::vector<detail::Read> reads;
    next = 0;
    EXPECT_GT(learned.read(next, reads), 0U);
    EXPECT_THAT(reads, IsEmpty());
  }
}

}  // namespace
}  // namespace fastcycle::record
