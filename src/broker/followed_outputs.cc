#include "broker/followed_outputs.h"

#include <algorithm>

namespace fastcycle::detail {

FollowedOutputs::~FollowedOutputs() {
  clear();
}

void FollowedOutputs::clear() noexcept {
  clear_own();
  for (Envelope* envelope : theirs_) {
    release(envelope);
  }
  theirs_.clear();
}

void FollowedOutputs::clear_own() noexcept {
  for (Envelope* envelope : own_) {
    release(envelope);
  }
  own_.clear();
}

const Envelope* FollowedOutputs::find_theirs(std::uint64_t sequence) const noexcept {
  const auto found = std::ranges::find_if(
      theirs_, [sequence](const Envelope* one) { return one->info.sequence == sequence; });
  return found == theirs_.end() ? nullptr : *found;
}

void FollowedOutputs::add(Envelope* envelope, std::deque<Envelope*>& here,
                          std::deque<Envelope*>& there, bool is_theirs) noexcept {
  const std::uint64_t sequence = envelope->info.sequence;
  while (!there.empty() && there.front()->info.sequence < sequence) {
    comparer_.unmatched(publisher_, !is_theirs);
    release(there.front());  // Its counterpart never comes.
    there.pop_front();
  }
  if (there.empty() || there.front()->info.sequence != sequence) {
    here.push_back(envelope);
    if (here.size() > kMost) {
      comparer_.not_compared(publisher_);
      release(here.front());
      here.pop_front();
    }
    return;
  }
  const Envelope& other = *there.front();
  comparer_.compare(publisher_, is_theirs ? *envelope : other, is_theirs ? other : *envelope);
  release(there.front());
  there.pop_front();
  release(envelope);
}

}  // namespace fastcycle::detail
