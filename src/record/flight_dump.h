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

/// Kinds of records in the ring of a flight recorder.
enum class FlightKind : std::uint16_t {
  kMessage = 1,      ///< A `FlightMessageHead`, a `log::MessageInfo`, and the message.
  kLatched = 2,      ///< The same, for a latched message that is still valid.
  kActivations = 3,  ///< A `log::Activations`.
  kLoss = 4,         ///< A `FlightLoss`.
};

struct FlightMessageHead {
  std::uint16_t channel = 0;
  std::uint16_t info_size = 0;  ///< 0: the info has its default values.
  std::uint32_t sequence = 0;   ///< Its lower 32 bits.
  std::int64_t publish_ns = 0;
};

/// Losses of one channel since the last such record.
struct FlightLoss {
  std::uint16_t channel = 0;
  std::uint16_t unused[3] = {};
  std::uint64_t overflow = 0;
  std::uint64_t pool = 0;
  std::uint64_t too_large = 0;
  std::uint64_t process = 0;
};

/// Reason and time of a requested dump.
struct FlightTrigger {
  std::int64_t time_ns = 0;
  std::string reason = {};     ///< `fault`
  std::string component = {};  ///< Empty: no component.
  std::string detail = {};     ///< In words; may be empty.

  auto operator<=>(const FlightTrigger&) const = default;
};

/// Contents of one dump.
struct FlightWindow {
  std::vector<FlightTrigger> triggers;  ///< At least one; the first names the file.
  std::size_t trigger_count = 1;        ///< Includes those that are not kept in `triggers`.
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;  ///< Inclusive.
  FlightMark from = {};     ///< Position in the ring before its first record.
  std::optional<diagnostics::CrashNote> crash = {};  ///< What ended the run, if known.
};

/// Result of a dump.
struct FlightDump {
  std::filesystem::path file = {};
  FlightTrigger trigger = {};  ///< The first one.
  std::size_t trigger_count = 0;
  std::uint64_t messages = 0;
  std::uint64_t missing = 0;  ///< Records that were overwritten before they were written here.
  std::string problem = {};   ///< Why it was not written; empty on success.
};

/// Writes the part of `ring` in `window` to an MCAP file beside `ring_file`, named by time and
/// reason: `drive_2026-11-21_18-05-12_fault.mcap`. Never throws: see `FlightDump::problem`.
[[nodiscard]] FlightDump write_dump(FlightRingReader& ring, const FlightWindow& window,
                                    const std::filesystem::path& ring_file);

/// Writes all that an unfinished run left in `ring_file`, as `…_crash.mcap`; nothing if there is no
/// such file, it was closed, or it has no record. What could not be written stays in the ring,
/// which gets the suffix `.left`.
///
/// @errors  `mcap::Error`: it is a link, or another process is writing it.
[[nodiscard]] std::optional<FlightDump> dump_crashed(const std::filesystem::path& ring_file);

}  // namespace fastcycle::record
