#pragma once

// Where things are: coordinate frames, the transforms between them, and how they change with time.

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "fastcycle/fastcycle.h"
#include "transform/transform.pb.h"

namespace fastcycle::transforms {

/// A point or a direction, in metres. Axes are right-handed; which way they point is a matter of
/// the frame. For a vehicle we take x forward, y to the left, z up; for a map x east, y north, z
/// up.
struct Vector {
  /// Forward, or east.
  double x = 0.0;
  /// To the left, or north.
  double y = 0.0;
  /// Up.
  double z = 0.0;
};

/// A rotation as a unit quaternion; what is made without values turns nothing.
struct Quaternion {
  /// The real part: the cosine of half the angle.
  double w = 1.0;
  /// The part about x.
  double x = 0.0;
  /// The part about y.
  double y = 0.0;
  /// The part about z.
  double z = 0.0;

  /// The way back.
  [[nodiscard]] Quaternion conjugate() const noexcept { return {w, -x, -y, -z}; }
  /// Turns `vector`.
  [[nodiscard]] Vector operator*(const Vector& vector) const noexcept;
  /// Turns by `first`, then by this.
  [[nodiscard]] Quaternion operator*(const Quaternion& first) const noexcept;
};

/// Turns by `roll` about x, then by `pitch` about the old y, then by `yaw` about the old z: the
/// attitude of a vehicle in its map. Radians; a positive yaw turns from x to y, which is
/// counter-clockwise seen from above; a positive pitch turns the nose (x) down.
[[nodiscard]] Quaternion from_roll_pitch_yaw(double roll, double pitch, double yaw) noexcept;

/// Takes the coordinates of a point in one frame to its coordinates in another one.
///
///     point_in_b = a_to_b * point_in_a
///     a_to_c     = b_to_c * a_to_b
///     b_to_a     = a_to_b.inverse()
///
/// The same numbers are the pose of frame a in frame b: `translation` is where a's origin is in b,
/// `rotation` how a's axes stand in b.
struct Transform {
  /// Where a's origin is in b, in metres.
  Vector translation{};
  /// How a's axes stand in b.
  Quaternion rotation{};

  /// `point` of frame a in frame b.
  [[nodiscard]] Vector operator*(const Vector& point) const noexcept;
  /// By `first`, then by this.
  [[nodiscard]] Transform operator*(const Transform& first) const noexcept;
  /// From b to a.
  [[nodiscard]] Transform inverse() const noexcept;
};

/// Between `from` (at `part` 0) and `to` (at 1): positions on a straight line, rotations at
/// constant speed the shorter way round.
[[nodiscard]] Transform interpolate(const Transform& from, const Transform& to,
                                    double part) noexcept;

/// The pose of a child in its parent at one time.
struct Pose {
  /// When it was measured.
  Time taken{};
  /// Takes points of the child to the parent.
  Transform child_to_parent{};
};

/// What a message says; without a rotation or a translation there is none.
[[nodiscard]] Pose from_message(const transform::Transform& message);
/// Fills all of `message`.
void to_message(std::string_view parent, std::string_view child, const Pose& pose,
                transform::Transform& message);

/// Why a look-up found nothing.
enum class Missing : std::uint8_t {
  kFrame,       ///< Nobody spoke of this frame (yet).
  kConnection,  ///< Both frames are known; nothing leads from one to the other.
  kPose,        ///< Nothing has come yet on the topic that moves a frame.
  kNewPose,     ///< The newest pose is older than asked, by more than may be.
  kOldPose,     ///< The oldest pose that is kept is younger than asked.
  kValid,       ///< A pose cannot be used: its rotation is none, or it speaks of other frames.
  kSense,       ///< Two parents of one frame, or frames that lead in a circle.
};

/// Why a look-up found nothing, with the names of the frames: "map ← base_link: the newest on
/// "localization/pose" is 120 ms older than asked; 50 ms are allowed (max_hold)".
struct Error {
  /// What is missing.
  Missing missing{};
  /// In words.
  std::string why;
};

/// What was looked up, or why it is missing.
template <typename T>
class Result {
 public:
  /// What was found.
  Result(T value) : content_(std::move(value)) {}  // NOLINT(google-explicit-constructor)
  /// Why nothing was.
  Result(Error error) : content_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  /// Whether it was found.
  [[nodiscard]] explicit operator bool() const noexcept { return content_.index() == 0; }

