#include <optional>

#include <fastcycle/fastcycle.h>

#include "example/messages.pb.h"

namespace {

// Takes an image each time that it is served.
class Camera final : public fastcycle::Component {
 public:
  explicit Camera(fastcycle::Context& context)
      : Component(context), images_(context.create_publisher<example::Scan>("image")) {}

  void serve() override {
    auto image = images_.loan();
    image->set_number(++number_);
    images_.publish(std::move(image), {.taken_at = now()});
  }

 private:
  fastcycle::Publisher<example::Scan> images_;
  int number_ = 0;
};

// Finds what is near in every image.
class Detector final : public fastcycle::Component {
 public:
  explicit Detector(fastcycle::Context& context)
      : Component(context), objects_(context.create_publisher<example::Scan>("objects")) {
    context.create_subscriber<example::Scan>("image", [this](const example::Scan& image) {
      auto objects = objects_.loan();
      objects->set_number(image.number());
      objects->set_nearest_m(20.0 + image.number() % 50);
      objects_.publish(std::move(objects));
    });
  }

 private:
  fastcycle::Publisher<example::Scan> objects_;
};

// Plans a speed: at a beat of its own, or whenever there are objects.
class Planner final : public fastcycle::Component {
 public:
  explicit Planner(fastcycle::Context& context)
      : Component(context), speed_(context.create_publisher<example::Speed>("speed")) {
    if (context.param<bool>("has_beat", {.fallback = true}).get()) {
      newest_.emplace(context.create_latest<example::Scan>("objects"));
    } else {
      context.create_subscriber<example::Scan>(
          "objects", [this](const example::Scan& objects) { plan(objects); });
    }
  }

  void serve() override {
    if (!newest_) {
      return;
    }
    if (const auto objects = newest_->get()) {
      plan(*objects);
    }
  }

 private:
  void plan(const example::Scan& objects) {
    auto speed = speed_.loan();
    speed->set_mps(objects.nearest_m() / 2.0);
    speed_.publish(std::move(speed));
  }

  fastcycle::Publisher<example::Speed> speed_;
  std::optional<fastcycle::Latest<example::Scan>> newest_;
};

// Drives as fast as it is commanded.
class Brake final : public fastcycle::Component {
 public:
  explicit Brake(fastcycle::Context& context) : Component(context) {
    context.create_subscriber<example::Speed>(
        "speed", [this](const example::Speed& speed) { report("mps", speed.mps()); });
  }
};

}  // namespace

FASTCYCLE_COMPONENTS(Camera, Detector, Planner, Brake)
