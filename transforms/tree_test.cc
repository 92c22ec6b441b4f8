#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <google/protobuf/wrappers.pb.h>
#include <gtest/gtest.h>

#include "fastcycle/testing.h"
#include "fastcycle/transforms.h"

namespace fastcycle::transforms {
namespace {

using google::protobuf::StringValue;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace std::chrono_literals;

/// What the frames of a tree are said to be: "topic parent child", separated by commas.
std::vector<MovingFrame> parse_moving(const std::string& text) {
  std::vector<MovingFrame> moving;
  std::istringstream words(text);
  MovingFrame frame;
  while (words >> frame.topic >> frame.parent >> frame.child) {
    moving.push_back(frame);
  }
  return moving;
}

/// Asked "a b 120" (milliseconds; without them the newest) it answers with the transform, or with
/// why there is none in the place of the child. Asked "?", it lists the problems.
class Asker final : public Component {
 public:
  explicit Asker(Context& context)
      : Component(context),
        tree_(context,
              {.moving = parse_moving(context.param<std::string>("moving", {.fallback = ""}).get()),
               .max_hold = std::chrono::milliseconds(
                   context.param<std::int64_t>("max_hold_ms", {.fallback = 0}).get())}),
        answers_(context.create_publisher<transform::Transform>("answer")) {
    context.create_subscriber<StringValue>(
        "ask", [this](const StringValue& question) { answer(question.value()); });
  }

 private:
  void answer(const std::string& question) {
    auto answer = answers_.loan();
    if (question == "?") {
      for (const std::string& problem : tree_.problems()) {
        *answer->mutable_child() += problem + "\n";
      }
      answers_.publish(std::move(answer));
      return;
    }
    std::istringstream words(question);
    std::string a;
    std::string b;
    double ms = 0.0;
    words >> a >> b;
    const auto found = words >> ms
                           ? tree_.a_to_b(a, b, kSimulatedStart + Duration(std::llround(ms * 1e6)))
                           : tree_.a_to_b(a, b);
    if (found) {
      to_message({}, {}, {.child_to_parent = *found}, *answer);
    } else {
      answer->set_child(found.error().why);
      answer->mutable_header()->set_taken_ns(static_cast<int>(found.error().missing));
    }
    answers_.publish(std::move(answer));
  }

  Tree tree_;
  Publisher<transform::Transform> answers_;
};

transform::Transform pose(const std::string& parent, const std::string& child, double ms,
                          const Transform& transform) {
  transform::Transform message;
  to_message(
      parent, child,
      {.taken = kSimulatedStart + Duration(std::llround(ms * 1e6)), .child_to_parent = transform},
      message);
  return message;
}

transform::StaticTransforms statics(const std::vector<transform::Transform>& all) {
  transform::StaticTransforms message;
  for (const auto& one : all) {
    *message.add_transforms() = one;
  }
  return message;
}

/// A bench with an asker.
class Questions {
 public:
  explicit Questions(const std::string& moving = {}, int max_hold_ms = 0) {
    bench.configure(
        R"({"topics": {"transforms/static": {"latched": 1, "multiple_publishers": true}}})");
    bench.add<Asker>("asker", fmt::format(R"({{"params": {{"moving": "{}", "max_hold_ms": {}}}}})",
                                          moving, max_hold_ms));
    for (const MovingFrame& frame : parse_moving(moving)) {
      poses.emplace(frame.topic, bench.input<transform::Transform>(frame.topic));
    }
    bench.start();
  }

  transform::Transform ask(const std::string& question) {
    questions_.publish([&] {
      StringValue message;
      message.set_value(question);
      return message;
    }());
    return answers_.take().at(0);
  }
  std::string why(const std::string& question) { return ask(question).child(); }

  ::fastcycle::testing::Bench bench;
  std::map<std::string, ::fastcycle::testing::Bench::Input<transform::Transform>> poses;
  ::fastcycle::testing::Bench::Input<transform::StaticTransforms> fixed =
      bench.input<transform::StaticTransforms>("transforms/static");
  ::fastcycle::testing::Bench::Input<transform::StaticTransforms> more_fixed =
      bench.input<transform::StaticTransforms>("transforms/static");

