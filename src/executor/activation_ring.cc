#include "executor/activation_ring.h"

#include <algorithm>

namespace fastcycle::detail {
namespace {

/// Of an activation that runs.
std::uint64_t head_of(const ActivationRecord& record) noexcept {
  return (std::uint64_t{record.component} << 32) | (std::uint64_t{record.subscription} << 16) |
         (static_cast<std::uint64_t>(record.cause) << 8) |
         static_cast<std::uint64_t>(Outcome::kRunning);
}

}  // namespace

const char* to_word(Cause cause) noexcept {
  constexpr const char* kWords[] = {"message",  "tick", "request", "reply", "timeout", "parameter",
                                    "external", "job",  "event",   "mode",  "connect", "fault"};
  return kWords[static_cast<std::size_t>(cause)];
}

std::uint64_t ActivationRing::begin(const ActivationRecord& record) noexcept {
  const std::uint64_t place = next_.load(std::memory_order_relaxed);
  Slot& slot = slots_[place % kCapacity];
  const auto relaxed = std::memory_order_relaxed;
  // Every field is released after the odd version: a reader of one of them sees that version too.
  slot.version.store(2 * place + 1, relaxed);
  const auto release_order = std::memory_order_release;
  slot.head.store(head_of(record), release_order);
  slot.number.store(record.number, release_order);
  slot.publisher.store(record.publisher, release_order);
  slot.key.store(record.key, release_order);
  slot.skipped.store(record.skipped, release_order);
  slot.time_ns.store(record.time_ns, release_order);
  slot.cause_ns.store(record.cause_ns, release_order);
  slot.begin_ns.store(record.begin_ns, release_order);
  slot.duration_ns.store(0, release_order);
  slot.published_ns.store(0, release_order);
  slot.publish_count.store(0, release_order);
  slot.version.store(2 * place + 2, release_order);
  next_.store(place + 1, release_order);
  return place;
}

void ActivationRing::end(std::uint64_t place, const ActivationRecord& record) noexcept {
  Slot& slot = slots_[place % kCapacity];
  // Released too: a reader of one of these for an older record sees that it was replaced.
  slot.duration_ns.store(record.duration_ns, std::memory_order_release);
  slot.published_ns.store(record.published_ns, std::memory_order_release);
  slot.publish_count.store(record.publish_count, std::memory_order_release);
  const std::uint64_t head = slot.head.load(std::memory_order_relaxed);
  slot.head.store((head & ~std::uint64_t{0xff}) | static_cast<std::uint64_t>(record.outcome),
                  std::memory_order_release);
}

bool ActivationRing::read_at(std::uint64_t place, ActivationRecord& record) const noexcept {
  const auto order = std::memory_order_acquire;
  const Slot& slot = slots_[place % kCapacity];
  if (slot.version.load(order) != 2 * place + 2) {
    return false;
  }
  const std::uint64_t head = slot.head.load(order);
  record.component = static_cast<std::uint32_t>(head >> 32);
  record.subscription = static_cast<std::uint16_t>((head >> 16) & 0xffff);
  record.cause = static_cast<Cause>((head >> 8) & 0xff);
  record.outcome = static_cast<Outcome>(head & 0xff);
  record.number = slot.number.load(order);
  record.publisher = slot.publisher.load(order);
  record.key = slot.key.load(order);
  record.skipped = slot.skipped.load(order);
  record.time_ns = slot.time_ns.load(order);
  record.cause_ns = slot.cause_ns.load(order);
  record.begin_ns = slot.begin_ns.load(order);
  record.duration_ns = slot.duration_ns.load(order);
  record.published_ns = slot.published_ns.load(order);
  record.publish_count = static_cast<std::uint32_t>(slot.publish_count.load(order));
  return slot.version.load(order) == 2 * place + 2;
}

std::uint64_t ActivationRing::read(std::uint64_t& next,
                                   std::vector<ActivationRecord>& records) const {
  std::uint64_t lost = 0;
  const std::uint64_t end = size();
  if (end > next && end - next > kCapacity) {
    lost = end - next - kCapacity;
    next = end - kCapacity;
  }
  for (; next < end; ++next) {
    ActivationRecord record;
    // The worker may have overwritten the record meanwhile: then it is lost.
    if (!read_at(next, record)) {
      ++lost;
    } else if (record.outcome == Outcome::kRunning && next + 1 == end) {
      break;
    } else {
      records.push_back(record);
    }
  }
  return lost;
}

std::vector<ActivationRecord> ActivationRing::snapshot() const {
  std::vector<ActivationRecord> records;
  const std::uint64_t end = size();
  for (std::uint64_t place = end - std::min<std::uint64_t>(end, kCapacity); place < end; ++place) {
    ActivationRecord record;
    if (read_at(place, record)) {
      records.push_back(record);
    }
  }
  return records;
}

}  // namespace fastcycle::detail
