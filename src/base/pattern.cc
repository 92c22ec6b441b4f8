#include "base/pattern.h"

#include <cstddef>
#include <vector>

namespace fastcycle::base {
namespace {

std::vector<std::string_view> levels_of(std::string_view text) {
  std::vector<std::string_view> levels;
  for (;;) {
    const std::size_t end = text.find('/');
    levels.push_back(text.substr(0, end));
    if (end == std::string_view::npos) {
      return levels;
    }
    text.remove_prefix(end + 1);
  }
}

/// Whether `pattern`, with stars in it, covers all of `found`. Only the last star is ever given
/// more: what came before it is as short as can be already.
template <typename Sequence, typename IsStar, typename Equal>
bool covers(const Sequence& pattern, const Sequence& found, const IsStar& is_star,
            const Equal& equal) {
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::size_t p = 0;
  std::size_t f = 0;
  std::size_t after_star = kNone;
  std::size_t star_ends = 0;
  while (f < found.size() || p < pattern.size()) {
    if (p < pattern.size() && is_star(pattern[p])) {
      after_star = ++p;
      star_ends = f;
    } else if (p < pattern.size() && f < found.size() && equal(pattern[p], found[f])) {
      ++p;
      ++f;
    } else if (after_star != kNone && star_ends < found.size()) {
      p = after_star;
      f = ++star_ends;
    } else {
      return false;
    }
  }
  return true;
}

bool covers_level(std::string_view pattern, std::string_view level) {
  return covers(
      pattern, level, [](char c) { return c == '*'; },
      [](char wanted, char found) { return wanted == found || wanted == '?'; });
}

}  // namespace

bool matches(std::string_view pattern, std::string_view name) {
  return covers(
      levels_of(pattern), levels_of(name), [](std::string_view level) { return level == "**"; },
      covers_level);
}

}  // namespace fastcycle::base