 private:
  ::fastcycle::testing::Bench::Input<StringValue> questions_ = bench.input<StringValue>("ask");
  ::fastcycle::testing::Bench::Output<transform::Transform> answers_ =
      bench.output<transform::Transform>("answer");
};

constexpr const char* kPose = "localization/base";
constexpr const char* kDriving = "localization/base map base_link";

Transform at(double x, double y = 0.0, double yaw = 0.0) {
  return {{x, y, 0.0}, from_roll_pitch_yaw(0.0, 0.0, yaw)};
}

TEST(ALookUp, FollowsAChainUpAndDown) {
  Questions questions(kDriving);
  questions.fixed.publish(statics({pose("base_link", "lidar", 0, at(2.0)),
                                   pose("base_link", "camera", 0, at(1.0, 0.0, M_PI / 2))}));
  questions.poses.at(kPose).publish(pose("map", "base_link", 100, at(10.0, 5.0, M_PI / 2)));

  const auto lidar_to_map = from_message(questions.ask("lidar map 100")).child_to_parent;
  EXPECT_NEAR((lidar_to_map * Vector{1.0, 0.0, 0.0}).x, 10.0, 1e-12);
  EXPECT_NEAR((lidar_to_map * Vector{1.0, 0.0, 0.0}).y, 8.0, 1e-12);
  // Without the map: no pose is needed, whatever the time.
  const auto lidar_to_camera = from_message(questions.ask("lidar camera 9999")).child_to_parent;
  EXPECT_NEAR((lidar_to_camera * Vector{}).x, 0.0, 1e-12);
  EXPECT_NEAR((lidar_to_camera * Vector{}).y, -1.0, 1e-12);
  EXPECT_EQ(questions.why("lidar lidar 5"), "");
}

TEST(ALookUp, GoesBetweenTwoPoses) {
  Questions questions(kDriving);
  for (const int ms : {100, 200, 300}) {
    questions.poses.at(kPose).publish(pose("map", "base_link", ms, at(ms / 10.0)));
  }

  EXPECT_NEAR(questions.ask("base_link map 225").translation().x_m(), 22.5, 1e-9);
  EXPECT_NEAR(questions.ask("base_link map 100").translation().x_m(), 10.0, 1e-9);
  EXPECT_NEAR(questions.ask("base_link map 300").translation().x_m(), 30.0, 1e-9);
  EXPECT_NEAR(questions.ask("map base_link 300").translation().x_m(), -30.0, 1e-9);
  EXPECT_NEAR(questions.ask("base_link map").translation().x_m(), 30.0, 1e-9);
}

TEST(ALookUp, SaysWhichPoseIsTooOld) {
  Questions questions("localization/base map base_link arm/pose base_link gripper", 50);
  questions.poses.at(kPose).publish(pose("map", "base_link", 1000, at(1.0)));
  questions.poses.at("arm/pose").publish(pose("base_link", "gripper", 880, at(1.0)));

  EXPECT_EQ(questions.why("gripper map 1000"),
            "base_link ← gripper: the newest on \"arm/pose\" is 120 ms older than asked; 50 ms are "
            "allowed (max_hold)");
  EXPECT_EQ(questions.ask("gripper map 1000").header().taken_ns(),
            static_cast<int>(Missing::kNewPose));
  EXPECT_EQ(questions.why("base_link map 1050"), "");
  EXPECT_EQ(questions.why("base_link map 1050.25"),
            "map ← base_link: the newest on \"localization/base\" is 50.25 ms older than asked; 50 "
            "ms are allowed (max_hold)");
}

TEST(ALookUp, GuessesNothingUnlessAskedTo) {
  Questions questions(kDriving);
  questions.poses.at(kPose).publish(pose("map", "base_link", 1000, at(1.0)));

  EXPECT_EQ(questions.why("base_link map 1000"), "");
  EXPECT_THAT(questions.why("base_link map 1000.001"),
              HasSubstr("is 0.001 ms older than asked; 0 ms are allowed"));
}

TEST(ALookUp, SaysWhichPoseIsNotKeptAnyMore) {
  Questions questions(kDriving);
  for (int i = 0; i < 100; ++i) {
    questions.poses.at(kPose).publish(pose("map", "base_link", 10.0 * i, at(i)));
  }

  EXPECT_EQ(questions.why("base_link map 360"), "");
  EXPECT_EQ(questions.why("base_link map 355"),
            "map ← base_link: the oldest of 64 on \"localization/base\" that are kept is 5 ms "
            "younger than asked");
}

TEST(ALookUp, SaysWhichPoseHasNotCome) {
  Questions questions(kDriving);
  EXPECT_EQ(questions.why("base_link map 5"),
            "map ← base_link: nothing has come on \"localization/base\" yet");
  EXPECT_EQ(questions.why("base_link map"),
            "map ← base_link: nothing has come on \"localization/base\" yet");
}

TEST(ALookUp, SaysWhichFrameNobodyKnows) {
  Questions questions(kDriving);
  EXPECT_EQ(questions.why("base_lnik map 5"),
            "there is no frame \"base_lnik\"; known frames: base_link, map; did you mean "
            "\"base_link\"?");
  EXPECT_EQ(questions.why("map imu 5"), "there is no frame \"imu\"; known frames: base_link, map");
  EXPECT_EQ(Questions().why("a b 5"), "there is no frame \"a\"; known frames: none");
}

TEST(ALookUp, SaysWhereAChainEnds) {
  Questions questions(kDriving);
  questions.fixed.publish(statics({pose("imu_mount", "imu", 0, at(2.0))}));

  EXPECT_EQ(questions.why("imu base_link 5"),
            "no transform leads from imu to base_link: above imu is imu_mount, above base_link is "
            "map");
}

TEST(ALookUp, SaysWhichFrameHasTwoParents) {
  Questions questions(kDriving);
  questions.poses.at(kPose).publish(pose("map", "base_link", 5, at(1.0)));
  questions.fixed.publish(
      statics({pose("odom", "base_link", 0, at(2.0)), pose("base_link", "imu", 0, at(1.0))}));

  const std::string problem =
      "\"base_link\" has two parents: \"map\" on \"localization/base\" and \"odom\" on "
      "\"transforms/static\"";
  EXPECT_EQ(questions.why("imu map 5"), problem);
  EXPECT_EQ(questions.why("imu odom 5"), problem);
  EXPECT_EQ(questions.why("imu base_link 5"), "");  // Needs no parent of base_link.
  EXPECT_EQ(questions.why("?"), problem + "\n");
}

TEST(ALookUp, SaysWhichFramesLeadInACircle) {
  Questions questions;
  questions.fixed.publish(
      statics({pose("b", "a", 0, at(1)), pose("c", "b", 0, at(1)), pose("a", "c", 0, at(1)),
               pose("a", "lidar", 0, at(1)), pose("x", "x", 0, at(1)), pose("", "y", 0, at(1))}));

  EXPECT_THAT(questions.why("lidar map 5"), HasSubstr("there is no frame \"map\""));
  EXPECT_THAT(questions.why("lidar b 5"), HasSubstr("frames lead in a circle: "));
  EXPECT_THAT(questions.why("lidar x 5"), HasSubstr("frames lead in a circle: "));
  EXPECT_THAT(questions.why("x lidar 5"), HasSubstr("frames lead in a circle: "));
  EXPECT_EQ(questions.why("lidar a 5"), "");
  EXPECT_THAT(questions.why("?"), HasSubstr("b → c → a → b"));
  EXPECT_THAT(questions.why("?"), HasSubstr("x → x"));
  EXPECT_THAT(questions.why("?"),
              HasSubstr("a transform on \"transforms/static\" names no parent: \"\" ← \"y\""));
}

TEST(ALookUp, RefusesWhatIsNoPose) {
  Questions questions(kDriving);
  auto broken = pose("map", "base_link", 5, at(1.0));
  broken.mutable_rotation()->set_w(0.5);
  questions.poses.at(kPose).publish(broken);
  EXPECT_THAT(questions.why("base_link map 5"),
              HasSubstr("map ← base_link: what came on \"localization/base\" is no pose"));

  questions.poses.at(kPose).publish(pose("odom", "base_link", 6, at(1.0)));
  EXPECT_EQ(questions.why("base_link map 6"),
            "map ← base_link: a message on \"localization/base\" speaks of other frames");

  auto endless = pose("base_link", "imu", 0, at(std::nan("")));
  questions.fixed.publish(statics({endless}));
  EXPECT_THAT(questions.why("imu base_link 6"), HasSubstr("base_link ← imu: what came on"));
}

TEST(StaticFrames, OfAPublisherAreReplacedByItsNextMessage) {
  Questions questions;
  questions.fixed.publish(statics({pose("base_link", "lidar", 0, at(1.0))}));
  questions.more_fixed.publish(statics({pose("base_link", "imu", 0, at(5.0))}));
  EXPECT_NEAR(questions.ask("imu lidar 0").translation().x_m(), 4.0, 1e-12);

  questions.fixed.publish(statics({pose("base_link", "lidar", 0, at(2.0))}));
  EXPECT_NEAR(questions.ask("imu lidar 0").translation().x_m(), 3.0, 1e-12);

  questions.fixed.publish(statics({pose("base_link", "camera", 0, at(2.0))}));
  EXPECT_EQ(questions.why("imu lidar 0"),
            "there is no frame \"lidar\"; known frames: base_link, camera, imu");
}

TEST(MovingFrames, ThatMakeNoTreeAreRefused) {
  const auto refuse = [](const std::string& moving) {
    try {
      Questions questions(moving);
      return std::string("taken");
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
  };
  EXPECT_THAT(refuse("a map base_link b odom base_link"),
              HasSubstr("the moving frames make no tree: \"base_link\" has two parents"));
  EXPECT_THAT(refuse("a map base_link b base_link map"),
              HasSubstr("the moving frames make no tree: frames lead in a circle"));
}

// --- Everything again by hand: 4x4 matrices, whole chains, no quaternions. ---

using Matrix = std::array<std::array<double, 4>, 4>;

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix result{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = 0; k < 4; ++k) {
        result[i][j] += a[i][k] * b[k][j];
      }
    }
  }
  return result;
}

