#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "broker/read_ring.h"

namespace fastcycle::standby {

/// What the activations of one component learned, put together from its read ring.
///
/// @threads  By one thread at a time.
class ReadAssembly {
 public:
  /// `ring` outlives it.
  explicit ReadAssembly(const detail::ReadRing& ring) : ring_(ring) {}

  /// Takes what is new in the ring. False if some of it was written over before.
  [[nodiscard]] bool read();

  /// What `activation` learned; what was learned before is forgotten. Complete once the activation
  /// is over.
  [[nodiscard]] std::vector<detail::ToldReads::Entry> take(std::uint64_t activation);

 private:
  const detail::ReadRing& ring_;
  std::uint64_t next_ = 0;
  std::vector<detail::Read> new_;
  std::map<std::uint64_t, std::vector<detail::ToldReads::Entry>> by_activation_;
};

}  // namespace fastcycle::standby
