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

/// The content of one frame of a radar's track slot.
struct RadarTrack {
  std::size_t slot = 0;
  bool is_valid = false;  ///< The slot holds an object; else the other fields are undefined.
  bool is_new = false;
  double forward_m = 0.0;
  double left_m = 0.0;
  double relative_speed_mps = 0.0;
};

/// The names of a radar's track messages in its DBC file: one message for each slot, named by
/// `message_prefix` and the slot's number, and the same signals in each.
struct RadarNames {
  std::string message_prefix;
  std::string forward;
  std::string right;  ///< Positive to the right in the DBC file.
  std::string relative_speed;
  std::string is_new;
  std::string is_valid;
};

/// Decodes the frames of a radar's track slots, as defined by its DBC file.
///
/// @threads  Compatible.
class TrackDecoder {
 public:
  /// @errors  Throws `std::runtime_error` if the file has no such messages or signals.
  TrackDecoder(const ads::Dbc& dbc, const RadarNames& names);

  [[nodiscard]] std::size_t slots() const { return rules_.size(); }

  /// The track in a frame; none if its address belongs to no slot, or if it is too short.
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

/// Assembles the frames of the slots to scans. The radar sends each slot once a scan, in varying
/// order: a scan is complete when every slot has been received, and ends when one is received
/// again.
///
/// @threads  Confined.
class ScanCollector {
 public:
  explicit ScanCollector(std::size_t slots) : seen_(slots, false) {}

  /// Whether `track` belongs to the next scan: then take the collected tracks first.
  [[nodiscard]] bool begins_next_scan(const RadarTrack& track) const { return seen_[track.slot]; }

  /// @pre  `track.slot` is below the number of slots; not `begins_next_scan(track)`.
  void add(const RadarTrack& track);

  [[nodiscard]] bool is_complete() const { return seen_count_ == seen_.size(); }

  /// The valid tracks of the scan so far, in the order received.
  [[nodiscard]] const std::vector<RadarTrack>& tracks() const { return tracks_; }

  void clear();

 private:
  std::vector<bool> seen_;
  std::size_t seen_count_ = 0;
  std::vector<RadarTrack> tracks_;
};

}  // namespace rav4