Matrix unit() {
  Matrix matrix{};
  for (std::size_t i = 0; i < 4; ++i) {
    matrix[i][i] = 1.0;
  }
  return matrix;
}

Matrix inverse_of(const Matrix& matrix) {
  Matrix result = unit();
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      result[i][j] = matrix[j][i];
      result[i][3] -= matrix[j][i] * matrix[j][3];
    }
  }
  return result;
}

/// By Rodrigues' formula.
Matrix rotation_about(const std::array<double, 3>& axis, double angle) {
  const auto [x, y, z] = axis;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const double d = 1.0 - c;
  return {{{c + x * x * d, x * y * d - z * s, x * z * d + y * s, 0.0},
           {y * x * d + z * s, c + y * y * d, y * z * d - x * s, 0.0},
           {z * x * d - y * s, z * y * d + x * s, c + z * z * d, 0.0},
           {0.0, 0.0, 0.0, 1.0}}};
}

/// The rotation and the place apart: turned about the axis of what leads from one to the other.
Matrix between(const Matrix& from, const Matrix& to, double part) {
  Matrix from_turn = from;
  Matrix to_turn = to;
  for (std::size_t i = 0; i < 3; ++i) {
    from_turn[i][3] = to_turn[i][3] = 0.0;
  }
  const Matrix turn = product(to_turn, inverse_of(from_turn));
  const std::array<double, 3> twice = {turn[2][1] - turn[1][2], turn[0][2] - turn[2][0],
                                       turn[1][0] - turn[0][1]};
  const double sine = 0.5 * std::hypot(twice[0], twice[1], twice[2]);
  const double angle = std::atan2(sine, 0.5 * (turn[0][0] + turn[1][1] + turn[2][2] - 1.0));
  Matrix result = from_turn;
  if (sine > 1e-9) {
    result = product(rotation_about({twice[0] / sine / 2, twice[1] / sine / 2, twice[2] / sine / 2},
                                    part * angle),
                     from_turn);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    result[i][3] = from[i][3] + part * (to[i][3] - from[i][3]);
  }
  return result;
}

