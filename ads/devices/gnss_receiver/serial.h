#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string_view>

#include "devices/descriptor.h"
#include "devices/device.h"

namespace ads {

enum class Parity : std::uint8_t { kNone, kEven, kOdd };

struct SerialConfig {
  std::filesystem::path path;
  int baud = 9600;
  Parity parity = Parity::kNone;
  int stop_bits = 1;
};

/// Whether termios supports this speed.
bool is_baud(int baud);

/// A serial line in raw mode with 8 data bits.
///
/// @threads  Confined to the thread that serves it.
class SerialDevice final : public Device {
 public:
  /// Called with received bytes; returns whether something in them is usable.
  using Sink = std::function<bool(std::string_view)>;

  SerialDevice(const SerialConfig& config, Sink sink) : config_(config), sink_(std::move(sink)) {}

  [[nodiscard]] std::string name() const override { return config_.path.string(); }
  int open() override;
  bool read() override;
  void close() noexcept override { line_.reset(); }

 private:
  SerialConfig config_;
  Sink sink_;
  Descriptor line_;
};

}  // namespace ads
