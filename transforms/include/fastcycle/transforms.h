#pragma once

// Coordinate frames, the transforms between them, and how they change with time.

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

/// A point or a direction, in metres. Axes are right-handed; each frame defines their directions.
/// Convention: for a vehicle x forward, y left, z up; for a map x east, y north, z up.
struct Vector {
  /// Forward, or east.
  double x = 0.0;
  /// To the left, or north.
  double y = 0.0;
  /// Up.
  double z = 0.0;
};

/// A rotation as a unit quaternion; the default is the identity.
struct Quaternion {
  /// The real part: the cosine of half the angle.
  double w = 1.0;
  /// The part about x.
  double x = 0.0;
  /// The part about y.
  double y = 0.0;
  /// The part about z.
  double z = 0.0;

  /// The inverse rotation.
  [[nodiscard]] Quaternion conjugate() const noexcept { return {w, -x, -y, -z}; }
  /// Rotates `vector`.
  [[nodiscard]] Vector operator*(const Vector& vector) const noexcept;
  /// Composition: first `first`, then this.
  [[nodiscard]] Quaternion operator*(const Quaternion& first) const noexcept;
};

/// Rotates by `roll` about x, then by `pitch` about the fixed y, then by `yaw` about the fixed z:
/// the attitude of a vehicle in its map. Radians; a positive yaw turns from x to y, which is
/// counter-clockwise seen from above; a positive pitch turns the nose (x) down.
[[nodiscard]] Quaternion from_roll_pitch_yaw(double roll, double pitch, double yaw) noexcept;

/// Transforms the coordinates of a point in one frame to its coordinates in another one.
///
///     point_in_b = a_to_b * point_in_a
///     a_to_c     = b_to_c * a_to_b
///     b_to_a     = a_to_b.inverse()
///
/// The same numbers are the pose of frame a in frame b: `translation` is the origin of a in b,
/// `rotation` the orientation of a's axes in b.
struct Transform {
  /// Origin of a in b, in metres.
  Vector translation{};
  /// Orientation of a's axes in b.
  Quaternion rotation{};

  /// Transforms `point` from frame a to frame b.
  [[nodiscard]] Vector operator*(const Vector& point) const noexcept;
  /// Composition: first `first`, then this.
  [[nodiscard]] Transform operator*(const Transform& first) const noexcept;
  /// From b to a.
  [[nodiscard]] Transform inverse() const noexcept;
};

/// Interpolates between `from` (at `part` 0) and `to` (at 1): positions linearly, rotations at
/// constant speed along the shorter arc.
[[nodiscard]] Transform interpolate(const Transform& from, const Transform& to,
                                    double part) noexcept;

/// The pose of a child in its parent at one time.
struct Pose {
  /// When it was measured.
  Time taken{};
  /// Transforms points from the child to the parent.
  Transform child_to_parent{};
};

/// The pose in a message; a missing rotation or translation is the identity.
[[nodiscard]] Pose from_message(const transform::Transform& message);
/// Fills all of `message`.
void to_message(std::string_view parent, std::string_view child, const Pose& pose,
                transform::Transform& message);

/// Why a lookup failed.
enum class Missing : std::uint8_t {
  kFrame,       ///< The frame is unknown (so far).
  kConnection,  ///< Both frames are known, but not connected.
  kPose,        ///< No message yet on the topic of a moving frame.
  kNewPose,     ///< The newest pose is too old for the requested time.
  kOldPose,     ///< The oldest pose kept is newer than requested.
  kValid,       ///< An invalid pose: its rotation is not one, or it is of other frames.
  kSense,       ///< A frame with two parents, or frames in a cycle.
};

/// Why a lookup failed, with the names of the frames: "map ← base_link: the newest on
/// "localization/pose" is 120 ms older than asked; 50 ms are allowed (max_hold)".
struct Error {
  /// The reason.
  Missing missing{};
  /// The reason as text.
  std::string why;
};

/// The result of a lookup, or the reason of its failure.
template <typename T>
class Result {
 public:
  /// A value.
  Result(T value) : content_(std::move(value)) {}  // NOLINT(google-explicit-constructor)
  /// A failure.
  Result(Error error) : content_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  /// Whether there is a value.
  [[nodiscard]] explicit operator bool() const noexcept { return content_.index() == 0; }

  /// @pre  There is a value.
  [[nodiscard]] const T& operator*() const {
    FASTCYCLE_ASSERT(content_.index() == 0, "what is taken from a look-up was found");
    return *std::get_if<0>(&content_);
  }
  /// As `*`.
  [[nodiscard]] const T* operator->() const { return &**this; }