struct KnownPose {
  double ms = 0.0;
  Matrix matrix{};
};

struct KnownFrame {
  std::string name;
  std::size_t parent = 0;  // The first frame has none.
  std::vector<KnownPose> poses{};
};

Matrix matrix_at(const KnownFrame& frame, double ms) {
  for (std::size_t i = 0; i + 1 < frame.poses.size(); ++i) {
    const KnownPose& a = frame.poses[i];
    const KnownPose& b = frame.poses[i + 1];
    if (a.ms <= ms && ms <= b.ms) {
      return between(a.matrix, b.matrix, (ms - a.ms) / (b.ms - a.ms));
    }
  }
  return frame.poses.at(0).matrix;
}

Matrix to_root(const std::vector<KnownFrame>& frames, std::size_t index, double ms) {
  Matrix result = unit();
  for (; index != 0; index = frames[index].parent) {
    result = product(matrix_at(frames[index], ms), result);
  }
  return result;
}

Matrix matrix_of(const transform::Transform& message) {
  const auto& q = message.rotation();
  const auto& t = message.translation();
  return {{{1 - 2 * (q.y() * q.y() + q.z() * q.z()), 2 * (q.x() * q.y() - q.z() * q.w()),
            2 * (q.x() * q.z() + q.y() * q.w()), t.x_m()},
           {2 * (q.x() * q.y() + q.z() * q.w()), 1 - 2 * (q.x() * q.x() + q.z() * q.z()),
            2 * (q.y() * q.z() - q.x() * q.w()), t.y_m()},
           {2 * (q.x() * q.z() - q.y() * q.w()), 2 * (q.y() * q.z() + q.x() * q.w()),
            1 - 2 * (q.x() * q.x() + q.y() * q.y()), t.z_m()},
           {0, 0, 0, 1}}};
}

/// One random rotation and place, as a message's numbers and as a matrix.
class RandomPoses {
 public:
  explicit RandomPoses(std::mt19937_64& random) : random_(random) {}

