#include <algorithm>
#include <chrono>
#include <string>

#include <fastcycle/fastcycle.h>

namespace {

using namespace std::chrono_literals;

enum class Style { kCalm, kBrisk };

// Approaches its target speed, and says where it is.
class Cruise final : public fastcycle::Component {
 public:
  explicit Cruise(fastcycle::Context& context)
      : Component(context),
        target_mps_(context.param<double>("target_mps", {.fallback = 14.0,
                                                         .min = 0.0,
                                                         .max = 36.0,
                                                         .unit = "m/s",
                                                         .description = "The speed to reach",
                                                         .is_tunable = true})),
        style_(context.param<Style>(
            "style", {.fallback = Style::kCalm,
                      .names = {{"calm", Style::kCalm}, {"brisk", Style::kBrisk}}})) {
    context.on_change(target_mps_, [this](double target_mps) {
      log().info("from now on I want {} m/s", target_mps);
    });
  }

  void serve() override {
    const double step_mps = style_.get() == Style::kBrisk ? 4.0 : 2.0;
    const double missing_mps = target_mps_.get() - speed_mps_;
    speed_mps_ += std::clamp(missing_mps, -step_mps, step_mps);
    log().info("{} m/s", speed_mps_);
  }

 private:
  fastcycle::Param<double> target_mps_;
  fastcycle::Param<Style> style_;
  double speed_mps_ = 10.0;
};

// After a second and a half it comes into a town.
class Town final : public fastcycle::Component {
 public:
  explicit Town(fastcycle::Context& context)
      : Component(context), timer_(context.create_timer([this] { slow_down(); })) {}

  void activate() override { timer_.arm_at(now() + 1500ms); }

 private:
  void slow_down() {
    context().change_params({{"cruise.target_mps", "8"}},
                            [this](const fastcycle::ParamsResult& result) {
                              log().info("8 m/s: {}", result.has_changed() ? "done" : "refused");
                            });
    context().change_params(
        {{"cruise.target_mps", "80"}}, [this](const fastcycle::ParamsResult& result) {
          log().info("80 m/s: {}",
                     result.has_changed() ? std::string("done") : result.errors.front());
        });
  }

  fastcycle::Timer timer_;
};

}  // namespace

FASTCYCLE_COMPONENTS(Cruise, Town)
