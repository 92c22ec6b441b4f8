#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "applications/kitti/drive/frames.h"
#include "applications/kitti/drive/sweep_file.h"
#include "lidar/sweep.pb.h"

namespace kitti {

/// Publishes the recorded sweeps of a drive, each at the end of its turn. Of several passes each
/// second one is played in reverse: the vehicle drives backwards, and the sensor turns the other
/// way.
///
/// Out:  `lidar/points`, one message for each file
class LidarDriver final : public fastcycle::Component {
 public:
  explicit LidarDriver(fastcycle::Context& context);
  void start() override;
  void stop() override;

 private:
  struct Turn {
    const Frame* frame;
    std::int64_t slot;  // Since the start, in frames.
    bool is_backwards;
  };

  void play();
  [[nodiscard]] Turn turn(std::size_t number) const;
  void schedule();
  void publish(const Turn& turn);
  void place(const std::vector<Point>& points, bool is_clockwise, lidar::Sweep& sweep);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Param<int> columns_;
  fastcycle::Param<int> rings_;
  fastcycle::Param<int> passes_;
  fastcycle::Param<bool> is_clockwise_;
  fastcycle::Param<double> mount_forward_m_;
  fastcycle::Param<double> mount_height_m_;
  fastcycle::Publisher<lidar::Sweep> sweeps_;
  fastcycle::Timer timer_;
  fastcycle::Source source_;

  std::vector<Frame> frames_;
  std::size_t next_ = 0;  // Of all passes.
  std::vector<Point> points_of_next_;
  std::int64_t points_ = 0;
  std::int64_t points_left_out_ = 0;
};

}  // namespace kitti
