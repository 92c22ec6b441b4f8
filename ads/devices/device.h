#pragma once

#include <mutex>
#include <stop_token>
#include <string>

#include <fastcycle/fastcycle.h>

namespace ads {

/// A device that a thread reads from: a socket, a serial line, a camera.
///
/// @threads  Confined to the thread that serves it, unless an implementation states otherwise.
class Device {
 public:
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  virtual ~Device() = default;

  /// For display: "UDP 0.0.0.0:2368".
  [[nodiscard]] virtual std::string name() const = 0;

  /// Opens the device and returns a descriptor that `poll` can wait for. The device owns it.
  ///
  /// @errors  Throws `std::system_error` if that is not possible now.
  virtual int open() = 0;

  /// Reads the available data without waiting. Returns whether something usable was among it.
  ///
  /// @errors  Throws `std::system_error` if the device is lost.
  virtual bool read() = 0;

  /// Closes what `open` has opened; called also if that has thrown.
  virtual void close() noexcept = 0;
};

/// When a device is reopened, and when it counts as silent.
struct DeviceConfig {
  double retry_first_s = 0.1;  ///< After the first loss; doubled after each further one,
  double retry_max_s = 5.0;    ///< but never longer.
  double silence_s = 1.0;      ///< Time without usable data after which it is reported.
};

/// Declares the params `retry_first_s`, `retry_max_s` and `silence_s`.
DeviceConfig read_device_config(fastcycle::Context& context, double silence_s);

/// The current fault of a device: written by the thread that serves it, read by its component.
///
/// @threads  Safe.
class DeviceTrouble {
 public:
  void set(std::string text);
  /// Empty if there is no fault.
  [[nodiscard]] std::string get() const;

 private:
  mutable std::mutex mutex_;
  std::string text_;
};

/// Opens `device`, waits for it and reads it until `stop` is requested, which wakes it immediately.
///
/// A device that cannot be opened, or is lost, is closed and reopened with increasing delays; the
/// first usable reading resets the delay. `trouble` contains the fault, and is cleared as soon as
/// something usable has been read.
///
/// @threads  Blocks the calling thread.
/// @errors   Throws what the device throws, except `std::system_error`, which counts as a loss.
void serve_device(Device& device, const DeviceConfig& config, DeviceTrouble& trouble,
                  const std::stop_token& stop);

}  // namespace ads
