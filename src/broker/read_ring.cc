#include "broker/read_ring.h"

namespace fastcycle::detail {

ReadRing::ReadRing(std::size_t capacity) : slots_(capacity) {}

void ReadRing::add(ReadKind kind, std::uint32_t its_place, PublisherId publisher,
                   std::uint64_t value) noexcept {
  const std::uint64_t place = next_.load(std::memory_order_relaxed);
  Slot& slot = slots_[place % slots_.size()];
  slot.version.store(2 * place + 1, std::memory_order_relaxed);
  // Released after the odd version: who reads one of them sees that version too.
  const auto order = std::memory_order_release;
  slot.activation.store(activation_, order);
  slot.kind.store(static_cast<std::uint64_t>(kind) | (std::uint64_t{its_place} << 8), order);
  slot.publisher.store(publisher, order);
  slot.value.store(value, order);
  slot.version.store(2 * place + 2, order);
  next_.store(place + 1, order);
}

bool ReadRing::read_at(std::uint64_t place, Read& found) const noexcept {
  const auto order = std::memory_order_acquire;
  const Slot& slot = slots_[place % slots_.size()];
  if (slot.version.load(order) != 2 * place + 2) {
    return false;
  }
  found.activation = slot.activation.load(order);
  const std::uint64_t kind = slot.kind.load(order);
  found.kind = static_cast<ReadKind>(kind & 0xff);
  found.place = static_cast<std::uint32_t>(kind >> 8);
  found.publisher = slot.publisher.load(order);
  found.value = slot.value.load(order);
  return slot.version.load(order) == 2 * place + 2;
}

std::uint64_t ReadRing::read(std::uint64_t& next, std::vector<Read>& reads) const {
  std::uint64_t lost = 0;
  for (const std::uint64_t end = next_.load(std::memory_order_acquire); next < end; ++next) {
    Read found;
    if (end - next <= slots_.size() && read_at(next, found)) {
      reads.push_back(found);
    } else {
      ++lost;
    }
  }
  return lost;
}

}  // namespace fastcycle::detail