  /// Turned against the one before by less than half a turn.
  std::pair<Transform, Matrix> next() {
    std::array<double, 3> axis = {draw(-1, 1), draw(-1, 1), draw(-1, 1)};
    const double length = std::hypot(axis[0], axis[1], axis[2]) + 1e-3;
    double sum = 0.0;
    for (double& value : axis) {
      value /= length;
      sum += value * value;
    }
    for (double& value : axis) {
      value /= std::sqrt(sum);
    }
    const double angle = draw(-2.8, 2.8);
    const double s = std::sin(angle / 2) * (draw(0, 1) < 0.5 ? 1.0 : -1.0);
    // A quaternion or its negative: the same rotation.
    const double sign = s * std::sin(angle / 2) < 0 ? -1.0 : 1.0;
    rotation_ =
        Quaternion{sign * std::cos(angle / 2), s * axis[0], s * axis[1], s * axis[2]} * rotation_;
    turn_ = product(rotation_about(axis, angle), turn_);
    Matrix matrix = turn_;
    const Vector place{draw(-20, 20), draw(-20, 20), draw(-20, 20)};
    matrix[0][3] = place.x;
    matrix[1][3] = place.y;
    matrix[2][3] = place.z;
    return {{place, rotation_}, matrix};
  }

 private:
  double draw(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  std::mt19937_64& random_;
  Quaternion rotation_;
  Matrix turn_ = unit();
};

constexpr int kTrees = 50;
constexpr int kLookUps = 20;
constexpr double kLastMs = 1000.0;

void compare_random_tree(std::mt19937_64& random) {
  std::vector<KnownFrame> frames;
  std::string moving;
  std::vector<std::size_t> movers;
  std::vector<transform::Transform> fixed[2];
  std::vector<std::vector<transform::Transform>> messages;
  const std::size_t count = 2 + random() % 10;
  for (std::size_t i = 0; i < count; ++i) {
    KnownFrame& frame = frames.emplace_back(
        KnownFrame{.name = "frame" + std::to_string(i), .parent = i == 0 ? 0 : random() % i});
    if (i == 0) {
      continue;
    }
    const std::string& parent = frames[frame.parent].name;
    const bool moves = random() % 2 == 0;
    RandomPoses poses(random);
    std::vector<transform::Transform> said;
    double ms = 0.0;
    do {
      const auto [transform, matrix] = poses.next();
      frame.poses.push_back({ms, matrix});
      said.push_back(pose(parent, frame.name, ms, transform));
      if (ms == kLastMs) {
        break;
      }
      ms = std::min(kLastMs, ms + 1.0 + static_cast<double>(random() % 200));
    } while (moves);
    if (moves) {
      moving += "moves/" + frame.name + " " + parent + " " + frame.name + " ";
      messages.push_back(said);
    } else {
      fixed[random() % 2].push_back(said.front());
    }
  }
  Questions questions(moving);
  const bool fixed_first = random() % 2 == 0;
  const auto publish_fixed = [&] {
    questions.fixed.publish(statics(fixed[0]));
    questions.more_fixed.publish(statics(fixed[1]));
  };
  if (fixed_first) {
    publish_fixed();
  }
  for (const auto& said : messages) {
    for (const auto& message : said) {
      questions.poses.at("moves/" + message.child()).publish(message);
    }
  }
  if (!fixed_first) {
    publish_fixed();
  }
  for (int i = 0; i < kLookUps; ++i) {
    const std::size_t a = random() % count;
    const std::size_t b = random() % count;
    const double ms = static_cast<double>(random() % 1'000'001) / 1000.0;
    const auto answer =
        questions.ask(fmt::format("{} {} {:.3f}", frames[a].name, frames[b].name, ms));
    ASSERT_EQ(answer.child(), "");
    const Matrix found = matrix_of(answer);
    const Matrix expected = product(inverse_of(to_root(frames, b, ms)), to_root(frames, a, ms));
    for (std::size_t row = 0; row < 4; ++row) {
      for (std::size_t column = 0; column < 4; ++column) {
        ASSERT_NEAR(found[row][column], expected[row][column], 1e-9)
            << frames[a].name << " to " << frames[b].name << " at " << ms << " ms of " << moving;
      }
    }
  }
}

TEST(ManyRandomTrees, GiveWhatMatricesGiveByHand) {
  std::mt19937_64 random(20);
  for (int tree = 0; tree < kTrees; ++tree) {
    ASSERT_NO_FATAL_FAILURE(compare_random_tree(random)) << "tree " << tree;
  }
}

}  // namespace
}  // namespace fastcycle::transforms
