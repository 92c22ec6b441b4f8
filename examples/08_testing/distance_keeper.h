#pragma once

#include <chrono>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

// Chooses a speed by the distance to what is ahead, and stops when it is blind.
class DistanceKeeper final : public fastcycle::Component {
 public:
  explicit DistanceKeeper(fastcycle::Context& context)
      : Component(context),
        gap_s_(context.param<double>("gap_s", {.fallback = 2.0, .min = 0.5, .max = 5.0})),
        speed_(context.create_publisher<example::Speed>("speed")),
        blind_(context.create_timer([this] { send(0.0); })) {
    context.create_subscriber<example::Scan>("scan", [this](const example::Scan& scan) {
      send(scan.nearest_m() / gap_s_.get());
      blind_.arm_at(now() + std::chrono::milliseconds(300));
    });
  }

 private:
  void send(double mps) {
    auto speed = speed_.loan();
    speed->set_mps(mps);
    speed_.publish(std::move(speed));
  }

  fastcycle::Param<double> gap_s_;
  fastcycle::Publisher<example::Speed> speed_;
  fastcycle::Timer blind_;
};
