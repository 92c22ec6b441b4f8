#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "fastcycle/transforms.h"

namespace fastcycle::transforms {
namespace {

constexpr std::size_t kNoFrame = std::numeric_limits<std::size_t>::max();
constexpr std::size_t kStaticDepth = 64;  // Messages; only the last of each publisher is used.
constexpr std::uint64_t kMixing = 0x9e37'79b9'7f4a'7c15;
constexpr double kNormTolerance = 1e-3;  // Maximum deviation of a rotation's norm from 1.

std::string in_ms(Duration span) {
  return fmt::format("{:.6g} ms", std::chrono::duration<double, std::milli>(span).count());
}

/// Normalizes the rotation; false if it is not a rotation, or a value is not finite.
bool make_valid(Transform& transform) noexcept {
  Quaternion& q = transform.rotation;
  const Vector& t = transform.translation;
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  // Written so that NaN fails, too.
  if (!(std::abs(norm - 1.0) <= kNormTolerance) || !std::isfinite(t.x + t.y + t.z)) {
    return false;
  }
  q = {q.w / norm, q.x / norm, q.y / norm, q.z / norm};
  return true;
}

/// The edit distance between `a` and `b`.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

/// The poses of a topic of `transform::Transform`, which contains its frames.
class MessagePoses final : public detail::Poses {
 public:
  explicit MessagePoses(History<transform::Transform> history) : history_(history) {}

  [[nodiscard]] std::size_t size() const override { return history_.size(); }
  [[nodiscard]] Pose at(std::size_t index) const override { return from_message(*history_[index]); }
  [[nodiscard]] bool is_of(std::size_t index, std::string_view parent,
                           std::string_view child) const override {
    const auto message = history_[index];
    return message->header().frame() == parent && message->child() == child;
  }

