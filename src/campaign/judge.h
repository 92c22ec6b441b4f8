#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace fastcycle::campaign {

/// One condition that the report of a run has to meet: `collisions == 0`,
/// `world.goal_reached == true`, `components.perception.faults < 2`.
///
/// @threads  Compatible.
class Judge {
 public:
  /// None, with the reason in `why`, if `text` is no condition.
  static std::optional<Judge> parse(const std::string& text, std::string& why);

  /// How `report` violates this condition, such as "collisions is 2"; empty if it is met.
  [[nodiscard]] std::string find_fault(const nlohmann::ordered_json& report) const;
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  Judge() = default;

  std::string text_;
  std::string path_;
  std::string comparison_;
  std::string value_;  ///< JSON.
};

}  // namespace fastcycle::campaign
