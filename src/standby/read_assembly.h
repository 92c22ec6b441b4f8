#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "broker/read_ring.h"

namespace fastcycle::standby {

/// Assembles the reads of one component's activations from its read ring.
///
/// @threads  By one thread at a time.
class ReadAssembly {
 public:
  /// `ring` must outlive it.
  explicit ReadAssembly(const detail::ReadRing& ring) : ring_(ring) {}

  /// Reads new entries of the ring. False if some were overwritten before.
  [[nodiscard]] bool read();

  /// The reads of `activation`; discards those of earlier ones. Complete once the activation has
  /// ended.
  [[nodiscard]] std::vector<detail::ReplayedReads::Entry> take(std::uint64_t activation);

 private:
  const detail::ReadRing& ring_;
  std::uint64_t next_ = 0;
  std::vector<detail::Read> new_;
  std::map<std::uint64_t, std::vector<detail::ReplayedReads::Entry>> by_activation_;
};

}  // namespace fastcycle::standby
