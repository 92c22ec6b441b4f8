#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include <unistd.h>

#include "measure/clock.h"
#include "measure/samples.h"

namespace fastcycle::direct {

/// A message: the encapsulation, and a sequence of bytes that begins with the message's number and
/// time of sending.
class Message {
 public:
  explicit Message(std::size_t size) : bytes_(kHeadBytes + (size + 3) / 4 * 4) {
    constexpr unsigned char kLittleEndian[4] = {0, 1, 0, 0};
    const auto length = static_cast<std::uint32_t>(size);
    std::memcpy(bytes_.data(), kLittleEndian, sizeof kLittleEndian);
    std::memcpy(bytes_.data() + sizeof kLittleEndian, &length, sizeof length);
  }
  /// Stamps it with the current time.
  void stamp(std::int64_t number) {
    const std::int64_t stamps[2] = {number, measure::now_ns()};
    std::memcpy(bytes_.data() + kHeadBytes, stamps, sizeof stamps);
  }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

  /// The stamps of a message that arrives now.
  static measure::Sample read(std::span<const std::byte> bytes) {
    const std::int64_t arrived_ns = measure::now_ns();
    std::int64_t stamps[2] = {};
    if (bytes.size() >= kHeadBytes + sizeof stamps) {
      std::memcpy(stamps, bytes.data() + kHeadBytes, sizeof stamps);
    }
    return {
        .number = stamps[0], .made_ns = stamps[1], .sent_ns = stamps[1], .arrived_ns = arrived_ns};
  }

 private:
  static constexpr std::size_t kHeadBytes = 8;

  std::vector<std::byte> bytes_;
};

/// The command line options.
struct Plan {
  bool is_sender = false;
  std::uint32_t domain = 0;
  std::string interface;
  std::size_t size = 0;
  std::int64_t count = 0;
  std::int64_t interval_us = 0;
  std::string file;  ///< Of the samples, written by the receiver.
};

/// Waits until standard input ends.
inline void wait_for_end() {
  char byte = 0;
  while (read(STDIN_FILENO, &byte, 1) > 0) {
  }
}

/// Calls `write(bytes)` for `plan.count` messages, one each interval.
template <typename Write>
void send_all(const Plan& plan, const Write& write) {
  Message message(plan.size);
  std::int64_t next_ns = measure::now_ns();
  for (std::int64_t number = 0; number < plan.count; ++number) {
    measure::sleep_until(next_ns);
    next_ns += plan.interval_us * 1000;
    message.stamp(number);
    write(message.bytes());
  }
}

/// Sends or receives by one middleware as `plan` specifies, and returns the received samples.
measure::Samples run(const Plan& plan);

}  // namespace fastcycle::direct