  /// @pre  It was found.
  [[nodiscard]] const T& operator*() const {
    FASTCYCLE_ASSERT(content_.index() == 0, "what is taken from a look-up was found");
    return *std::get_if<0>(&content_);
  }
  /// As `*`.
  [[nodiscard]] const T* operator->() const { return &**this; }

  /// @pre  It was not found.
  [[nodiscard]] const Error& error() const {
    FASTCYCLE_ASSERT(content_.index() == 1, "a look-up that found something has no error");
    return *std::get_if<1>(&content_);
  }

 private:
  std::variant<T, Error> content_;
};

/// A frame that moves against its parent, and the topic that says how.
struct MovingFrame {
  /// Where its poses are published.
  std::string topic;
  /// The frame that it moves in.
  std::string parent;
  /// Its own name.
  std::string child;
  std::size_t depth = 64;  ///< Poses that are kept: how far back a look-up can reach.
};

/// What a component says of the frames that it asks for.
struct TreeOptions {
  /// Where frames that do not move are published, by any number of publishers, as
  /// `transform::StaticTransforms`; the topic is latched. Empty: there are none.
  std::string static_topic = "transforms/static";
  /// Frames whose poses are published as `transform::Transform`. Poses that come as other messages
  /// are added by `Tree::add`.
  std::vector<MovingFrame> moving = {};
  /// For how long the newest pose may stand for a later time, unchanged. 0: only times between two
  /// poses, and those of poses, are answered; nothing is guessed.
  Duration max_hold{0};
};

namespace detail {

/// The poses that a topic has, whatever its type; index 0 is the oldest.
class Poses {
 public:
  Poses() = default;
  Poses(const Poses&) = delete;
  Poses& operator=(const Poses&) = delete;
  virtual ~Poses() = default;

  [[nodiscard]] virtual std::size_t size() const = 0;
  [[nodiscard]] virtual Pose at(std::size_t index) const = 0;
  /// Whether the message itself speaks of these frames, where it names any.
  [[nodiscard]] virtual bool is_of(std::size_t, std::string_view, std::string_view) const {
    return true;
  }
};

template <Message T, typename F>
class ConvertedPoses final : public Poses {
 public:
  ConvertedPoses(History<T> history, F convert) : history_(history), convert_(std::move(convert)) {}

  [[nodiscard]] std::size_t size() const override { return history_.size(); }
  [[nodiscard]] Pose at(std::size_t index) const override { return convert_(*history_[index]); }

 private:
  History<T> history_;
  F convert_;
};

}  // namespace detail

/// The frames of an application and how they stand to each other: a member of each component that
/// asks for transforms.
///
///     class Tracker final : public fastcycle::Component {
///      public:
///       explicit Tracker(fastcycle::Context& context)
///           : Component(context),
///             tree_(context, {.moving = {{"localization/base", "map", "base_link"}}}) { … }
///      private:
///       void on_scan(const Scan& scan) {
///         const auto lidar_to_map = tree_.a_to_b("lidar", "map", time_of(scan));
///         if (!lidar_to_map) {
///           log().warning("{}", lidar_to_map.error().why);
///           return;
///         }
///         const auto point_in_map = *lidar_to_map * point_in_lidar;
///
/// Each frame has at most one parent. What the tree knows is frozen while an activation lasts: two
/// questions in one callback get one answer, whatever is published meanwhile. Asking causes no
/// activation and waits for nothing: what is not known is an error that says what is missing.
///
/// @threads  Confined to its component: made in its constructor, asked in its activations.
/// @realtime `a_to_b` takes no lock and allocates nothing if it finds the transform and no static
///           frames came since the last question. Its time grows with the frames between a and b,
///           and with how many poses came since the time that is asked for.
class Tree {
 public:
  /// @errors  std::invalid_argument if the moving frames make no tree.
  explicit Tree(Context& context, TreeOptions options = {});
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  ~Tree();

