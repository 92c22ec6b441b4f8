#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace fastcycle::campaign {

/// One fault drawn by a seed: its form in an overlay, and its entry of the plan.
struct DrawnFault {
  nlohmann::ordered_json json;
  std::size_t source = 0;
};

/// The distribution of faults: faults as in the application file, in which numbers may be ranges.
///
/// @threads  Compatible.
class Plan {
 public:
  /// Parses `text` of `file`. None, with one message for each error, if it is not a plan.
  static std::optional<Plan> read(const std::string& text, const std::string& file,
                                  std::vector<std::string>& errors);

  /// The faults of `seed`: always the same.
  [[nodiscard]] std::vector<DrawnFault> draw(std::uint64_t seed) const;

 private:
  std::vector<nlohmann::ordered_json> faults_;
  std::uint64_t at_least_ = 1;  ///< Minimum number of faults at once.
  std::uint64_t at_most_ = 1;
};

/// The overlay that injects `faults`; `seed` is that of their own draws.
[[nodiscard]] nlohmann::ordered_json overlay_of(const std::vector<DrawnFault>& faults,
                                                std::uint64_t seed);

}  // namespace fastcycle::campaign
