#pragma once

#include <optional>

#include <fastcycle/fastcycle.h>

#include "applications/rav4/drive/playback.h"
#include "common/npy.h"
#include "gnss/fix.pb.h"

namespace rav4 {

/// Publishes the recorded fixes of a drive, each at its time of arrival.
///
/// Out:  `gnss/fix`, one message for each recorded row
class GnssDriver final : public fastcycle::Component {
 public:
  explicit GnssDriver(fastcycle::Context& context);
  void start() override;
  void activate() override;
  void deactivate() override;

 private:
  void play();
  void schedule();
  void publish(const Playback::Row& row);

  fastcycle::Param<fastcycle::Path> data_;
  fastcycle::Publisher<gnss::Fix> fixes_;
  fastcycle::Timer timer_;
  fastcycle::Source source_;

  bool was_active_ = false;
  std::optional<Playback> playback_;
  std::optional<ads::NumberTable> values_;
};

}  // namespace rav4
