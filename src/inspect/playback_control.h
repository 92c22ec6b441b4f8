#pragma once

#include "inspect/inspect.pb.h"

namespace fastcycle::inspect {

/// Control of the playback of a recording, as far as tools have access to it.
///
/// @threads  Safe.
class PlaybackControl {
 public:
  PlaybackControl() = default;
  PlaybackControl(const PlaybackControl&) = delete;
  PlaybackControl& operator=(const PlaybackControl&) = delete;
  virtual ~PlaybackControl() = default;

  /// @errors  `Refusal`: the playback does not support it.
  virtual void obey(const protocol::ControlPlayback& control) = 0;
  [[nodiscard]] virtual protocol::Playback state() const = 0;
};

}  // namespace fastcycle::inspect
