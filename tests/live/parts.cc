// The components of the application that the commands look at.

#include <chrono>
#include <cstdint>
#include <string>

#include <fastcycle/fastcycle.h>

#include "live/reading.pb.h"

namespace {

/// Publishes readings, counted from 1, on `sensor/readings` in every Serve period, with an image of
/// so many bytes; says each 50th in the log.
class Sensor final : public fastcycle::Component {
 public:
  explicit Sensor(fastcycle::Context& context)
      : Component(context),
        image_bytes_(context.param<std::int64_t>("image_bytes", {.fallback = 1000, .min = 0})),
        readings_(context.create_publisher<live::Reading>("sensor/readings")) {}

  void serve() override {
    auto reading = readings_.loan();
    reading->set_value(++published_);
    reading->set_text("reading");
    reading->mutable_image()->assign(static_cast<std::size_t>(image_bytes_.get()), 'i');
    reading->clear_ranges();
    for (int i = 0; i < 100; ++i) {
      reading->add_ranges(i);
    }
    readings_.publish(std::move(reading));
    if (published_ % 50 == 0) {
      log().warning("fifty more readings");
    }
  }

 private:
  fastcycle::Param<std::int64_t> image_bytes_;
  fastcycle::Publisher<live::Reading> readings_;
  std::int64_t published_ = 0;
};

/// Publishes each reading again, times `gain`, and keeps below `limit`; doubles numbers on request;
/// says in the log what it receives on `orders`.
class Filter final : public fastcycle::Component {
 public:
  explicit Filter(fastcycle::Context& context)
      : Component(context),
        gain_(context.param<std::int64_t>(
            "gain", {.fallback = 2, .min = 1, .max = 100, .is_tunable = true})),
        limit_(context.param<double>("limit", {.fallback = 1e9,
                                               .min = 0.0,
                                               .unit = "m/s",
                                               .description = "What is kept below",
                                               .is_tunable = true})),
        filtered_(context.create_publisher<live::Reading>("sensor/filtered")) {
    context.create_subscriber<live::Reading>(
        "sensor/readings", [this](const live::Reading& reading) { on_reading(reading); });
    context.create_subscriber<live::Reading>("orders", [this](const live::Reading& order) {
      log().info("an order: {} {}", order.value(), order.text());
    });
    context.create_service<live::Question, live::Reply>(
        "double", [](const live::Question& question, live::Reply& reply) {
          reply.set_doubled(2 * question.value());
        });
  }

 private:
  void on_reading(const live::Reading& reading) {
    auto filtered = filtered_.loan();
    filtered->set_value(reading.value() * gain_.get());
    filtered_.publish(std::move(filtered));
  }

  fastcycle::Param<std::int64_t> gain_;
  fastcycle::Param<double> limit_;
  fastcycle::Publisher<live::Reading> filtered_;
};

/// Receives what was filtered.
class Display final : public fastcycle::Component {
 public:
  explicit Display(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<live::Reading>("sensor/filtered", [](const live::Reading&) {});
  }
};

}  // namespace

FASTCYCLE_COMPONENTS(Sensor, Filter, Display)