 private:
  History<transform::Transform> history_;
};

}  // namespace

struct Tree::Moving {
  MovingFrame frame;
  std::unique_ptr<detail::Poses> poses;
};

struct Tree::Frame {
  std::string name;
  std::size_t parent = kNoFrame;
  std::size_t depth = 0;  ///< Number of frames above it.
  std::string topic{};    ///< The topic of its pose.
  const Moving* moving = nullptr;
  Transform child_to_parent{};  ///< If it is static.
  bool is_valid = true;
  std::string problem{};  ///< Why its place is ambiguous; empty if it is not.
};

Tree::Tree(Context& context, TreeOptions options) : options_(std::move(options)) {
  if (!options_.static_topic.empty()) {
    static_ = context.create_history<transform::StaticTransforms>(options_.static_topic,
                                                                  {.depth = kStaticDepth});
  }
  for (const MovingFrame& frame : options_.moving) {
    auto history =
        context.create_history<transform::Transform>(frame.topic, {.depth = frame.depth});
    add_poses(frame, std::make_unique<MessagePoses>(history));
  }
}

Tree::~Tree() = default;

void Tree::add_poses(MovingFrame frame, std::unique_ptr<detail::Poses> poses) {
  if (frame.parent.empty() || frame.child.empty()) {
    throw std::invalid_argument("the moving frame of \"" + frame.topic +
                                "\" needs the names of a parent and of a child");
  }
  moving_.push_back(
      std::make_unique<Moving>(Moving{.frame = std::move(frame), .poses = std::move(poses)}));
  rebuild();
  if (!problems_.empty()) {
    throw std::invalid_argument("the moving frames make no tree: " + problems_.front());
  }
}

void Tree::refresh() {
  // Any of them may be new: with several publishers, the last message received need not be the
  // newest.
  std::uint64_t seen = 0;
  for (std::size_t index = 0; static_ && index < static_->size(); ++index) {
    const auto message = (*static_)[index];
    seen = (seen ^ message.info().publisher ^ message.info().sequence) * kMixing + 1;
  }
  if (seen != seen_) {
    seen_ = seen;
    rebuild();
  }
}

void Tree::rebuild() {
  frames_.clear();
  names_.clear();
  problems_.clear();
  for (const auto& moving : moving_) {
    connect(moving->frame.parent, moving->frame.child, moving->frame.topic, moving.get(), {});
  }
  std::set<PublisherId> publishers;
  for (std::size_t index = static_ ? static_->size() : 0; index > 0; --index) {
    const auto message = (*static_)[index - 1];
    if (!publishers.insert(message.info().publisher).second) {
      continue;  // A newer message of it replaces this one.
    }
    for (const transform::Transform& one : message->transforms()) {
      connect(one.header().frame(), one.child(), options_.static_topic, nullptr,
              from_message(one).child_to_parent);
    }
  }
  find_circles();
}

std::size_t Tree::frame_named(std::string_view name) {
  if (const auto known = find(name)) {
    return *known;
  }
  frames_.push_back({.name = std::string(name)});
  names_.emplace(name, frames_.size() - 1);
  return frames_.size() - 1;
}

void Tree::connect(std::string_view parent, std::string_view child, std::string_view topic,
                   const Moving* moving, const Transform& transform) {
  if (parent.empty() || child.empty()) {
    problems_.push_back(fmt::format("a transform on \"{}\" names no {}: \"{}\" ← \"{}\"", topic,
                                    child.empty() ? "child" : "parent", parent, child));
    return;
  }
  const std::size_t above = frame_named(parent);
  Frame& frame = frames_[frame_named(child)];
  if (frame.parent != kNoFrame) {
    frame.problem = fmt::format("\"{}\" has two parents: \"{}\" on \"{}\" and \"{}\" on \"{}\"",
                                frame.name, frames_[frame.parent].name, frame.topic, parent, topic);
    problems_.push_back(frame.problem);
    return;
  }
  frame.parent = above;
  frame.topic = topic;
  frame.moving = moving;
  frame.child_to_parent = transform;
  frame.is_valid = make_valid(frame.child_to_parent);
}

void Tree::find_circles() {
  for (std::size_t index = 0; index < frames_.size(); ++index) {
    std::size_t depth = 0;
    std::size_t at = index;
    while (frames_[at].parent != kNoFrame && depth <= frames_.size()) {
      at = frames_[at].parent;
      ++depth;
    }
    frames_[index].depth = depth;
    if (depth <= frames_.size() || !frames_[at].problem.empty()) {
      continue;
    }
    std::string names = frames_[at].name;  // After this many steps it is in the cycle.
    for (std::size_t next = frames_[at].parent; next != at; next = frames_[next].parent) {
      names += " → " + frames_[next].name;
    }
    problems_.push_back("frames lead in a circle: " + names + " → " + frames_[at].name);
    std::size_t next = at;
    do {
      frames_[next].problem = problems_.back();
      next = frames_[next].parent;
    } while (next != at);
  }
}

std::optional<std::size_t> Tree::find(std::string_view name) const {
  const auto found = names_.find(name);
  return found == names_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<std::size_t> Tree::common(std::size_t a, std::size_t b) const {
  // At most as many steps as there are frames, each way, even in a cycle.
  for (std::size_t steps = 0; steps <= 2 * frames_.size() && a != b; ++steps) {
    std::size_t& deeper = frames_[a].depth >= frames_[b].depth ? a : b;
    if (frames_[deeper].parent == kNoFrame) {
      return std::nullopt;
    }
    deeper = frames_[deeper].parent;
  }
  return a == b ? std::optional(a) : std::nullopt;
}

std::string Tree::edge(const Frame& frame) const {
  return frames_[frame.parent].name + " ← " + frame.name;
}

std::optional<Error> Tree::look(const Frame& frame, Time time, Transform& found) const {
  if (!frame.problem.empty()) {
    return Error{Missing::kSense, frame.problem};
  }
  const auto bad = [&] {
    return Error{Missing::kValid,
                 fmt::format("{}: what came on \"{}\" is no pose: a rotation is a unit quaternion, "
                             "and every value a number",
                             edge(frame), frame.topic)};
  };
  if (frame.moving == nullptr) {
    found = frame.child_to_parent;
    return frame.is_valid ? std::nullopt : std::optional(bad());
  }
  const detail::Poses& poses = *frame.moving->poses;
  const std::size_t size = poses.size();
  if (size == 0) {
    return Error{Missing::kPose,
                 fmt::format("{}: nothing has come on \"{}\" yet", edge(frame), frame.topic)};
  }
  // From the newest back to the first one at or before the requested time.
  Pose after;
  Pose before;
  std::size_t index = size;
  do {
    after = before;
    before = poses.at(--index);
  } while (before.taken > time && index > 0);
  if (before.taken > time) {
    return Error{
        Missing::kOldPose,
        fmt::format("{}: the oldest of {} on \"{}\" that are kept is {} younger than asked",
                    edge(frame), frame.moving->frame.depth, frame.topic,
                    in_ms(before.taken - time))};
  }
  const auto check = [&](std::size_t at, Pose& pose) -> std::optional<Error> {
    const MovingFrame& declared = frame.moving->frame;
    if (!poses.is_of(at, declared.parent, declared.child)) {
      return Error{Missing::kValid, fmt::format("{}: a message on \"{}\" speaks of other frames",
                                                edge(frame), frame.topic)};
    }
    return make_valid(pose.child_to_parent) ? std::nullopt : std::optional(bad());
  };
  if (auto error = check(index, before)) {
    return error;
  }
  found = before.child_to_parent;
  if (before.taken == time) {
    return std::nullopt;
  }
  if (index + 1 == size) {  // None is newer than requested.
    if (time - before.taken > options_.max_hold) {
      return Error{
          Missing::kNewPose,
          fmt::format("{}: the newest on \"{}\" is {} older than asked; {} are allowed (max_hold)",
                      edge(frame), frame.topic, in_ms(time - before.taken),
                      in_ms(options_.max_hold))};
    }
    return std::nullopt;
  }
  if (auto error = check(index + 1, after)) {
    return error;
  }
  const double part = static_cast<double>((time - before.taken).count()) /
                      static_cast<double>((after.taken - before.taken).count());
  found = interpolate(before.child_to_parent, after.child_to_parent, part);
  return std::nullopt;
}

std::optional<Error> Tree::climb(std::size_t from, std::size_t to, Time time, Transform& up) const {
  for (; from != to; from = frames_[from].parent) {
    Transform step;
    if (auto error = look(frames_[from], time, step)) {
      return error;
    }
    up = step * up;
  }
  return std::nullopt;
}

Error Tree::unknown(std::string_view name) const {
  std::string known;
  std::string nearest;
  std::size_t least = name.size() / 3 + 2;  // A greater distance is no misspelling.
  for (const auto& [other, index] : names_) {
    known += (known.empty() ? "" : ", ") + other;
    if (const std::size_t letters = distance(name, other); letters < least) {
      least = letters;
      nearest = other;
    }
  }
  return {Missing::kFrame,
          fmt::format("there is no frame \"{}\"; known frames: {}{}", name,
                      known.empty() ? "none" : known,
                      nearest.empty() ? "" : "; did you mean \"" + nearest + "\"?")};
}

Error Tree::unconnected(std::size_t a, std::size_t b) const {
  const auto top = [&](std::size_t index, std::string& problem) {
    for (std::size_t steps = 0; steps <= frames_.size(); ++steps) {
      if (!frames_[index].problem.empty()) {
        problem = frames_[index].problem;
      }
      if (frames_[index].parent == kNoFrame) {
        break;
      }
      index = frames_[index].parent;
    }
    return frames_[index].name;
  };
  std::string problem;
  const std::string top_of_a = top(a, problem);
  const std::string top_of_b = top(b, problem);
  if (!problem.empty()) {
    return {Missing::kSense, problem};
  }
  return {Missing::kConnection,
          fmt::format("no transform leads from {} to {}: above {} is {}, above {} is {}",
                      frames_[a].name, frames_[b].name, frames_[a].name, top_of_a, frames_[b].name,
                      top_of_b)};
}

Result<Transform> Tree::a_to_b(std::string_view a, std::string_view b, Time time) {
  refresh();
  const auto from = find(a);
  const auto to = find(b);
  if (!from || !to) {
    return unknown(from ? b : a);
  }
  const auto meeting = common(*from, *to);
  if (!meeting) {
    return unconnected(*from, *to);
  }
  Transform a_up;
  if (auto error = climb(*from, *meeting, time, a_up)) {
    return *std::move(error);
  }
  Transform b_up;
  if (auto error = climb(*to, *meeting, time, b_up)) {
    return *std::move(error);
  }
  return b_up.inverse() * a_up;
}

Result<Transform> Tree::a_to_b(std::string_view a, std::string_view b) {
  const auto time = newest_time(a, b);
  return time ? a_to_b(a, b, *time) : Result<Transform>(time.error());
}

std::optional<Error> Tree::newest(std::size_t from, std::size_t to, Time& time) const {
  for (; from != to; from = frames_[from].parent) {
    const Frame& frame = frames_[from];
    if (!frame.problem.empty()) {
      return Error{Missing::kSense, frame.problem};
    }
    if (frame.moving == nullptr) {
      continue;
    }
    const detail::Poses& poses = *frame.moving->poses;
    if (poses.size() == 0) {
      Transform ignored;
      return look(frame, time, ignored);
    }
    time = std::min(time, poses.at(poses.size() - 1).taken);
  }
  return std::nullopt;
}

Result<Time> Tree::newest_time(std::string_view a, std::string_view b) {
  refresh();
  const auto from = find(a);
  const auto to = find(b);
  if (!from || !to) {
    return unknown(from ? b : a);
  }
  const auto meeting = common(*from, *to);
  if (!meeting) {
    return unconnected(*from, *to);
  }
  Time time = Time::max();
  auto error = newest(*from, *meeting, time);
  if (!error) {
    error = newest(*to, *meeting, time);
  }
  return error ? Result<Time>(*std::move(error)) : Result<Time>(time);
}

std::vector<std::string> Tree::problems() {
  refresh();
  return problems_;
}

std::vector<std::string> Tree::frames() {
  refresh();
  std::vector<std::string> names;
  for (const auto& [name, index] : names_) {
    names.push_back(name);
  }
  return names;
}

void StaticBroadcaster::set(std::string_view parent, std::string_view child,
                            const Transform& child_to_parent) {
  for (transform::Transform& one : *all_.mutable_transforms()) {
    if (one.child() == child) {
      to_message(parent, child, {.child_to_parent = child_to_parent}, one);
      return;
    }
  }
  to_message(parent, child, {.child_to_parent = child_to_parent}, *all_.add_transforms());
}

void StaticBroadcaster::publish() {
  auto message = publisher_.loan();
  message->CopyFrom(all_);
  publisher_.publish(std::move(message));
}

}  // namespace fastcycle::transforms
