#pragma once

// For tests: an application in which components are called in all ways that there are.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <google/protobuf/wrappers.pb.h>

#include "fastcycle/fastcycle.h"
#include "host/test_application.h"
#include "status/status.pb.h"

namespace fastcycle::host::everything {

using google::protobuf::Int64Value;
using google::protobuf::StringValue;
using namespace std::chrono_literals;

/// Writes down what happened to it and when, for the report, and publishes each line.
class Diarist : public Component {
 public:
  explicit Diarist(Context& context)
      : Component(context),
        lines_(context.create_publisher<StringValue>("diary/" + context.component_name())) {}

  void stop() override { report("diary", diary_); }

 protected:
  void note(const std::string& what) {
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now() - start_time());
    const std::string line = std::to_string(us.count()) + " " + what + "\n";
    diary_ += line;
    auto out = lines_.loan();
    out->set_value(line);
    lines_.publish(std::move(out));
  }

 private:
  Publisher<StringValue> lines_;
  std::string diary_;
};

/// Publishes about every 10 ms, now and then nothing, and is silent for a while in the middle.
class Sensor final : public Diarist {
 public:
  explicit Sensor(Context& context)
      : Diarist(context),
        measured_(context.create_publisher<Int64Value>(context.component_name() + "/measured")),
        timer_(context.create_timer([this] { measure(); })) {}

  void start() override { timer_.arm_at(now() + 1ms); }

 private:
  void measure() {
    ++count_;
    const auto chance = random()() % 10;
    const bool is_silent = count_ > 40 && count_ < 50;
    if (chance != 0 && !is_silent) {
      auto out = measured_.loan();
      out->set_value(count_);
      measured_.publish(std::move(out));
    }
    timer_.arm_at(now() + 9ms + std::chrono::microseconds(random()() % 2000));
  }

  Publisher<Int64Value> measured_;
  Timer timer_;
  std::int64_t count_ = 0;
};

/// Joins two sensors, and has the sum scaled by a service.
class Fusion final : public Diarist {
 public:
  explicit Fusion(Context& context)
      : Diarist(context),
        offset_(context.param<std::int64_t>("offset", {.fallback = 0, .is_tunable = true})),
        fused_(context.create_publisher<Int64Value>("fused")),
        scale_(context.create_client<Int64Value, Int64Value>("scale")) {
    context.create_synchronizer<Int64Value, Int64Value>(
        {"/left/measured", "/right/measured"},
        {.policy = SyncPolicy::kApproximate, .max_difference = 6ms},
        [this](const Int64Value& left, const Int64Value& right) {
          auto request = scale_.loan();
          request->set_value(left.value() * 1000 + right.value());
          scale_.call(std::move(request), {.deadline = 5ms},
                      [this](const Reply<Int64Value>& reply) {
                        note(std::string("reply ") + to_word(reply.status()));
                        if (reply.ok()) {
                          auto out = fused_.loan();
                          out->set_value(reply->value() + offset_.get());
                          fused_.publish(std::move(out));
                        }
                      });
        });
  }

 private:
  Param<std::int64_t> offset_;
  Publisher<Int64Value> fused_;
  Client<Int64Value, Int64Value> scale_;
};

/// Serves "scale": mostly at once, now and then too late or not at all; throws once in its life.
class Scaler final : public Diarist {
 public:
  explicit Scaler(Context& context)
      : Diarist(context),
        factor_(context.param<std::int64_t>("factor", {.fallback = 2, .is_tunable = true})),
        later_(context.create_timer([this] { answer_late(); })) {
    context.create_service<Int64Value, Int64Value>(
        "scale", [this](const Int64Value& request, Responder<Int64Value> responder) {
          const std::int64_t value = request.value();
          if (value / 1000 % 29 == 25) {
            throw std::runtime_error("it does not like " + std::to_string(value));
          }
          if (value % 9 == 4) {
            responder.reject("nines and fours");
          } else if (value % 5 == 2) {
            late_ = std::move(responder);
            later_.arm_at(now() + 8ms);
          } else {
            auto reply = responder.loan();
            reply->set_value(value * factor_.get());
            responder.answer(std::move(reply));
          }
        });
  }

 private:
  void answer_late() {
    if (late_) {
      late_->answer(late_->loan());
      late_.reset();
    }
  }

  Param<std::int64_t> factor_;
  Timer later_;
  std::optional<Responder<Int64Value>> late_;
};

/// Works on goals: one step a call of its Serve Timer.
class Parker final : public Diarist {
 public:
  using Goal = ServerGoal<Int64Value, Int64Value>;

  explicit Parker(Context& context) : Diarist(context) {
    context.create_action_server<Int64Value, Int64Value, Int64Value>(
        "park", [this](const Int64Value& wanted, Goal goal) {
          wanted_ = wanted.value();
          done_ = 0;
          goal_ = std::move(goal);
        });
  }

