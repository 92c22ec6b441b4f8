#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace fastcycle::campaign {

/// One fault that a seed drew: as it stands in an overlay, and from which entry of the plan it is.
struct DrawnFault {
  nlohmann::ordered_json json;
  std::size_t source = 0;
};

/// What may be drawn: faults as in the application file, in which numbers may be ranges.
///
/// @threads  Compatible.
class Plan {
 public:
  /// Reads `text`, which stands in `file`. None, and what is wrong, one mistake each, if it is not
  /// a plan.
  static std::optional<Plan> read(const std::string& text, const std::string& file,
                                  std::vector<std::string>& mistakes);

  /// The faults of `seed`: always the same.
  [[nodiscard]] std::vector<DrawnFault> draw(std::uint64_t seed) const;

 private:
  std::vector<nlohmann::ordered_json> faults_;
  std::uint64_t at_least_ = 1;  ///< So many faults at once.
  std::uint64_t at_most_ = 1;
};

/// The overlay that injects `faults`; `seed` is that of their own draws.
[[nodiscard]] nlohmann::ordered_json overlay_of(const std::vector<DrawnFault>& faults,
                                                std::uint64_t seed);

}  // namespace fastcycle::campaign
