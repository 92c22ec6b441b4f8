#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::mcap {

/// Whether `topic` matches `pattern`: `*` matches any characters of one level and `?` one of them;
/// `**` as a whole level matches any number of levels, including none; everything else matches
/// itself.
///
///     control/speed        control/*        camera/**        **/status
///
/// Takes at most time proportional to the product of both lengths.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view topic);

/// Selects topics: those that match a pattern of `topics` and none of `except`.
struct TopicFilter {
  std::vector<std::string> topics = {};  ///< Empty: all.
  std::vector<std::string> except = {};

  [[nodiscard]] bool wants(std::string_view topic) const;
};

}  // namespace fastcycle::mcap
