#include "device.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "descriptor.h"

namespace ads {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// Becomes readable when the thread is asked to end.
class StopEvent {
 public:
  explicit StopEvent(const std::stop_token& stop)
      : event_(checked_descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), "eventfd")),
        wake_(stop, [this] {
          const std::uint64_t one = 1;
          [[maybe_unused]] const auto written = ::write(event_.get(), &one, sizeof one);
        }) {}

  // Waits for `descriptor` (-1: none), at most until `limit`; returns the events of `poll`.
  [[nodiscard]] short wait(int descriptor, std::optional<Clock::time_point> limit) const {
    pollfd waited[] = {{.fd = event_.get(), .events = POLLIN, .revents = 0},
                       {.fd = descriptor, .events = POLLIN, .revents = 0}};
    int timeout_ms = -1;
    if (limit) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(*limit - Clock::now());
      timeout_ms = static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 3'600'000));
    }
    if (::poll(waited, 2, timeout_ms) < 0 && errno != EINTR) {
      throw_errno("poll");
    }
    return waited[1].revents;
  }

 private:
  Descriptor event_;
  std::stop_callback<std::function<void()>> wake_;
};

Clock::time_point after(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(Seconds(seconds));
}

// Until the device is lost or the thread has to end; `has_read` once something usable has come.
void read_until_lost(Device& device, const DeviceConfig& config, DeviceTrouble& trouble,
                     const StopEvent& event, const std::stop_token& stop, bool& has_read) {
  const int descriptor = device.open();
  std::optional<Clock::time_point> silent_at = after(config.silence_s);
  while (!stop.stop_requested()) {
    const short events = event.wait(descriptor, silent_at);
    if (stop.stop_requested()) {
      return;
    }
    bool is_usable = false;
    if (events != 0) {
      is_usable = device.read();
    }
    if (is_usable) {
      has_read = true;
      trouble.set({});
      silent_at = after(config.silence_s);
    } else if ((events & (POLLERR | POLLHUP | POLLNVAL)) != 0) {
      // Nothing to read, and no waiting for it either: trying again at once would be a busy loop.
      throw std::system_error(EIO, std::generic_category(), device.name());
    } else if (silent_at && Clock::now() >= *silent_at) {
      trouble.set(
          fmt::format("{}: nothing usable has come for {} s", device.name(), config.silence_s));
      silent_at.reset();
    }
  }
}

}  // namespace

DeviceConfig read_device_config(fastcycle::Context& context, double silence_s) {
  const DeviceConfig standard;
  const auto seconds = [&context](std::string_view name, double fallback, std::string what) {
    return context
        .param<double>(name, {.fallback = fallback,
                              .min = 0.001,
                              .max = 3600.0,
                              .unit = "s",
                              .description = std::move(what)})
        .get();
  };
  return {
      .retry_first_s =
          seconds("retry_first_s", standard.retry_first_s,
                  "Delay before the first retry of a lost device; it doubles with each retry"),
      .retry_max_s = seconds("retry_max_s", standard.retry_max_s, "Maximum delay between retries"),
      .silence_s = seconds("silence_s", silence_s,
                           "Time without usable data after which the device is reported")};
}

void DeviceTrouble::set(std::string text) {
  const std::lock_guard lock(mutex_);
  text_ = std::move(text);
}

std::string DeviceTrouble::get() const {
  const std::lock_guard lock(mutex_);
  return text_;
}

void serve_device(Device& device, const DeviceConfig& config, DeviceTrouble& trouble,
                  const std::stop_token& stop) {
  const StopEvent event(stop);
  double wait_s = config.retry_first_s;
  while (!stop.stop_requested()) {
    bool has_read = false;
    try {
      read_until_lost(device, config, trouble, event, stop, has_read);
    } catch (const std::system_error& error) {
      trouble.set(error.what());
    }
    device.close();
    if (has_read) {
      wait_s = config.retry_first_s;
    }
    const auto again = after(wait_s);
    while (!stop.stop_requested() && Clock::now() < again) {
      (void)event.wait(-1, again);
    }
    wait_s = std::min(2.0 * wait_s, config.retry_max_s);
  }
}

}  // namespace ads
