#include "broker/read_ring.h"

#include <algorithm>
#include <cstring>

namespace fastcycle::detail {

ReadRing::ReadRing(std::size_t capacity)
    : capacity_(capacity),
      own_(std::make_unique<Words[]>(bytes_of(capacity) / sizeof(Words))),
      words_(own_[0]) {}

ReadRing::ReadRing(void* memory, std::size_t capacity) noexcept
    : capacity_(capacity), words_(*static_cast<Words*>(memory)) {}

std::size_t ReadRing::bytes_of(std::size_t capacity) noexcept {
  const std::size_t bytes = sizeof(Words) + capacity * sizeof(Slot);
  return (bytes + sizeof(Words) - 1) / sizeof(Words) * sizeof(Words);
}

void ReadRing::add(ReadKind kind, std::uint32_t its_place, PublisherId publisher,
                   std::uint64_t value) noexcept {
  const std::uint64_t place = words_.next.load(std::memory_order_relaxed);
  Slot& slot = slot_at(place);
  slot.version.store(2 * place + 1, std::memory_order_relaxed);
  // Released after the odd version: a reader of one of them sees that version too.
  const auto order = std::memory_order_release;
  slot.activation.store(activation_, order);
  slot.kind.store(static_cast<std::uint64_t>(kind) | (std::uint64_t{its_place} << 8), order);
  slot.publisher.store(publisher, order);
  slot.value.store(value, order);
  slot.version.store(2 * place + 2, order);
  words_.next.store(place + 1, order);
}

void ReadRing::add(ReadKind kind, std::uint32_t place, std::string_view text) noexcept {
  add(kind, place, 0, text.size());
  while (!text.empty()) {
    const std::size_t count = std::min<std::size_t>(text.size(), sizeof(std::uint64_t));
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, text.data(), count);
    add(ReadKind::kText, static_cast<std::uint32_t>(count), 0, bytes);
    text.remove_prefix(count);
  }
}

bool ReadRing::read_at(std::uint64_t place, Read& found) const noexcept {
  const auto order = std::memory_order_acquire;
  const Slot& slot = slot_at(place);
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
  const std::uint64_t end = words_.next.load(std::memory_order_acquire);
  if (end > next && end - next > capacity_) {
    lost = end - next - capacity_;
    next = end - capacity_;
  }
  for (; next < end; ++next) {
    Read found;
    if (read_at(next, found)) {
      reads.push_back(found);
    } else {
      ++lost;
    }
  }
  return lost;
}

void ReplayedReads::begin(std::span<const Entry> entries) {
  entries_ = entries;
  is_taken_.assign(entries.size(), false);
  has_missed_ = false;
}

const ReplayedReads::Entry* ReplayedReads::take(ReadKind kind, PublisherId about,
                                                std::uint32_t place) {
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Read& read = entries_[i].read;
    if (!is_taken_[i] && read.kind == kind && read.publisher == about && read.place == place) {
      is_taken_[i] = true;
      return &entries_[i];
    }
  }
  has_missed_ = true;
  return nullptr;
}

std::optional<std::string> ReplayedReads::take_text(ReadKind kind, std::string_view name) {
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    if (!is_taken_[i] && entry.read.kind == kind && entry.text.size() > name.size() &&
        entry.text.starts_with(name) && entry.text[name.size()] == '\0') {
      is_taken_[i] = true;
      return entry.text.substr(name.size() + 1);
    }
  }
  return std::nullopt;
}

bool ReplayedReads::has(ReadKind kind) const noexcept {
  return std::ranges::any_of(entries_,
                             [kind](const Entry& entry) { return entry.read.kind == kind; });
}

}  // namespace fastcycle::detail
