#include "perception.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include <fastcycle/testing.h>
#include <gtest/gtest.h>

#include "lidar_model.h"

namespace ads {
namespace {

using fastcycle::testing::Bench;
using std::chrono_literals::operator""ms;

constexpr double kEgoSpeed_mps = 15.0;

// A vehicle that drives along +x, one that is 20 m ahead and 2 m/s slower, one to the left of it,
// and maybe somebody on two wheels to the right.
class SweepsTest : public ::testing::Test {
 protected:
  SweepsTest() {
    LidarConfig config;
    config.columns = 900;
    lidar_.emplace(config, 1);
  }

  static void place(world::Body& body, double x_m, double y_m) {
    body.set_x_m(x_m);
    body.set_y_m(y_m);
    body.set_length_m(4.6);
    body.set_width_m(1.9);
    body.set_height_m(1.5);
  }

  world::Scene scene_at(double time_s) const {
    world::Scene scene;
    scene.mutable_header()->set_taken_ns(begin_ns_ +
                                         static_cast<std::int64_t>(std::llround(time_s * 1e9)));
    scene.mutable_ego()->set_x_m(kEgoSpeed_mps * time_s);
    scene.add_bodies()->set_id(1);
    scene.add_bodies()->set_id(2);
    place(*scene.mutable_bodies(0), 20.0 + 13.0 * time_s, 0.0);
    place(*scene.mutable_bodies(1), left_m_ + kEgoSpeed_mps * time_s, 3.5);
    if (has_cyclist_) {
      world::Body& cyclist = *scene.add_bodies();
      cyclist.set_id(3);
      place(cyclist, 10.0 + 16.0 * time_s, -3.0);
      cyclist.set_length_m(1.8);
      cyclist.set_width_m(0.7);
    }
    return scene;
  }

  // Publishes the poses of 100 ms, and returns the sweep of that time.
  lidar::Sweep turn() {
    if (begin_ns_ == 0) {
      begin_ns_ = bench_.now().time_since_epoch().count();
    }
    const double begin_s = 0.1 * turns_++;
    lidar::Sweep sweep;
    sweep.mutable_points()->resize(lidar_->sweep_bytes());
    std::string& points = *sweep.mutable_points();
    const auto& config = lidar_->config();
    const world::Scene first = scene_at(begin_s);
    world::Scene before = first;
    for (int part = 0; part < 10; ++part) {
      const world::Scene after = scene_at(begin_s + 0.01 * (part + 1));
      lidar_->cast(before, after, first.header().taken_ns(), config.columns * part / 10,
                   config.columns * (part + 1) / 10, {points.data(), points.size()});
      before = after;
      bench_.advance(10ms);
      publish_ego(after);
    }
    sweep.mutable_header()->set_taken_ns(first.header().taken_ns());
    sweep.set_duration_ns(config.turn_ns);
    sweep.set_columns(static_cast<std::uint32_t>(config.columns));
    sweep.set_rings(static_cast<std::uint32_t>(config.rings));
    sweep.set_mount_height_m(config.mount_height_m);
    return sweep;
  }

  void publish_ego(const world::Scene& scene) {
    localization::Ego ego;
    ego.mutable_header()->set_taken_ns(scene.header().taken_ns());
    ego.set_x_m(scene.ego().x_m());
    ego.set_speed_mps(kEgoSpeed_mps);
    ego.set_quality(quality_);
    egos_.publish(ego);
  }

  perception::Objects give(const lidar::Sweep& sweep) {
    sweeps_.publish(sweep);
    const auto objects = objects_.take();
    EXPECT_EQ(objects.size(), 1U);
    return objects.back();
  }

  // The same for a recognizer alone.
  SweepResult give(const lidar::Sweep& sweep, Recognizer& recognizer) const {
    const std::int64_t taken_ns = sweep.header().taken_ns();
    EgoMotion motion;
    for (int part = 0; part <= 10; ++part) {
      const world::Scene scene =
          scene_at(1e-9 * static_cast<double>(taken_ns - begin_ns_) + 0.01 * part);
      motion.add({.time_ns = scene.header().taken_ns(),
                  .position_m = {scene.ego().x_m(), 0.0},
                  .speed_mps = kEgoSpeed_mps});
    }
    return recognizer.take({.taken_ns = taken_ns,
                            .duration_ns = sweep.duration_ns(),
                            .columns = sweep.columns(),
                            .rings = sweep.rings(),
                            .points = sweep.points(),
                            .mount_height_m = sweep.mount_height_m()},
                           motion);
  }

  perception::Objects drive(int turns) {
    perception::Objects objects;
    for (int turn_count = 0; turn_count < turns; ++turn_count) {
      objects = give(turn());
    }
    return objects;
  }

