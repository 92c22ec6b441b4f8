#pragma once

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// What plays a recording into an application, as far as tools may steer it.
///
/// @threads  Safe.
class PlaybackControl {
 public:
  PlaybackControl() = default;
  PlaybackControl(const PlaybackControl&) = delete;
  PlaybackControl& operator=(const PlaybackControl&) = delete;
  virtual ~PlaybackControl() = default;

  /// @errors  `Refusal`: it cannot do that.
  virtual void obey(const protocol::ControlPlayback& control) = 0;
  [[nodiscard]] virtual protocol::Playback state() const = 0;
};

}  // namespace fastcycle::inspect
