#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/playback.h"
#include "can/frame.pb.h"
#include "common/npy.h"

namespace rav4 {

/// Publishes the recorded CAN frames of a drive, each at its recorded time.
///
/// Out:  `can/frames`, one message for each recorded row
class CanDriver final : public fastcycle::Component {
 public:
  explicit CanDriver(fastcycle::Context& context);
  void start() override;

 private:
  void check(const std::filesystem::path& folder) const;
  void play();
  void schedule();
  void publish(const Playback::Row& row);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Publisher<can::Frame> frames_;
  fastcycle::Timer timer_;
  fastcycle::Source source_;

  std::optional<Playback> playback_;
  std::vector<std::int64_t> addresses_;
  std::vector<std::int64_t> buses_;
  ads::ByteTable payloads_;
};

}  // namespace rav4
