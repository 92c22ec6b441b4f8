#pragma once

#include <cstddef>
#include <vector>

namespace rav4 {

/// The points of a long run in bounded memory: when it is full, every other point is discarded, and
/// from then on only every other new one is kept.
///
/// @threads  Confined.
template <typename Point>
class Trace {
 public:
  /// @pre  `capacity >= 2`
  explicit Trace(std::size_t capacity) : capacity_(capacity) { points_.reserve(capacity); }

  void add(const Point& point) {
    if (seen_++ % stride_ != 0) {
      return;
    }
    if (points_.size() == capacity_) {
      thin_out();
      if ((seen_ - 1) % stride_ != 0) {
        return;
      }
    }
    points_.push_back(point);
  }

  [[nodiscard]] const std::vector<Point>& points() const { return points_; }

 private:
  void thin_out() {
    std::size_t kept = 0;
    for (std::size_t index = 0; index < points_.size(); index += 2) {
      points_[kept++] = points_[index];
    }
    points_.resize(kept);
    stride_ *= 2;
  }

  std::size_t capacity_;
  std::size_t stride_ = 1;
  std::size_t seen_ = 0;
  std::vector<Point> points_;
};

}  // namespace rav4
