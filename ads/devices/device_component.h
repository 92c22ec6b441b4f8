#pragma once

#include <functional>
#include <string>
#include <utility>

#include <fastcycle/fastcycle.h>

#include "device.h"

namespace ads {

/// A component with a thread that reads from a device. Its health reports faults of the device;
/// each change is logged.
///
/// @threads  As a component; calls to `device` are confined to the thread.
class DeviceComponent : public fastcycle::Component {
 protected:
  /// Declares the params of `read_device_config`.
  DeviceComponent(fastcycle::Context& context, double silence_s);

  /// Call in the constructor: from `start` on a thread named `name` serves `device`, which is
  /// called when the thread begins.
  void create_device_thread(fastcycle::Context& context, const std::string& name,
                            std::function<Device&()> device);

  /// Call in an activation: reports a fault other than the device's own; empty if there is none.
  void set_trouble(std::string text) { other_trouble_ = std::move(text); }

  /// The device's fault as reported by the thread.
  [[nodiscard]] DeviceTrouble& trouble() { return trouble_; }

 private:
  void look();

  DeviceConfig config_;
  DeviceTrouble trouble_;
  std::string other_trouble_;
  std::string reported_;
};

}  // namespace ads
