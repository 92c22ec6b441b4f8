#include "component/wiring.h"

#include <cstdint>
#include <optional>
#include <thread>

#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"

namespace fastcycle::host {
namespace {

using google::protobuf::Int64Value;
using namespace std::chrono_literals;

class Numbers final : public Component {
 public:
  explicit Numbers(Context& context)
      : Component(context), numbers_(context.create_publisher<Int64Value>("numbers")) {}
  void serve() override { numbers_.publish(numbers_.loan()); }

 private:
  Publisher<Int64Value> numbers_;
};

/// Subscribes anew in every call of `serve`, and lets the last subscription go.
class Restless final : public Component {
 public:
  explicit Restless(Context& context) : Component(context) {}
  void serve() override {
    subscription_.reset();
    subscription_ = context().create_subscriber<Int64Value>(
        "numbers", [this](const Int64Value&) { report("received", ++received_); });
  }

 private:
  std::optional<Subscriber> subscription_;
  std::int64_t received_ = 0;
};

TEST(AWiring, ShowsItsTopicsWhileSubscriptionsComeAndGo) {
  TestClasses classes;
  classes.with<Numbers>("source").with<Restless>("restless");
  const auto application = make_application(R"({"name": "test", "components": [
      {"name": "source", "library": "source", "serve_period_ms": 0.2},
      {"name": "restless", "library": "restless", "serve_period_ms": 1}]})",
                                            classes);
  application->start();
  std::uint64_t looks = 0;
  std::uint64_t delivered = 0;
  while (delivered < 20) {
    application->wiring().look([&](const detail::Topics& topics) {
      delivered = 0;
      for (const auto& subscription : topics.find("numbers")->subscriptions) {
        delivered += subscription->ledger().delivered;
      }
    });
    ++looks;
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_GT(looks, 0U);
  application->stop();
  EXPECT_TRUE(ledger_of(*application, "numbers", "restless").adds_up());
}

}  // namespace
}  // namespace fastcycle::host
