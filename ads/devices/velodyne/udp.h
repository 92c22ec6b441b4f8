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
  /// Called with each datagram, up to 2048 bytes of it; returns whether it is usable.
  using Sink = std::function<bool(std::span<const std::uint8_t>)>;

  /// @param  address  of the interface to listen on; "0.0.0.0" for all
  /// @param  sender   the accepted source address; empty: any
  /// @errors  Throws `std::runtime_error` if an address is not an IPv4 address.
  UdpDevice(const std::string& address, std::uint16_t port, const std::string& sender, Sink sink);

  [[nodiscard]] std::string name() const override;
  int open() override;
  bool read() override;
  void close() noexcept override { socket_.reset(); }

 private:
  std::string address_text_;
  std::uint32_t address_;  // In network byte order.
  std::uint16_t port_;
  std::optional<std::uint32_t> sender_;
  Sink sink_;
  Descriptor socket_;
  std::array<std::uint8_t, 2048> buffer_{};
};

/// "192.168.1.201" in network byte order.
///
/// @errors  Throws `std::runtime_error` if it is not an IPv4 address.
std::uint32_t ipv4_of(const std::string& text);

}  // namespace ads::velodyne
