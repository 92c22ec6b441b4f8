#pragma once

#include <chrono>
#include <cstddef>

namespace rav4 {

/// Computes the lateness of each fix compared with the others of its receiver.
///
/// A receiver measures at equal intervals of its own clock, but its fixes arrive unevenly:
/// transport and scheduling add some tens of milliseconds, and at 20 m/s each of them is 2 cm. The
/// mean of (arrival - receiver's timestamp) is the offset between both clocks plus the mean
/// transport time; the deviation of one fix from it is the fix's own lateness.
///
/// The mean is an arithmetic one over the first fixes, and an exponential one after `kMemory` of
/// them. It is reset when the receiver's clock steps.
///
/// @threads  Confined.
class ReceiverClock {
 public:
  static constexpr std::size_t kMemory = 100;

  /// The lateness of this fix against the mean; negative if it was early. Zero for the first.
  ///
  /// @param utc_ms  The receiver's timestamp; a non-finite one gives zero and changes nothing.
  std::chrono::nanoseconds lateness(std::chrono::nanoseconds arrival, double utc_ms);

 private:
  std::size_t count_ = 0;
  double first_utc_ms_ = 0.0;
  std::chrono::nanoseconds first_arrival_{};
  double mean_s_ = 0.0;  // Of the offset, less that of the first fix.
};

}  // namespace rav4
