#include "broker/chain_end.h"

#include "fastcycle/assert.h"

namespace fastcycle::detail {

ChainEnd::ChainEnd(std::span<const ChainRule> rules) {
  FASTCYCLE_ASSERT(rules.size() <= 32, "a verdict has a bit for each chain");
  for (const ChainRule& rule : rules) {
    chains_.push_back(std::make_unique<Chain>());
    chains_.back()->rule = rule;
  }
}

ChainEnd::Verdict ChainEnd::judge(const Trail* trails, Time now) noexcept {
  Verdict verdict;
  for (std::size_t i = 0; trails != nullptr && i < chains_.size(); ++i) {
    Chain& chain = *chains_[i];
    const Trail& trail = trails[chain.rule.root];
    if (!trail.is_known()) {
      continue;  // Nothing that was measured there led to it.
    }
    const Duration age = now - trail.taken();
    const bool is_breach = age > chain.rule.deadline;
    chain.age.record(age.count());
    count_hops(chain, trail, now, is_breach);
    if (is_breach) {
      chain.breaches.add();
      verdict.breached |= std::uint32_t{1} << i;
      if (chain.rule.drops) {
        chain.dropped.add();
        verdict.is_dropped = true;
      }
    }
  }
  if (verdict.is_dropped) {
    stale.add();
  }
  return verdict;
}

/// The largest contributor to a breach is the hop that took the most beyond what it takes in time;
/// as long as nothing was in time, the one that took the most.
void ChainEnd::count_hops(Chain& chain, const Trail& trail, Time now, bool is_breach) noexcept {
  constexpr double kShare = 1.0 / 8;  // Of a pass in what is usual.
  HopStatistics* largest = nullptr;
  double most_ns = 0;
  bool is_waiting = false;
  const auto count = [&](HopStatistics& hop, Duration waiting, Duration running) {
    hop.waiting.record(waiting.count());
    hop.running.record(running.count());
    const auto waiting_ns = static_cast<double>(waiting.count());
    const auto running_ns = static_cast<double>(running.count());
    const double waiting_excess = waiting_ns - hop.usual_waiting_ns;
    const double running_excess = running_ns - hop.usual_running_ns;
    if (!is_breach) {
      const double share = hop.has_usual ? kShare : 1.0;
      hop.usual_waiting_ns += share * waiting_excess;
      hop.usual_running_ns += share * running_excess;
      hop.has_usual = true;
    } else if (largest == nullptr || waiting_excess + running_excess > most_ns) {
      largest = &hop;
      most_ns = waiting_excess + running_excess;
      is_waiting = waiting_excess > running_excess;
    }
  };
  Time before = trail.taken();
  const auto hops = trail.hops();
  for (std::size_t place = 0; place < hops.size(); ++place) {
    const Hop& hop = hops[place];
    count(hop_of(chain, hop.publisher, place), hop.begin - before, hop.published - hop.begin);
    before = hop.published;
  }
  count(hop_of(chain, 0, hops.size()), now - before, Duration(0));
  if (largest != nullptr) {
    (is_waiting ? largest->breaches_by_waiting : largest->breaches_by_running).add();
  }
}

ChainEnd::HopStatistics& ChainEnd::hop_of(Chain& chain, PublisherId publisher,
                                          std::size_t place) noexcept {
  const std::size_t count = chain.hop_count.load(std::memory_order_relaxed);
  // Mostly all messages come the same way.
  if (place < count && chain.hops[place].publisher.load(std::memory_order_relaxed) == publisher) {
    return chain.hops[place];
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (chain.hops[i].publisher.load(std::memory_order_relaxed) == publisher) {
      return chain.hops[i];
    }
  }
  if (count == kMaxHops) {
    return chain.hops.back();
  }
  HopStatistics& hop = chain.hops[count];
  hop.publisher.store(publisher, std::memory_order_relaxed);
  hop.place.store(place, std::memory_order_relaxed);
  chain.hop_count.store(count + 1, std::memory_order_release);
  return hop;
}

}  // namespace fastcycle::detail
