#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/dbc.h"

namespace rav4 {

/// What stands in one frame of a radar's track slot.
struct RadarTrack {
  std::size_t slot = 0;
  bool is_valid = false;  ///< The slot holds an object; else the rest means nothing.
  bool is_new = false;
  double forward_m = 0.0;
  double left_m = 0.0;
  double relative_speed_mps = 0.0;
};

/// The names that a radar's track messages have in its DBC file: one message for each slot, with
/// the number of the slot after `message_prefix`, and the same signals in each.
struct RadarNames {
  std::string message_prefix;
  std::string forward;
  std::string right;  ///< The DBC file counts to the right.
  std::string relative_speed;
  std::string is_new;
  std::string is_valid;
};

/// Decodes the frames of a radar's track slots by the rules of its DBC file.
///
/// @threads  Compatible.
class TrackDecoder {
 public:
  /// @errors  Throws `std::runtime_error` if the file has no such messages or signals.
  TrackDecoder(const ads::Dbc& dbc, const RadarNames& names);

  [[nodiscard]] std::size_t slots() const { return rules_.size(); }

  /// The track in a frame; none if its address is of no slot, or if it is too short.
  [[nodiscard]] std::optional<RadarTrack> decode(std::uint32_t address,
                                                 std::span<const std::uint8_t> payload) const;

 private:
  struct Rules {
    std::size_t slot = 0;
    std::size_t byte_count = 0;
    ads::DbcSignal forward;
    ads::DbcSignal right;
    ads::DbcSignal relative_speed;
    ads::DbcSignal is_new;
    ads::DbcSignal is_valid;
  };

  std::map<std::uint32_t, Rules> rules_;  // By address.
};

/// Puts the frames of the slots together to scans. The radar sends each slot once a scan, in an
/// order that changes: a scan is complete when every slot has come, and over when one comes again.
///
/// @threads  Confined.
class ScanCollector {
 public:
  explicit ScanCollector(std::size_t slots) : seen_(slots, false) {}

  /// True if `track` belongs to the next scan: what was collected has to be taken first.
  [[nodiscard]] bool begins_next_scan(const RadarTrack& track) const { return seen_[track.slot]; }

  /// @pre  `track.slot` is below the number of slots; not `begins_next_scan(track)`.
  void add(const RadarTrack& track);

  [[nodiscard]] bool is_complete() const { return seen_count_ == seen_.size(); }

  /// The valid tracks of the scan so far, in the order in which they came.
  [[nodiscard]] const std::vector<RadarTrack>& tracks() const { return tracks_; }

  void clear();

 private:
  std::vector<bool> seen_;
  std::size_t seen_count_ = 0;
  std::vector<RadarTrack> tracks_;
};

}  // namespace rav4
