#pragma once

#include <cstddef>
#include <cstdint>
#include <map>

#include "mcap/error.h"
#include "mcap/records.h"

namespace fastcycle::mcap {

/// The schemas and channels of a file, by id.
///
/// @threads  Compatible.
class Definitions {
 public:
  /// False if it is already defined, with the same content: files may repeat definitions.
  ///
  /// @errors  `Damage` at `place` if another one has this id.
  bool add(Schema schema, const Place& place);
  bool add(Channel channel, const Place& place);

  /// Null if there is none. Pointers stay valid.
  [[nodiscard]] const Schema* find_schema(std::uint16_t id) const;
  [[nodiscard]] const Channel* find_channel(std::uint16_t id) const;

  /// @errors  `Damage` at `place` if the channel's schema is not defined.
  void require_schema_of(const Channel& channel, const Place& place) const;
  /// @errors  `Damage` at `place` if the channel is not defined.
  const Channel& require_channel(std::uint16_t id, const Place& place) const;

  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const { return schemas_; }
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const { return channels_; }

 private:
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
};

}  // namespace fastcycle::mcap