  void serve() override {
    if (!goal_ || !goal_->is_active()) {
      return;
    }
    auto step = goal_->loan_feedback();
    step->set_value(++done_);
    goal_->publish(std::move(step));
    if (done_ == wanted_) {
      auto result = goal_->loan();
      result->set_value(done_);
      goal_->succeed(std::move(result));
    }
  }

 private:
  std::optional<Goal> goal_;
  std::int64_t wanted_ = 0;
  std::int64_t done_ = 0;
};

/// Steers by what is fused, while it is active.
class Driver final : public Diarist {
 public:
  explicit Driver(Context& context)
      : Diarist(context), steered_(context.create_publisher<Int64Value>("steered")) {
    context.create_subscriber<Int64Value>("fused", [this](const Int64Value& fused) {
      auto out = steered_.loan();
      out->set_value(fused.value());
      steered_.publish(std::move(out));
    });
  }

  void activate() override { note("active"); }
  void deactivate() override { note("inactive"); }

 private:
  Publisher<Int64Value> steered_;
};

/// Listens to what is steered, with a deadline and a lifespan, and works so long that it is late.
class Wheel final : public Diarist {
 public:
  explicit Wheel(Context& context) : Diarist(context) {
    context.create_subscriber<Int64Value>(
        "steered",
        {.depth = 2,
         .deadline = 40ms,
         .on_event =
             [this](const QosEvent& event) {
               note("event " + std::to_string(static_cast<int>(event.kind)) + " " +
                    std::to_string(event.count));
             }},
        [this](const Sample<Int64Value>& steered) {
          note("steered " + std::to_string(steered->value()) + " taken " +
               std::to_string((now() - steered.info().origin.taken).count()));
        });
  }
};

/// Sends as much as there is room for.
class Loader final : public Diarist {
 public:
  explicit Loader(Context& context)
      : Diarist(context),
        tiles_(context.create_publisher<Int64Value>(
            "tiles", {.credits = 3, .on_credits = [this] { send(); }})),
        count_(context.state<Int64Value>("count")) {}

  void serve() override { send(); }

 private:
  void send() {
    while (count_->value() < 500 && tiles_.credits() > 0) {
      auto tile = tiles_.loan();
      count_->set_value(count_->value() + 1);
      tile->set_value(count_->value());
      tiles_.publish(std::move(tile));
    }
  }

  Publisher<Int64Value> tiles_;
  State<Int64Value> count_;
};

class Unloader final : public Diarist {
 public:
  explicit Unloader(Context& context) : Diarist(context) {
    context.create_subscriber<Int64Value>("tiles", {.depth = 3}, [this](const Int64Value& tile) {
      note("tile " + std::to_string(tile.value()));
    });
  }
};

/// Looks after all of them: modes, parameters, goals, and a subscription that comes and goes.
class Supervisor final : public Diarist {
 public:
  explicit Supervisor(Context& context)
      : Diarist(context),
        park_(context.create_action_client<Int64Value, Int64Value, Int64Value>("park")) {
    context.create_subscriber<status::Status>(
        "/fastcycle/status", [this](const status::Status& status) {
          std::uint64_t drops = 0;
          for (const auto& subscription : status.subscriptions()) {
            for (const auto& drop : subscription.drops()) {
              drops += drop.count();
            }
          }
          std::string failed;
          for (const auto& component : status.components()) {
            failed +=
                component.faults() > 0 ? component.name() + ": " + component.last_fault() : "";
          }
          note("status " + status.mode() + " " + std::to_string(drops) + " " + failed);
        });
  }

  void serve() override {
    switch (++calls_) {
      case 10:
      case 50:
        send_goal();
        break;
      case 12:
        parking_.cancel();
        break;
      case 20:
        context().switch_mode("degraded", "the test says so");
        break;
      case 25:
        change("[7]");  // No number: nothing may change.
        break;
      case 30:
        change("7");
        break;
      case 35:
        tiles_ = context().create_subscriber<Int64Value>("tiles", [](const Int64Value&) {});
        break;
      case 45:
        tiles_.reset();
        break;
      case 60:
        context().switch_mode("nominal", "all is well again");
        break;
      default:
        break;
    }
  }

 private:
  void send_goal() {
    auto goal = park_.loan();
    goal->set_value(5);
    parking_ = park_.send(
        std::move(goal),
        {.on_feedback =
             [this](const Int64Value& step) { note("step " + std::to_string(step.value())); }},
        [this](const Reply<Int64Value>& result) {
          note(std::string("parked ") + to_word(result.status()));
        });
  }

  void change(const std::string& offset) {
    context().change_params({{"fusion.offset", offset}, {"scaler.factor", "3"}},
                            [this](const ParamsResult& result) {
                              note(result.has_changed() ? "changed" : "not changed");
                            });
  }

  ActionClient<Int64Value, Int64Value, Int64Value> park_;
  Call parking_;
  std::optional<Subscriber> tiles_;
  int calls_ = 0;
};

