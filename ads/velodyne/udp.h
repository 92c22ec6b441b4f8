#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "devices/descriptor.h"
#include "devices/device.h"

namespace ads::velodyne {

/// Receives UDP datagrams over IPv4.
///
/// @threads  Confined to the thread that serves it.
class UdpDevice final : public Device {
 public:
  /// Called with each datagram; returns whether it is usable. At most 2048 bytes of it.
  using Sink = std::function<bool(std::span<const std::uint8_t>)>;

  /// @param  address  of the interface to listen at; "0.0.0.0" is all of them
  /// @param  sender   whose datagrams count; empty: everybody's
  /// @errors  Throws `std::runtime_error` for what is no IPv4 address.
  UdpDevice(const std::string& address, std::uint16_t port, const std::string& sender, Sink sink);

  [[nodiscard]] std::string name() const override;
  int open() override;
  bool read() override;
  void close() noexcept override { socket_.reset(); }

 private:
  std::string address_text_;
  std::uint32_t address_;  // As the network has it.
  std::uint16_t port_;
  std::optional<std::uint32_t> sender_;
  Sink sink_;
  Descriptor socket_;
  std::array<std::uint8_t, 2048> buffer_{};
};

/// "192.168.1.201" as the network has it.
///
/// @errors  Throws `std::runtime_error` for what is no IPv4 address.
std::uint32_t ipv4_of(const std::string& text);

}  // namespace ads::velodyne
