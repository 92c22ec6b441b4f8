#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "broker/read_ring.h"
#include "executor/activation_ring.h"

namespace fastcycle::detail {

/// The activity of another process's workers and components, as readable here. The content of the
/// rings is not trusted.
///
/// @threads  Safe.
class PeerActivity {
 public:
  struct Rings {
    std::vector<const ActivationRing*> workers;
    /// By component, in the order of the application file; null: it runs elsewhere.
    std::vector<const ReadRing*> reads;
  };

  static constexpr std::uint32_t kReadable = 4;

  PeerActivity() = default;
  PeerActivity(const PeerActivity&) = delete;
  PeerActivity& operator=(const PeerActivity&) = delete;
  virtual ~PeerActivity() = default;

  /// The process, and the workers of its executors, as they are named.
  [[nodiscard]] virtual const std::string& name() const = 0;
  [[nodiscard]] virtual const std::vector<std::string>& worker_names() const = 0;
  /// Its number on this machine; 0: it has ended.
  [[nodiscard]] virtual std::int64_t pid() const = 0;
  /// Counts the starts of the process, from 1; 0: it has ended.
  [[nodiscard]] virtual std::uint32_t incarnation() const = 0;
  /// Those of that incarnation, which begins with empty ones: of the present one, or one of the
  /// `kReadable` - 1 before it.
  [[nodiscard]] virtual const Rings& rings(std::uint32_t incarnation) const = 0;
};

}  // namespace fastcycle::detail
