// All ways to call a component in one application: it must repeat itself, however many workers
// serve it.

#include <chrono>
#include <map>
#include <string>
#include <variant>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "host/test_application.h"
#include "host/test_everything.h"

namespace fastcycle::host {
namespace {

using everything::kApplication;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

/// What each component wrote, and each ledger, after one second.
std::map<std::string, std::string> run_with(unsigned workers) {
  TestClasses classes;
  everything::add_classes(classes);
  const auto application =
      make_application(kApplication, classes, {.is_simulated = true, .workers = workers});
  application->start();
  application->run(1s);
  application->stop();
  std::map<std::string, std::string> results;
  for (const auto& component : application->components()) {
    if (const auto diary = component->results.find("diary"); diary != component->results.end()) {
      results[component->name] = std::get<std::string>(diary->second);
    }
    for (const std::string& fault : component->faults) {
      results[component->name] += "fault " + fault + "\n";
    }
  }
  for (const auto& [name, topic] : application->topics().all()) {
    for (const auto& subscription : topic->subscriptions) {
      const detail::Ledger ledger = subscription->ledger();
      EXPECT_TRUE(ledger.adds_up()) << name << " of " << subscription->component;
      results["ledgers"] +=
          name + " " + subscription->component + " " + std::to_string(ledger.published) + " " +
          std::to_string(ledger.delivered) + " " + std::to_string(ledger.dropped_total()) + "\n";
    }
  }
  return results;
}

TEST(Everything, AtOnceIsTheSameWithAnyNumberOfWorkers) {
  const auto alone = run_with(1);

  // So much happens in it.
  EXPECT_THAT(alone.at("fusion"), HasSubstr("reply ok"));
  EXPECT_THAT(alone.at("fusion"), HasSubstr("reply rejected"));
  EXPECT_THAT(alone.at("fusion"), HasSubstr("reply late"));
  EXPECT_THAT(alone.at("fusion"), HasSubstr("reply faulted"));
  EXPECT_THAT(alone.at("scaler"), HasSubstr("restarting in"));
  EXPECT_THAT(alone.at("supervisor"), HasSubstr("parked cancelled"));
  EXPECT_THAT(alone.at("supervisor"), HasSubstr("parked ok"));
  EXPECT_THAT(alone.at("supervisor"), HasSubstr("200000 status degraded"));
  EXPECT_THAT(alone.at("supervisor"), HasSubstr("250000 not changed"));
  EXPECT_THAT(alone.at("supervisor"), HasSubstr("300000 changed"));
  EXPECT_THAT(alone.at("fallback"), HasSubstr("200000 active"));
  EXPECT_THAT(alone.at("fallback"), HasSubstr("600000 inactive"));
  EXPECT_THAT(alone.at("wheel"), HasSubstr("event 0"));
  EXPECT_THAT(alone.at("unloader"), HasSubstr("tile 500\n"));

  EXPECT_EQ(run_with(2), alone);
  EXPECT_EQ(run_with(4), alone);
  EXPECT_EQ(run_with(1), alone);
}

}  // namespace
}  // namespace fastcycle::host
