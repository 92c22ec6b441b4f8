#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "benchmark/payload.pb.h"
#include "measure/clock.h"

namespace {

using fastcycle::benchmark::Payload;

std::string topic_name(std::int64_t number) {
  return "topic_" + std::to_string(number);
}

/// One of many: publishes one message on each of the topics in "publishes", and records when it has
/// received a message on all of those in "subscribes".
class BenchmarkNode final : public fastcycle::Component {
 public:
  explicit BenchmarkNode(fastcycle::Context& context)
      : Component(context),
        source_(context.param<bool>("ends_run", {.fallback = true}).get()
                    ? std::optional(context.create_source())
                    : std::nullopt),
        timer_(context.create_timer([this] { publish_all(); })) {
    using Topics = std::vector<std::int64_t>;
    const auto publishes = context.param<Topics>("publishes", {.fallback = Topics()});
    for (const std::int64_t topic : publishes.get()) {
      publishers_.push_back(context.create_publisher<Payload>(topic_name(topic)));
    }
    const auto subscribes = context.param<Topics>("subscribes", {.fallback = Topics()});
    for (const std::int64_t topic : subscribes.get()) {
      context.create_subscriber<Payload>(topic_name(topic), [this](const Payload&) { take(); });
    }
    awaited_ = static_cast<std::int64_t>(subscribes.get().size());
  }

  void start() override { timer_.arm_at(now()); }

  void stop() override {
    report("awaited", awaited_);
    report("all_arrived_ns", all_arrived_ns_);
    report("message_bytes", static_cast<std::int64_t>(Payload().SpaceUsedLong()));
  }

 private:
  void publish_all() {
    for (auto& publisher : publishers_) {
      publisher.publish(publisher.loan());
    }
    finish_if_done();
  }

  void take() {
    --awaited_;
    all_arrived_ns_ = fastcycle::measure::now_ns();
    finish_if_done();
  }

  void finish_if_done() {
    if (awaited_ <= 0 && source_) {
      source_->finish();
    }
  }

  std::optional<fastcycle::Source> source_;
  fastcycle::Timer timer_;
  std::vector<fastcycle::Publisher<Payload>> publishers_;
  std::int64_t awaited_ = 0;
  std::int64_t all_arrived_ns_ = 0;
};

}  // namespace

FASTCYCLE_COMPONENT(BenchmarkNode)
