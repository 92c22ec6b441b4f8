#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>

#include <linux/can.h>

#include "devices/descriptor.h"
#include "devices/device.h"

namespace ads {

/// The content of an error frame.
struct CanError {
  bool is_bus_off = false;  ///< The controller has left the bus.
  bool is_restart = false;  ///< The controller takes part again.
  std::string text;         ///< In words: "no acknowledgement, error passive".
};

/// Reads an error frame (linux/can/error.h).
CanError can_error_of(const can_frame& frame);

/// A CAN bus: a socket that carries `can_frame`s.
///
/// @threads  As `Device`; `send` is safe to call on another thread.
class CanBus : public Device {
 public:
  /// Called with each frame, including error frames; returns whether it is usable.
  using Sink = std::function<bool(const can_frame&)>;

  explicit CanBus(Sink sink) : sink_(std::move(sink)) {}

  int open() final;
  bool read() final;
  void close() noexcept final;

  /// Sends without waiting. Returns why it failed; empty if the frame was handed to the bus.
  [[nodiscard]] std::string send(const can_frame& frame);

 protected:
  [[nodiscard]] virtual Descriptor open_socket() = 0;
  /// As `::send`.
  [[nodiscard]] virtual bool send_on(int socket, const can_frame& frame) const = 0;

 private:
  Sink sink_;
  std::mutex mutex_;
  Descriptor socket_;  // Written with the lock, by the thread that reads without.
};

/// A CAN interface of Linux (SocketCAN): "can0", "vcan0".
class SocketCanBus final : public CanBus {
 public:
  SocketCanBus(std::string interface, Sink sink)
      : CanBus(std::move(sink)), interface_(std::move(interface)) {}

  [[nodiscard]] std::string name() const override { return "CAN " + interface_; }

 protected:
  [[nodiscard]] Descriptor open_socket() override;
  [[nodiscard]] bool send_on(int socket, const can_frame& frame) const override;

 private:
  std::string interface_;
};

/// A substitute for a bus on one machine, where there is no CAN: each of its two ends is a datagram
/// socket with a path, and sends to the path of the other.
class FakeCanBus final : public CanBus {
 public:
  FakeCanBus(std::filesystem::path own, std::filesystem::path other, Sink sink)
      : CanBus(std::move(sink)), own_(std::move(own)), other_(std::move(other)) {}
  ~FakeCanBus() override;

  [[nodiscard]] std::string name() const override { return "fake CAN " + own_.string(); }

  /// The paths of the ADS's end and of the vehicle's end of the bus `bus`.
  static std::filesystem::path ads_end(const std::filesystem::path& bus);
  static std::filesystem::path vehicle_end(const std::filesystem::path& bus);

 protected:
  [[nodiscard]] Descriptor open_socket() override;
  [[nodiscard]] bool send_on(int socket, const can_frame& frame) const override;

 private:
  std::filesystem::path own_;
  std::filesystem::path other_;
};

}  // namespace ads
