#pragma once

#include <chrono>
#include <cstddef>

namespace rav4 {

/// Tells how late each fix arrived, compared with the others of its receiver.
///
/// A receiver measures at even times of its own clock, but its fixes arrive unevenly: transport and
/// scheduling add some tens of milliseconds, and at 20 m/s each of them is 2 cm. The mean of
/// (arrival - receiver's time stamp) is the offset between both clocks plus the mean transport
/// time; what one fix deviates from it is its own lateness.
///
/// The mean is a running one over the first fixes, and an exponential one after `kMemory` of them.
/// A step of the receiver's clock begins anew.
///
/// @threads  Confined.
class ReceiverClock {
 public:
  static constexpr std::size_t kMemory = 100;

  /// How much later than the mean this fix arrived; negative if it was earlier. Zero for the first.
  ///
  /// @param utc_ms  The receiver's time stamp; one that is not finite gives zero and changes
  /// nothing.
  std::chrono::nanoseconds lateness(std::chrono::nanoseconds arrival, double utc_ms);

 private:
  std::size_t count_ = 0;
  double first_utc_ms_ = 0.0;
  std::chrono::nanoseconds first_arrival_{};
  double mean_s_ = 0.0;  // Of the offset, less that of the first fix.
};

}  // namespace rav4
