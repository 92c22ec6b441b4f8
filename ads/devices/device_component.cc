#include "device_component.h"

#include <chrono>
#include <utility>

namespace ads {
namespace {

using std::chrono_literals::operator""ms;

// How often the component checks its thread's reports on the device.
constexpr fastcycle::Duration kLook = 100ms;

}  // namespace

DeviceComponent::DeviceComponent(fastcycle::Context& context, double silence_s)
    : Component(context), config_(read_device_config(context, silence_s)) {}

void DeviceComponent::create_device_thread(fastcycle::Context& context, const std::string& name,
                                           std::function<Device&()> device) {
  context.create_thread(name, [this, device = std::move(device)](const std::stop_token& stop) {
    serve_device(device(), config_, trouble_, stop);
  });
  (void)context.create_timer({.period = kLook}, [this] { look(); });
}

void DeviceComponent::look() {
  std::string trouble = observe("trouble", [this] { return trouble_.get(); });
  if (trouble.empty()) {
    trouble = other_trouble_;
  }
  if (trouble == reported_) {
    return;
  }
  if (trouble.empty()) {
    log().info("the device is there again, after: {}", reported_);
    health(fastcycle::Health::kOk);
  } else {
    log().warning("{}", trouble);
    health(fastcycle::Health::kDegraded, trouble);
  }
  reported_ = std::move(trouble);
}

}  // namespace ads
