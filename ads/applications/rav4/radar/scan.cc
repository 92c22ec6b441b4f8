#include "scan.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include <fmt/format.h>

namespace rav4 {
namespace {

constexpr std::size_t kLargestSlot = 255;

// The number after the prefix; none if there is anything else.
std::optional<std::size_t> slot_of(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) {
    return std::nullopt;
  }
  name.remove_prefix(prefix.size());
  std::size_t slot = 0;
  const auto [after, error] = std::from_chars(name.data(), name.data() + name.size(), slot);
  if (error != std::errc() || after != name.data() + name.size() || slot > kLargestSlot) {
    return std::nullopt;
  }
  return slot;
}

double in_si(const ads::DbcSignal& signal, std::span<const std::uint8_t> payload) {
  return signal.decode(payload) * ads::si_per_unit(signal.unit);
}

}  // namespace

TrackDecoder::TrackDecoder(const ads::Dbc& dbc, const RadarNames& names) {
  for (const ads::DbcMessage& message : dbc.messages()) {
    const auto slot = slot_of(message.name, names.message_prefix);
    if (!slot) {
      continue;
    }
    Rules rules{.slot = *slot,
                .byte_count = message.byte_count,
                .forward = message.signal(names.forward),
                .right = message.signal(names.right),
                .relative_speed = message.signal(names.relative_speed),
                .is_new = message.signal(names.is_new),
                .is_valid = message.signal(names.is_valid)};
    ads::si_per_unit(rules.forward.unit);
    ads::si_per_unit(rules.right.unit);
    ads::si_per_unit(rules.relative_speed.unit);
    rules_.emplace(message.address, std::move(rules));
  }
  std::vector<bool> has_slot(rules_.size(), false);
  for (const auto& [address, rules] : rules_) {
    if (rules.slot < has_slot.size()) {
      has_slot[rules.slot] = true;
    }
  }
  if (rules_.empty() || std::ranges::count(has_slot, true) != std::ssize(has_slot)) {
    throw std::runtime_error(fmt::format(
        "expected messages {}0, {}1, ... in the radar's DBC file, found {} of that form",
        names.message_prefix, names.message_prefix, rules_.size()));
  }
}

std::optional<RadarTrack> TrackDecoder::decode(std::uint32_t address,
                                               std::span<const std::uint8_t> payload) const {
  const auto found = rules_.find(address);
  if (found == rules_.end() || payload.size() < found->second.byte_count) {
    return std::nullopt;
  }
  const Rules& rules = found->second;
  return RadarTrack{.slot = rules.slot,
                    .is_valid = rules.is_valid.decode(payload) != 0.0,
                    .is_new = rules.is_new.decode(payload) != 0.0,
                    .forward_m = in_si(rules.forward, payload),
                    .left_m = -in_si(rules.right, payload),
                    .relative_speed_mps = in_si(rules.relative_speed, payload)};
}

void ScanCollector::add(const RadarTrack& track) {
  seen_[track.slot] = true;
  ++seen_count_;
  if (track.is_valid) {
    tracks_.push_back(track);
  }
}

void ScanCollector::clear() {
  seen_.assign(seen_.size(), false);
  seen_count_ = 0;
  tracks_.clear();
}

}  // namespace rav4
