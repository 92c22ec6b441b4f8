#include "config/nearest.h"

#include <algorithm>
#include <numeric>

#include "config/problem.h"

namespace fastcycle::config {

namespace {

// Longer names are not compared: the work grows with the product of the lengths.
constexpr std::size_t kMaxLength = 64;

std::size_t allowed_distance(std::string_view a, std::string_view b) {
  return std::max<std::size_t>(1, std::max(a.size(), b.size()) / 3);
}

}  // namespace

std::size_t edit_distance(std::string_view a, std::string_view b, std::size_t limit) {
  // Three rows of the table of distances between the beginnings of `a` and of `b`.
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> last(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    std::swap(before, last);
    std::swap(last, row);
    // Each further row is made of these two.
    if (std::ranges::min(last) > limit && std::ranges::min(before) > limit) {
      return std::ranges::min(last);
    }
  }
  return last[b.size()];
}

std::string nearest(std::string_view name, const std::vector<std::string>& known) {
  if (name.empty() || name.size() > kMaxLength) {
    return {};
  }
  std::string best;
  std::size_t best_distance = kMaxLength;
  for (const std::string& candidate : known) {
    if (candidate.size() > kMaxLength) {
      continue;
    }
    // Nothing is worked out that cannot be nearer.
    const std::size_t limit = std::min(best_distance - 1, allowed_distance(name, candidate));
    const std::size_t least =
        std::max(name.size(), candidate.size()) - std::min(name.size(), candidate.size());
    if (least > limit || (limit == 0 && name != candidate)) {
      continue;
    }
    const std::size_t distance = edit_distance(name, candidate, limit);
    if (distance <= limit) {
      best = candidate;
      best_distance = distance;
    }
    if (best_distance == 0) {
      break;
    }
  }
  return best;
}

std::string name_hint(std::string_view name, const std::vector<std::string>& known) {
  if (known.empty()) {
    return "there are none";
  }
  std::string hint = did_you_mean(nearest(name, known));
  if (hint.empty()) {
    for (const std::string& candidate : known) {
      hint += (hint.empty() ? "known are " : ", ") + candidate;
    }
  }
  return hint;
}

}  // namespace fastcycle::config
