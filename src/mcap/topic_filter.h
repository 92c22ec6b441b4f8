#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fastcycle::mcap {

/// Whether `topic` is one that `pattern` means: `*` stands for any characters of one level and `?`
/// for one of them; `**` as a whole level for any number of levels, none included; everything else
/// for itself.
///
///     control/speed        control/*        camera/**        **/status
///
/// Takes time as the product of both lengths at most.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view topic);

/// Which topics somebody wants: those that a pattern of `topics` means and none of `except`.
struct TopicFilter {
  std::vector<std::string> topics = {};  ///< Empty: all.
  std::vector<std::string> except = {};

  [[nodiscard]] bool wants(std::string_view topic) const;
};

}  // namespace fastcycle::mcap