/// Has a thread of its own, as the driver of a device, which publishes at times of its own.
class Device final : public Diarist {
 public:
  explicit Device(Context& context)
      : Diarist(context),
        read_(context.create_external_publisher<Int64Value>("device", {.credits = 16})) {
    context.create_thread("device", [this](const std::stop_token& stop) {
      for (std::int64_t i = 1; i <= 200 && !stop.stop_requested(); ++i) {
        auto out = read_.loan();
        out->set_value(i);
        read_.publish(std::move(out), read_.now());
        std::this_thread::sleep_for(2ms);
      }
    });
    context.create_subscriber<Int64Value>("device", [this](const Sample<Int64Value>& read) {
      if (read->value() % 16 == 0) {
        note("read " + std::to_string(read->value()) + " " +
             std::to_string((now() - read.info().publish_time).count()) + " " +
             std::to_string((read_.now() - now()).count()) + " credits " +
             std::to_string(read_.credits()) + " listeners " +
             std::to_string(read_.subscriber_count()));
      }
    });
  }

 private:
  ExternalPublisher<Int64Value> read_;
};

/// Looks at all that it is not called for, asks the world, and has work done elsewhere.
class Watcher final : public Diarist {
 public:
  explicit Watcher(Context& context)
      : Diarist(context),
        device_(context.create_latest<Int64Value>("device")),
        fused_(context.create_history<Int64Value>("fused", {.depth = 8, .span = 100ms})),
        seen_(context.create_publisher<Int64Value>("seen")) {}

  void serve() override {
    ++calls_;
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < fused_.size(); ++i) {
      sum += fused_[i]->value();
    }
    const auto latest = device_.get();
    const auto clock = observe(
        "clock", [] { return std::chrono::system_clock::now().time_since_epoch().count(); });
    const std::string words = observe(
        "words", [this] { return std::string(static_cast<std::size_t>(calls_ % 20), 'w'); });
    note("mode " + context().mode() + " device " +
         (latest ? std::to_string(latest->value()) + " " + std::to_string(device_.age()->count())
                 : "none") +
         " fused " + std::to_string(sum) + " of " + std::to_string(fused_.size()) + " listeners " +
         std::to_string(seen_.subscriber_count()) + " clock " + std::to_string(clock) + words);
    if (calls_ % 5 == 0) {
      // Two at once, which may end in any order.
      for (const std::uint64_t size : {20'000U, 10U}) {
        auto result = std::make_shared<std::uint64_t>(0);
        context().offload(
            "pool",
            [result, size] {
              for (std::uint64_t i = 0; i < size; ++i) {
                *result = *result * 31 + i;
              }
            },
            [this, result, size] {
              note("work " + std::to_string(size) + " " + std::to_string(*result));
            });
      }
    }
    if (calls_ % 40 == 0) {
      context().offload("pool", [] { throw std::runtime_error("too hard"); }, [] {});
    }
    auto out = seen_.loan();
    out->set_value(sum);
    seen_.publish(std::move(out));
  }

 private:
  Latest<Int64Value> device_;
  History<Int64Value> fused_;
  Publisher<Int64Value> seen_;
  int calls_ = 0;
};

inline constexpr const char* kApplication = R"({
  "name": "everything",
  "status_period_ms": 100,
  "modes": {"nominal": {"components": ["driver"]}, "degraded": {"components": ["fallback"]}},
  "initial_mode": "nominal",
  "topics": {"steered": {"multiple_publishers": true}, "fused": {"latched": 1}},
  "components": [
    {"name": "supervisor", "library": "supervisor", "serve_period_ms": 10},
    {"name": "left", "library": "sensor"},
    {"name": "right", "library": "sensor", "after": ["left"]},
    {"name": "fusion", "library": "fusion"},
    {"name": "scaler", "library": "scaler", "on_fault": "restart",
     "restart": {"limit": 10, "back_off_ms": 20}},
    {"name": "parker", "library": "parker", "serve_period_ms": 7},
    {"name": "driver", "library": "driver"},
    {"name": "fallback", "library": "driver"},
    {"name": "wheel", "library": "wheel"},
    {"name": "loader", "library": "loader", "serve_period_ms": 50},
    {"name": "unloader", "library": "unloader"}]})";

/// The same, with a thread, offloaded work and all that follows from the machine's clock.
inline std::string live_application() {
  std::string text = kApplication;
  text.erase(text.rfind("]}"));
  return text + R"(,
    {"name": "device", "library": "device"},
    {"name": "watcher", "library": "watcher", "serve_period_ms": 4, "on_fault": "restart",
     "restart": {"limit": 50, "back_off_ms": 3},
     "subscribers": {"fused": {"lifespan_ms": 60}}}]})";
}

inline void add_classes(TestClasses& classes) {
  classes.with<Supervisor>("supervisor")
      .with<Sensor>("sensor")
      .with<Fusion>("fusion")
      .with<Scaler>("scaler")
      .with<Parker>("parker")
      .with<Driver>("driver")
      .with<Wheel>("wheel")
      .with<Loader>("loader")
      .with<Unloader>("unloader")
      .with<Device>("device")
      .with<Watcher>("watcher");
}

}  // namespace fastcycle::host::everything
