#pragma once

#include <functional>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "device.h"

namespace ads {

/// A component with a thread that reads from a device. Its health says whether the device is there;
/// each change is a line of the log.
///
/// @threads  As a component; what `device` does is confined to the thread.
class DeviceComponent : public fastcycle::Component {
 protected:
  /// Declares the params of `read_device_config`.
  DeviceComponent(fastcycle::Context& context, double silence_s);

  /// Called in the constructor: from `start` on `device` is served by a thread of that name.
  /// `device` is asked for when the thread begins.
  void create_device_thread(fastcycle::Context& context, const std::string& name,
                            std::function<Device&()> device);

  /// In an activation: what else is wrong, while the device itself is well; empty if nothing is.
  void tell(std::string text) { other_trouble_ = std::move(text); }

  /// As the thread tells it.
  [[nodiscard]] DeviceTrouble& trouble() { return trouble_; }

 private:
  void look();

  DeviceConfig config_;
  DeviceTrouble trouble_;
  std::string other_trouble_;
  std::string told_;
};

}  // namespace ads
