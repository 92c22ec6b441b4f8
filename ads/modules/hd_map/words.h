#pragma once

#include <algorithm>
#include <string_view>

namespace ads {

/// Whether `word` is one of the range `words`.
bool is_one_of(const auto& words, std::string_view word) {
  return std::ranges::find(words, word) != words.end();
}

}  // namespace ads
