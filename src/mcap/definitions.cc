#include "mcap/definitions.h"

#include <utility>

#include <fmt/format.h>

#include "mcap/decode.h"

namespace fastcycle::mcap {
namespace {

template <typename Kind>
bool add_to(std::map<std::uint16_t, Kind>& map, Kind one, const Place& place, Opcode opcode) {
  const std::uint16_t id = one.id;
  const auto there = map.find(id);
  if (there == map.end()) {
    map.emplace(id, std::move(one));
    return true;
  }
  if (there->second != one) {
    throw Damage({.place = place,
                  .record = name_of(opcode),
                  .expected = fmt::format("the same content for id {} as before", id),
                  .found = "another one"});
  }
  return false;
}

template <typename Kind>
const Kind* find_in(const std::map<std::uint16_t, Kind>& map, std::uint16_t id) {
  const auto there = map.find(id);
  return there == map.end() ? nullptr : &there->second;
}

}  // namespace

bool Definitions::add(Schema schema, const Place& place) {
  return add_to(schemas_, std::move(schema), place, Opcode::kSchema);
}

bool Definitions::add(Channel channel, const Place& place) {
  return add_to(channels_, std::move(channel), place, Opcode::kChannel);
}

const Schema* Definitions::find_schema(std::uint16_t id) const {
  return find_in(schemas_, id);
}

const Channel* Definitions::find_channel(std::uint16_t id) const {
  return find_in(channels_, id);
}

void Definitions::require_schema_of(const Channel& channel, const Place& place) const {
  if (channel.schema_id != 0 && find_schema(channel.schema_id) == nullptr) {
    throw Damage({.place = place,
                  .record = name_of(Opcode::kChannel),
                  .expected = "a schema_id that was defined before, or 0",
                  .found = fmt::format("{} for {}", channel.schema_id, shown(channel.topic))});
  }
}

const Channel& Definitions::require_channel(std::uint16_t id, const Place& place) const {
  const Channel* const channel = find_channel(id);
  if (channel == nullptr) {
    throw Damage({.place = place,
                  .record = name_of(Opcode::kMessage),
                  .expected = "a channel_id that was defined before",
                  .found = fmt::format("{}", id)});
  }
  return *channel;
}

}  // namespace fastcycle::mcap
