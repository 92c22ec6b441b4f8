#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diagnostics/crash_note.h"
#include "record/flight_ring.h"

namespace fastcycle::record {

/// What stands in the ring of a flight recorder.
enum class FlightKind : std::uint16_t {
  kMessage = 1,      ///< A `FlightMessageHead`, a `log::MessageInfo`, and the message.
  kLatched = 2,      ///< The same, of a message that was published before and still holds.
  kActivations = 3,  ///< A `log::Activations`.
  kLoss = 4,         ///< A `FlightLoss`.
};

struct FlightMessageHead {
  std::uint16_t channel = 0;
  std::uint16_t info_size = 0;  ///< 0: it is as usual.
  std::uint32_t sequence = 0;   ///< Its lower 32 bits.
  std::int64_t publish_ns = 0;
};

/// What one channel lost since the last such record.
struct FlightLoss {
  std::uint16_t channel = 0;
  std::uint16_t unused[3] = {};
  std::uint64_t overflow = 0;
  std::uint64_t pool = 0;
  std::uint64_t too_large = 0;
  std::uint64_t process = 0;
};

/// Why a dump was asked for, and when.
struct FlightTrigger {
  std::int64_t time_ns = 0;
  std::string reason = {};     ///< `fault`
  std::string component = {};  ///< Empty: none of them.
  std::string detail = {};     ///< In words; may be empty.

  auto operator<=>(const FlightTrigger&) const = default;
};

/// What one dump has.
struct FlightWindow {
  std::vector<FlightTrigger> triggers;  ///< At least one; the first names the file.
  std::size_t trigger_count = 1;        ///< Also those of which nothing is kept.
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;  ///< The last nanosecond of it.
  FlightMark from = {};     ///< Nothing of it stands before this in the ring.
  std::optional<diagnostics::CrashNote> crash = {};  ///< What ended the run, if that is known.
};

/// What became of a dump.
struct FlightDump {
  std::filesystem::path file = {};
  FlightTrigger trigger = {};  ///< The first.
  std::size_t trigger_count = 0;
  std::uint64_t messages = 0;
  std::uint64_t missing = 0;  ///< Records that were overwritten before they were written here.
  std::string problem = {};   ///< Why it was not written; empty if it was.
};

/// Writes what `ring` has of `window` into an MCAP file beside `ring_file`, whose name says when
/// and why: `drive_2026-11-21_18-05-12_fault.mcap`. Never throws: see `FlightDump::problem`.
[[nodiscard]] FlightDump write_dump(FlightRingReader& ring, const FlightWindow& window,
                                    const std::filesystem::path& ring_file);

/// Writes all that a run left in `ring_file` that did not end in order, as `…_crash.mcap`; nothing
/// if there is no such file, it was closed, or it has no record. What could not be written stays in
/// the ring, which gets the suffix `.left`.
///
/// @errors  `mcap::Error`: it is a link or being written by another process.
[[nodiscard]] std::optional<FlightDump> dump_crashed(const std::filesystem::path& ring_file);

}  // namespace fastcycle::record