  /// A moving frame whose poses come as messages of any type: `convert(const T&)` gives a `Pose`.
  /// In the component's constructor. The measured times of one topic do not go back.
  ///
  ///     tree_.add<localization::Pose>(context, {"localization/pose", "map", "base_link"},
  ///                                   [](const localization::Pose& pose) { return …; });
  ///
  /// @errors  As the constructor.
  template <Message T, std::invocable<const T&> F>
  void add(Context& context, MovingFrame frame, F convert) {
    auto history = context.create_history<T>(frame.topic, {.depth = frame.depth});
    add_poses(std::move(frame),
              std::make_unique<detail::ConvertedPoses<T, F>>(history, std::move(convert)));
  }

  /// What takes coordinates in frame `a` to coordinates in frame `b` at `time`, which is the
  /// measured time (`header.taken_ns`) of poses: `point_in_b = *a_to_b("a", "b", time) *
  /// point_in_a`.
  [[nodiscard]] Result<Transform> a_to_b(std::string_view a, std::string_view b, Time time);

  /// The same at the newest time for which every transform between them is known.
  [[nodiscard]] Result<Transform> a_to_b(std::string_view a, std::string_view b);

  /// The newest time for which every transform between `a` and `b` is known; `Time::max()` if none
  /// of them moves.
  [[nodiscard]] Result<Time> newest_time(std::string_view a, std::string_view b);

  /// Each frame that has two parents, or is part of a circle, in words. Look-ups that need none of
  /// them work.
  [[nodiscard]] std::vector<std::string> problems();

  /// The names of all frames that are known, in the order of the alphabet.
  [[nodiscard]] std::vector<std::string> frames();

 private:
  struct Frame;
  struct Moving;

  void add_poses(MovingFrame frame, std::unique_ptr<detail::Poses> poses);
  void refresh();
  void rebuild();
  std::size_t frame_named(std::string_view name);
  void connect(std::string_view parent, std::string_view child, std::string_view topic,
               const Moving* moving, const Transform& transform);
  void find_circles();
  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
  [[nodiscard]] std::optional<std::size_t> common(std::size_t a, std::size_t b) const;
  [[nodiscard]] std::optional<Error> climb(std::size_t from, std::size_t to, Time time,
                                           Transform& up) const;
  [[nodiscard]] std::optional<Error> look(const Frame& frame, Time time, Transform& found) const;
  [[nodiscard]] std::optional<Error> newest(std::size_t from, std::size_t to, Time& time) const;
  [[nodiscard]] Error unknown(std::string_view name) const;
  [[nodiscard]] Error unconnected(std::size_t a, std::size_t b) const;
  [[nodiscard]] std::string edge(const Frame& frame) const;

  const TreeOptions options_;
  std::optional<History<transform::StaticTransforms>> static_;
  std::uint64_t seen_ = 0;  ///< Which static messages the tree is made of.
  std::vector<std::unique_ptr<Moving>> moving_;
  std::vector<Frame> frames_;
  std::map<std::string, std::size_t, std::less<>> names_;
  std::vector<std::string> problems_;
};

/// Says where frames are that do not move. Any number of components may do so on one topic, which
/// is latched: `"topics": {"transforms/static": {"latched": 1, "multiple_publishers": true}}`.
///
/// @threads  Confined to its component: made in its constructor, used in its activations.
class StaticBroadcaster {
 public:
  /// Declares that the component publishes on `topic`, in its constructor.
  explicit StaticBroadcaster(Context& context, std::string_view topic = "transforms/static")
      : publisher_(context.create_publisher<transform::StaticTransforms>(topic)) {}

  /// Where `child` is in `parent`: `point_in_parent = child_to_parent * point_in_child`. A second
  /// call for the same child replaces the first.
  void set(std::string_view parent, std::string_view child, const Transform& child_to_parent);

  /// Publishes all that was set; in `start()`, or whenever something has changed.
  void publish();

 private:
  Publisher<transform::StaticTransforms> publisher_;
  transform::StaticTransforms all_;
};

}  // namespace fastcycle::transforms