  double left_m_ = 12.0;  // Where the car to the left is.
  bool has_cyclist_ = false;
  localization::Quality quality_ = localization::GOOD;
  std::int64_t begin_ns_ = 0;
  int turns_ = 0;
  std::optional<LidarModel> lidar_;
  Bench bench_;
  Bench::Input<lidar::Sweep> sweeps_ = bench_.input<lidar::Sweep>("lidar/points");
  Bench::Input<localization::Ego> egos_ = bench_.input<localization::Ego>("localization/ego");
  Bench::Output<perception::Objects> objects_ =
      bench_.output<perception::Objects>("perception/objects");
};

class PerceptionTest : public SweepsTest {
 protected:
  PerceptionTest() { bench_.add<Perception>("perception", R"({"params": {"returns_min": 100}})"); }
};

TEST_F(PerceptionTest, BothCarsAreFoundWithTheirSpeed) {
  bench_.start();
  const auto objects = drive(15);

  EXPECT_TRUE(objects.is_sweep_valid());
  EXPECT_EQ(objects.reason(), "");
  EXPECT_EQ(objects.header().frame(), "map");
  EXPECT_GT(objects.ground_returns(), 10'000U);
  ASSERT_EQ(objects.objects_size(), 2);
  for (const auto& object : objects.objects()) {
    const bool is_ahead = std::abs(object.y_m()) < 1.0;
    EXPECT_NEAR(object.x_m(), is_ahead ? 20.0 + 13.0 * 1.5 : 12.0 + 15.0 * 1.5, 0.3);
    EXPECT_NEAR(object.y_m(), is_ahead ? 0.0 : 3.5, 0.15);
    EXPECT_NEAR(object.speed_mps(), is_ahead ? 13.0 : 15.0, 0.4);
    EXPECT_NEAR(object.heading_rad(), 0.0, 0.03);
    EXPECT_EQ(object.object_class(), perception::CAR);
    EXPECT_EQ(object.unseen_s(), 0.0);
  }
}

TEST_F(PerceptionTest, IdsStayTheSame) {
  bench_.start();
  const auto before = drive(6);
  const auto after = drive(8);

  ASSERT_EQ(before.objects_size(), 2);
  ASSERT_EQ(after.objects_size(), 2);
  EXPECT_EQ(after.objects(0).id(), before.objects(0).id());
  EXPECT_EQ(after.objects(1).id(), before.objects(1).id());
}

TEST(PerceptionRuns, SameSweepsGiveTheSameBytes) {
  const auto run = [] {
    class Run : public PerceptionTest {
     public:
      void TestBody() override {}
      std::string bytes() {
        bench_.start();
        return drive(8).SerializeAsString();
      }
    };
    return Run().bytes();
  };

  EXPECT_EQ(run(), run());
}

TEST_F(PerceptionTest, ObjectsHoldForTheEndOfTheSweep) {
  bench_.start();
  const auto sweep = turn();
  const auto objects = give(sweep);

  EXPECT_EQ(objects.header().taken_ns(), sweep.header().taken_ns() + sweep.duration_ns());
}

TEST_F(PerceptionTest, SweepThatIsNoNumberIsRefusedAndTheObjectsGoOn) {
  bench_.start();
  const auto before = drive(10);
  auto sweep = turn();
  spoil(*sweep.mutable_points());
  const auto objects = give(sweep);

  EXPECT_FALSE(objects.is_sweep_valid());
  EXPECT_NE(objects.reason().find("not finite"), std::string::npos) << objects.reason();
  EXPECT_GT(objects.invalid_returns(), 10'000U);
  ASSERT_EQ(objects.objects_size(), before.objects_size());
  EXPECT_NEAR(objects.objects(0).x_m() - before.objects(0).x_m(),
              0.1 * before.objects(0).speed_mps(), 0.1);
  EXPECT_GT(objects.objects(0).unseen_s(), 0.05);
}

TEST_F(PerceptionTest, BadSweepsAreRefusedWithTheirReason) {
  bench_.start();
  drive(3);
  auto empty = turn();
  empty.clear_points();
  EXPECT_EQ(give(empty).reason(), "the sweep is empty");

  auto cut = turn();
  cut.mutable_points()->resize(1000);
  EXPECT_NE(give(cut).reason().find("bytes"), std::string::npos);

  auto silent = turn();
  std::fill(silent.mutable_points()->begin(), silent.mutable_points()->end(), '\0');
  EXPECT_NE(give(silent).reason().find("returns"), std::string::npos);

  const auto late = turn();
  drive(5);
  EXPECT_NE(give(late).reason().find("0.3 s"), std::string::npos);

  auto endless = turn();
  endless.set_duration_ns(-5);
  EXPECT_NE(give(endless).reason().find("duration"), std::string::npos);

  EXPECT_TRUE(give(turn()).is_sweep_valid());
  bench_.stop();
  EXPECT_EQ(std::get<std::int64_t>(bench_.result("perception", "sweeps_invalid")), 5);
}

TEST_F(PerceptionTest, FewReturnsThatAreNoNumberAreLeftOut) {
  bench_.start();
  drive(5);
  auto sweep = turn();
  const float nothing = std::numeric_limits<float>::infinity();
  for (std::size_t offset = 0; offset < sweep.points().size(); offset += 16 * 50) {
    std::memcpy(sweep.mutable_points()->data() + offset, &nothing, sizeof nothing);
  }
  const auto objects = give(sweep);

  EXPECT_TRUE(objects.is_sweep_valid());
  EXPECT_GT(objects.invalid_returns(), 100U);
  EXPECT_EQ(objects.objects_size(), 2);
}

TEST_F(PerceptionTest, WithoutAPoseNothingIsRecognized) {
  bench_.start();
  quality_ = localization::INITIALIZING;
  const auto objects = drive(2);

  EXPECT_FALSE(objects.is_sweep_valid());
  EXPECT_EQ(objects.reason(), "localization/ego has no estimate");
}

TEST_F(PerceptionTest, UnseenObjectsAreForgotten) {
  bench_.start();
  drive(10);
  perception::Objects objects;
  for (int count = 0; count < 25; ++count) {
    auto sweep = turn();
    sweep.clear_points();
    objects = give(sweep);
  }

  EXPECT_EQ(objects.objects_size(), 0);
}

// The uncertainty of a car that was not seen for 1.5 s spans the one that drives behind it.
TEST_F(PerceptionTest, CarThatWasHiddenDoesNotBecomeTheOneBehindIt) {
  bench_.start();
  drive(10);
  for (int count = 0; count < 15; ++count) {
    auto sweep = turn();
    sweep.clear_points();
    give(sweep);
  }
  left_m_ -= 18.0;

  for (int count = 0; count < 4; ++count) {
    const auto objects = give(turn());
    for (const auto& object : objects.objects()) {
      EXPECT_GT(object.speed_mps(), 10.0) << count << ": " << object.ShortDebugString();
    }
  }
}

perception::TrackerState state_of(const Recognizer& recognizer) {
  perception::TrackerState state;
  recognizer.save(state);
  return state;
}

TEST(RecognizerState, EmptyIsThatOfANewRecognizer) {
  EXPECT_EQ(state_of(Recognizer(RecognizerConfig{})).SerializeAsString(), "");
}

// One recognizer takes all sweeps, the other one is made anew before each of them.
TEST_F(SweepsTest, RecognizerThatTakesOverAStateGoesOnBitForBit) {
  has_cyclist_ = true;
  bench_.start();
  RecognizerConfig config;
  config.returns_min = 100;
  Recognizer recognizer(config);
  std::string before;
  for (int count = 0; count < 12; ++count) {
    lidar::Sweep sweep = turn();
    if (count == 7) {
      sweep.clear_points();
    }
    perception::TrackerState state;
    ASSERT_TRUE(state.ParseFromString(before));
    Recognizer other(config);
    other.load(state);
    EXPECT_EQ(state_of(other).SerializeAsString(), before);

    EXPECT_EQ(give(sweep, recognizer).reason.empty(), count != 7);
    give(sweep, other);

    before = state_of(recognizer).SerializeAsString();
    EXPECT_EQ(state_of(other).SerializeAsString(), before) << "after sweep " << count;
  }

  const auto objects = state_of(recognizer).objects();
  ASSERT_EQ(objects.size(), 3);
  EXPECT_TRUE(
      std::ranges::all_of(objects, [](const auto& object) { return object.is_confirmed(); }));
  EXPECT_TRUE(std::ranges::any_of(objects, [](const auto& object) {
    return object.track().begin_length_m() < 2.0;
  })) << "nothing began as a two-wheeler";
}

TEST(RecognizerState, OfAnotherSizeIsRefused) {
  perception::TrackerState state;
  state.add_objects()->mutable_track()->add_state(1.0);
  Recognizer recognizer{RecognizerConfig{}};

  EXPECT_THROW(recognizer.load(state), std::invalid_argument);
}

// Perception that a test makes fail.
class FailingPerception final : public Perception {
 public:
  explicit FailingPerception(fastcycle::Context& context) : Perception(context) {
    context.create_subscriber<localization::Ego>(
        "fault", [](const localization::Ego&) { throw std::runtime_error("a fault on purpose"); });
  }
};

TEST(PerceptionRuns, ObjectThatIsMadeAnewGivesTheSameBytes) {
  class Run : public SweepsTest {
   public:
    void TestBody() override {}
    std::string bytes(bool fails) {
      bench_.add<FailingPerception>("perception",
                                    R"({"on_fault": "restart", "params": {"returns_min": 100}})");
      auto faults = bench_.input<localization::Ego>("fault");
      bench_.start();
      drive(6);
      if (fails) {
        faults.publish({});
      }
      const std::string bytes = drive(4).SerializeAsString();
      bench_.stop();
      EXPECT_EQ(bench_.faults("perception").size(), fails ? 1U : 0U);
      EXPECT_EQ(std::get<std::int64_t>(bench_.result("perception", "sweeps")), 10);
      EXPECT_EQ(std::get<std::int64_t>(bench_.result("perception", "objects_max")), 2);
      return bytes;
    }
  };

  EXPECT_EQ(Run().bytes(true), Run().bytes(false));
}

}  // namespace
}  // namespace ads
