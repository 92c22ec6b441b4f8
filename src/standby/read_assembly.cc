#include "standby/read_assembly.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace fastcycle::standby {

bool ReadAssembly::read() {
  new_.clear();
  const std::uint64_t lost = ring_.read(next_, new_);
  for (const detail::Read& read : new_) {
    auto& entries = by_activation_[read.activation];
    if (read.kind != detail::ReadKind::kText) {
      entries.push_back({.read = read, .text = {}});
    } else if (!entries.empty()) {
      const std::size_t count = std::min<std::size_t>(read.place, sizeof(read.value));
      char bytes[sizeof(read.value)];
      std::memcpy(bytes, &read.value, sizeof(bytes));
      entries.back().text.append(bytes, count);
    }
  }
  return lost == 0;
}

std::vector<detail::ReplayedReads::Entry> ReadAssembly::take(std::uint64_t activation) {
  by_activation_.erase(by_activation_.begin(), by_activation_.lower_bound(activation));
  const auto found = by_activation_.find(activation);
  if (found == by_activation_.end()) {
    return {};
  }
  auto entries = std::move(found->second);
  by_activation_.erase(found);
  return entries;
}

}  // namespace fastcycle::standby
