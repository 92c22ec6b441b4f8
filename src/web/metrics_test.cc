#include "web/metrics.h"

#include <set>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fastcycle::web {
namespace {

namespace protocol = inspect::protocol;
using ::testing::HasSubstr;
using ::testing::Not;

protocol::Overview make_overview() {
  protocol::Overview overview;
  overview.set_application("drive \"one\"");
  overview.set_cpu_ns(1'500'000'000);
  overview.set_virtual_kib(3);
  overview.set_open_files(7);
  overview.set_max_files(1024);
  overview.set_process_start_ns(1'500'000'000);
  protocol::Thread& thread = *overview.add_threads();
  thread.set_name("control-0");
  thread.set_cpu_ns(250'000'000);
  thread.set_count(1);
  protocol::Process& other = *overview.add_processes();
  other.set_name("sensing");
  other.set_cpu_ns(2'500'000'000);
  other.set_rss_kib(2);
  *other.add_threads() = thread;
  overview.set_mode("nominal");
  overview.add_modes("nominal");
  overview.add_modes("degraded");
  protocol::Component& component = *overview.add_components();
  component.set_name("planner");
  component.set_state("active");
  component.set_health("ok");
  component.set_activations(7);
  component.mutable_callback()->set_count(3);
  component.mutable_callback()->set_mean_ns(2000.0);
  auto& bucket = *component.mutable_callback()->add_buckets();
  bucket.set_bound_ns(1024);
  bucket.set_count(1);
  protocol::Topic& topic = *overview.add_topics();
  topic.set_name("plan");
  protocol::Publisher& publisher = *topic.add_publishers();
  publisher.set_component("planner");
  publisher.set_published(9);
  for (int i = 0; i < 2; ++i) {
    protocol::Subscriber& subscriber = *topic.add_subscribers();
    subscriber.set_component("control");
    subscriber.set_depth(4);
    subscriber.mutable_ledger()->set_delivered(4);
    protocol::Drop& drop = *subscriber.mutable_ledger()->add_drops();
    drop.set_reason("overflow");
    drop.set_count(2);
  }
  return overview;
}

const auto kChains = nlohmann::json::parse(R"([{"name": "braking", "count": 5, "breaches": 2,
                                                "dropped": 1, "deadline_ms": 100}])");

TEST(Metrics, SayWhatTheApplicationSays) {
  const std::string text = to_metrics(make_overview(), kChains, {.connections_refused = 3}, {});

  EXPECT_THAT(text, HasSubstr("# TYPE process_cpu_seconds_total counter\n"
                              "process_cpu_seconds_total 1.5\n"));
  EXPECT_THAT(text, HasSubstr("process_virtual_memory_bytes 3072\n"));
  EXPECT_THAT(text, HasSubstr("process_open_fds 7\n"));
  EXPECT_THAT(text, HasSubstr("process_max_fds 1024\n"));
  EXPECT_THAT(text, HasSubstr("process_start_time_seconds 1.5\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_thread_cpu_seconds_total{thread=\"control-0\"} 0.25\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_threads{thread=\"control-0\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_threads{thread=\"control-0\",process=\"sensing\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_process_cpu_seconds_total{process=\"sensing\"} 2.5\n"));
  EXPECT_THAT(text,
              HasSubstr("fastcycle_process_resident_memory_bytes{process=\"sensing\"} 2048\n"));
  EXPECT_THAT(text, HasSubstr("application=\"drive \\\"one\\\"\""));
  EXPECT_THAT(text, HasSubstr("fastcycle_mode{mode=\"degraded\"} 0\n"));
  EXPECT_THAT(text,
              HasSubstr("fastcycle_component_state{component=\"planner\",state=\"active\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_component_activations_total{component=\"planner\"} 7\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_component_callback_duration_seconds_bucket{component="
                              "\"planner\",le=\"1.024e-06\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("_bucket{component=\"planner\",le=\"+Inf\"} 3\n"
                              "fastcycle_component_callback_duration_seconds_sum{component="
                              "\"planner\"} 6e-06\n"));
  // Subscriptions of one component to one topic are one series.
  EXPECT_THAT(text, HasSubstr("fastcycle_subscription_dropped_messages_total{topic=\"plan\","
                              "component=\"control\",reason=\"overflow\"} 4\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_chain_breached_messages_total{chain=\"braking\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("fastcycle_live_connections_refused_total 3\n"));
  EXPECT_THAT(text, Not(HasSubstr("# EOF")));
  EXPECT_THAT(to_metrics({}, nullptr, {}, {}), Not(HasSubstr("fastcycle_chain")));
  EXPECT_THAT(to_metrics({}, nullptr, {}, {}), Not(HasSubstr("process_max_fds")));
}

TEST(Metrics, HaveTheWordsOfOpenMetricsForWhoAsksForThese) {
  const MetricsFormat format = choose_format("application/openmetrics-text;version=1.0.0,*/*");
  EXPECT_EQ(format, MetricsFormat::kOpenMetrics);
  EXPECT_EQ(choose_format("text/plain"), MetricsFormat::kText);
  const std::string text = to_metrics(make_overview(), kChains, {}, format);
  EXPECT_THAT(text, HasSubstr("# TYPE process_cpu_seconds counter\n# UNIT process_cpu_seconds "
                              "seconds\nprocess_cpu_seconds_total 1.5\n"));
  EXPECT_TRUE(text.ends_with("# EOF\n"));
}

TEST(Metrics, NameEachSeriesOnce) {
  std::set<std::string> seen;
  std::istringstream lines(to_metrics(make_overview(), kChains, {}, {}));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with('#')) {
      EXPECT_TRUE(seen.insert(line.substr(0, line.rfind(' '))).second) << line;
    }
  }
  EXPECT_GT(seen.size(), 30U);
}

}  // namespace
}  // namespace fastcycle::web
