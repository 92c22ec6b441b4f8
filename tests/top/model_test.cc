#include "top/model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace fastcycle::tool::top {
namespace {

using testing::ElementsAre;
using testing::Pair;

/// How an application with one component and one topic is after so many seconds.
Snapshot after(double seconds) {
  Snapshot snapshot;
  auto& overview = snapshot.overview;
  overview.set_application("drive");
  overview.set_pid(7);
  overview.set_clock("live");
  overview.set_end("running");
  overview.set_start_ns(1'000'000'000);
  overview.set_now_ns(1'000'000'000 + static_cast<std::int64_t>(seconds * 1e9));
  overview.set_monotonic_ns(static_cast<std::int64_t>(seconds * 1e9));
  overview.set_cpu_ns(static_cast<std::int64_t>(seconds * 0.4e9));
  auto* component = overview.add_components();
  component->set_name("planner");
  component->set_state("active");
  component->set_activations(static_cast<std::uint64_t>(seconds * 100));
  component->set_busy_ns(static_cast<std::int64_t>(seconds * 0.25e9));
  auto* topic = overview.add_topics();
  topic->set_name("plan");
  topic->set_published(static_cast<std::uint64_t>(seconds * 50));
  return snapshot;
}

TEST(AModel, HasNoRatesAtFirst) {
  const Model model = model_of(nullptr, after(2));

  EXPECT_EQ(model.application, "drive");
  EXPECT_DOUBLE_EQ(model.up_s, 2);
  EXPECT_EQ(model.interval_s, std::nullopt);
  EXPECT_EQ(model.cpu_percent, std::nullopt);
  EXPECT_EQ(model.components.at(0).activations_hz, std::nullopt);
  EXPECT_EQ(model.components.at(0).activations, 200U);
  EXPECT_EQ(model.topics.at(0).rate_hz, std::nullopt);
}

TEST(AModel, HasTheRatesBetweenTwoLooks) {
  const Snapshot before = after(2);

  const Model model = model_of(&before, after(4));

  EXPECT_DOUBLE_EQ(model.interval_s.value(), 2);
  EXPECT_DOUBLE_EQ(model.cpu_percent.value(), 40);
  EXPECT_DOUBLE_EQ(model.messages_hz.value(), 50);
  EXPECT_DOUBLE_EQ(model.components.at(0).cpu_percent.value(), 25);
  EXPECT_DOUBLE_EQ(model.components.at(0).activations_hz.value(), 100);
  EXPECT_DOUBLE_EQ(model.topics.at(0).rate_hz.value(), 50);
}

TEST(AModel, HasNoRateOfWhatWasCountedAnew) {
  Snapshot before = after(2);
  before.overview.mutable_components(0)->set_activations(1'000'000);
  before.overview.mutable_topics(0)->set_published(1'000'000);

  const Model model = model_of(&before, after(4));

  EXPECT_EQ(model.components.at(0).activations_hz, std::nullopt);
  EXPECT_DOUBLE_EQ(model.components.at(0).cpu_percent.value(), 25) << "that went on";
  EXPECT_EQ(model.topics.at(0).rate_hz, std::nullopt);
  EXPECT_EQ(model.messages_hz, std::nullopt);
}

TEST(AModel, HasNoRatesAcrossTwoRuns) {
  Snapshot before = after(2);
  before.overview.set_pid(6);

  EXPECT_EQ(model_of(&before, after(4)).components.at(0).activations_hz, std::nullopt);
}

TEST(AModel, HasNoRatesBetweenTwoLooksAtOneMoment) {
  const Snapshot before = after(2);

  const Model model = model_of(&before, after(2));

  EXPECT_EQ(model.components.at(0).activations_hz, std::nullopt);
  EXPECT_EQ(model.cpu_percent, std::nullopt);
}

TEST(AModel, HasNoRateOfWhatIsNew) {
  Snapshot before = after(2);
  before.overview.clear_topics();

  EXPECT_EQ(model_of(&before, after(4)).topics.at(0).rate_hz, std::nullopt);
}

TEST(AModel, AddsLossesByReason) {
  Snapshot now = after(2);
  auto* topic = now.overview.mutable_topics(0);
  topic->set_dropped(8);
  for (const std::uint64_t count : {3U, 4U}) {
    auto* subscriber = topic->add_subscribers();
    subscriber->set_depth(10);
    auto* ledger = subscriber->mutable_ledger();
    ledger->set_queued(count);
    auto* drop = ledger->add_drops();
    drop->set_reason("overflow");
    drop->set_count(count);
  }
  auto* drop = topic->mutable_subscribers(1)->mutable_ledger()->add_drops();
  drop->set_reason("pool");
  drop->set_count(1);

  const Model model = model_of(nullptr, now);

  EXPECT_THAT(model.topics.at(0).drops, ElementsAre(Pair("overflow", 7U), Pair("pool", 1U)));
  EXPECT_EQ(model.topics.at(0).queued, 4U) << "of the fullest queue";
  EXPECT_EQ(model.dropped, 8U);
}

TEST(AModel, KnowsBandwidthWhereSizesAreKnown) {
  const Snapshot before = after(2);
  Snapshot now = after(4);
  EXPECT_EQ(model_of(&before, now).topics.at(0).bytes_per_s, std::nullopt);

  now.overview.mutable_topics(0)->set_message_bytes(1000);
  EXPECT_DOUBLE_EQ(model_of(&before, now).topics.at(0).bytes_per_s.value(), 50'000);
}

constexpr const char* kChains = R"([{"name": "lidar_to_brake", "from": "lidar", "to": "brake",
  "deadline_ms": 100, "on_breach": "drop", "count": 50, "breaches": 4, "dropped": 4,
  "age_us": {"p50": 20000, "p99": 110000, "max": 120000},
  "hops": [{"component": "lidar_driver", "topic": "lidar", "count": 50, "breaches": 0,
            "waiting_us": {"p50": 1, "p99": 2, "max": 3}, "running_us": null},
           {"component": "brake", "topic": null, "count": 50, "breaches": 4,
            "waiting_us": {"p50": 10, "p99": 20, "max": 30}, "running_us": null}],
  "largest_contributor": {"component": "brake", "topic": null, "part": "waiting", "breaches": 4}}])";

TEST(AModel, HasTheApplicationsChains) {
  Snapshot before = after(2);
  before.chains = R"([{"name": "lidar_to_brake", "count": 10, "breaches": 2}])";
  Snapshot now = after(4);
  now.chains = kChains;

  const Model model = model_of(&before, now);

  ASSERT_EQ(model.chains.size(), 1U);
  const ChainRow& chain = model.chains[0];
  EXPECT_EQ(chain.name, "lidar_to_brake");
  EXPECT_DOUBLE_EQ(chain.deadline_ns, 100e6);
  EXPECT_DOUBLE_EQ(chain.age.value().p99_ns, 110e6);
  EXPECT_DOUBLE_EQ(chain.breaches_hz.value(), 1);
  EXPECT_EQ(chain.contributor, "brake waiting");
  ASSERT_EQ(chain.hops.size(), 2U);
  EXPECT_EQ(chain.hops[1].topic, "");
  EXPECT_EQ(chain.hops[1].breaches, 4U);
  EXPECT_DOUBLE_EQ(chain.hops[1].waiting.value().max_ns, 30e3);
}

TEST(AModel, HasNoChainsWhereTheirDocumentIsNone) {
  Snapshot now = after(4);
  for (const char* document : {"", "{", "{}", "[]", "null"}) {
    now.chains = document;
    EXPECT_TRUE(model_of(nullptr, now).chains.empty()) << document;
  }
  now.chains = R"([3, {"name": 4, "hops": 5, "largest_contributor": 6, "age_us": 7}])";
  EXPECT_EQ(model_of(nullptr, now).chains.size(), 2U);
}

TEST(AModel, IsADocumentWithNullForWhatIsNotKnown) {
  const Snapshot before = after(2);

  const nlohmann::ordered_json json = to_json(model_of(&before, after(4)));

  EXPECT_EQ(json.at("application"), "drive");
  EXPECT_EQ(json.at("mode"), nullptr);
  EXPECT_EQ(json.at("end"), nullptr);
  EXPECT_DOUBLE_EQ(json.at("components").at(0).at("cpu_percent"), 25);
  EXPECT_EQ(json.at("components").at(0).at("callback_us"), nullptr);
  EXPECT_EQ(json.at("topics").at(0).at("dropped"), nlohmann::json::object());
}

}  // namespace
}  // namespace fastcycle::tool::top