  /// @pre  There is no value.
  [[nodiscard]] const Error& error() const {
    FASTCYCLE_ASSERT(content_.index() == 1, "a look-up that found something has no error");
    return *std::get_if<1>(&content_);
  }

 private:
  std::variant<T, Error> content_;
};

/// A frame that moves relative to its parent, and the topic of its poses.
struct MovingFrame {
  /// Where its poses are published.
  std::string topic;
  /// Its parent.
  std::string parent;
  /// Its own name.
  std::string child;
  std::size_t depth = 64;  ///< Number of poses kept: how far back a lookup can reach.
};

/// The frames that a component looks up.
struct TreeOptions {
  /// Topic of static frames, published by any number of publishers as
  /// `transform::StaticTransforms`; it is latched. Empty: none.
  std::string static_topic = "transforms/static";
  /// Frames whose poses are published as `transform::Transform`. `Tree::add` adds those published
  /// as other messages.
  std::vector<MovingFrame> moving = {};
  /// How long the newest pose may be used, unchanged, for later times. 0: only interpolation, no
  /// extrapolation.
  Duration max_hold{0};
};

namespace detail {

/// The poses of a topic, whatever its type; index 0 is the oldest.
class Poses {
 public:
  Poses() = default;
  Poses(const Poses&) = delete;
  Poses& operator=(const Poses&) = delete;
  virtual ~Poses() = default;

  [[nodiscard]] virtual std::size_t size() const = 0;
  [[nodiscard]] virtual Pose at(std::size_t index) const = 0;
  /// Whether the message itself is of these frames, if it names any.
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

/// The frames of an application and the transforms between them: a member of each component that
/// looks up transforms.
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
/// Each frame has at most one parent. The tree is frozen during an activation: equal lookups in one
/// callback return equal results, whatever is published meanwhile. A lookup causes no activation
/// and never blocks: an unknown transform is an error with the reason.
///
/// @threads  Confined to its component: constructed in its constructor, used in its activations.
/// @realtime `a_to_b` takes no lock and allocates nothing if it finds the transform and no static
///           frames came since the last lookup. Its time grows with the frames between a and b, and
///           with the number of poses since the requested time.
class Tree {
 public:
  /// @errors  std::invalid_argument if the moving frames do not form a tree.
  explicit Tree(Context& context, TreeOptions options = {});
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  ~Tree();

  /// Adds a moving frame with poses in messages of any type: `convert(const T&)` returns a `Pose`.
  /// In the component's constructor. The measured times of one topic must not decrease.
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

  /// The transform from frame `a` to frame `b` at `time`, which is the measured time
  /// (`header.taken_ns`) of poses: `point_in_b = *a_to_b("a", "b", time) * point_in_a`.
  [[nodiscard]] Result<Transform> a_to_b(std::string_view a, std::string_view b, Time time);

  /// The same at the newest time for which every transform between them is known.
  [[nodiscard]] Result<Transform> a_to_b(std::string_view a, std::string_view b);

  /// The newest time for which every transform between `a` and `b` is known; `Time::max()` if none
  /// of them moves.
  [[nodiscard]] Result<Time> newest_time(std::string_view a, std::string_view b);

  /// A description of each frame that has two parents, or is part of a cycle. Lookups without such
  /// frames work.
  [[nodiscard]] std::vector<std::string> problems();

  /// The names of all known frames, in alphabetical order.
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
  std::uint64_t seen_ = 0;  ///< The static messages from which the tree was built.
  std::vector<std::unique_ptr<Moving>> moving_;
  std::vector<Frame> frames_;
  std::map<std::string, std::size_t, std::less<>> names_;
  std::vector<std::string> problems_;
};

/// Publishes static frames. Any number of components may do so on one topic, which is latched:
/// `"topics": {"transforms/static": {"latched": 1, "multiple_publishers": true}}`.
///
/// @threads  Confined to its component: constructed in its constructor, used in its activations.
class StaticBroadcaster {
 public:
  /// Declares `topic` as published by the component, in its constructor.
  explicit StaticBroadcaster(Context& context, std::string_view topic = "transforms/static")
      : publisher_(context.create_publisher<transform::StaticTransforms>(topic)) {}

  /// Sets the pose of `child` in `parent`: `point_in_parent = child_to_parent * point_in_child`. A
  /// second call for the same child replaces the first.
  void set(std::string_view parent, std::string_view child, const Transform& child_to_parent);

  /// Publishes all poses set; in `start()`, and after changes.
  void publish();

 private:
  Publisher<transform::StaticTransforms> publisher_;
  transform::StaticTransforms all_;
};

}  // namespace fastcycle::transforms
