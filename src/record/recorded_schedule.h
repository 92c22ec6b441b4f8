#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "broker/read_ring.h"
#include "executor/activation_ring.h"
#include "fastcycle/message.h"

namespace fastcycle::record {

struct RecordedStream;

/// Which of `files` is there twice, under whatever names, as a sentence; empty if none is. Its
/// messages would come twice.
[[nodiscard]] std::string find_named_twice(const std::vector<std::filesystem::path>& files);

/// Which two of `files` are of different runs that overlap in time and have one of `streams` both,
/// as a sentence; empty if none do. Files that do not name their run are not judged.
///
/// @errors  `mcap::Error` if a file cannot be read, or is not valid.
[[nodiscard]] std::string find_overlapping_runs(const std::vector<std::filesystem::path>& files,
                                                const std::vector<RecordedStream>& streams);

/// One activation as logged: everything its component could observe except the contents of
/// messages.
struct RecordedActivation {
  std::uint64_t number = 0;
  detail::Cause cause{};
  detail::Outcome outcome = detail::Outcome::kRunning;
  std::optional<std::uint32_t> subscription = {};  ///< The one that received the message.
  PublisherId publisher = 0;                       ///< Of the message; else 0.
  std::uint64_t key = 0;      ///< The message's sequence, or as `detail::ActivationRecord` has it.
  std::uint64_t skipped = 0;  ///< Ticks before this one.
  std::int64_t time_ns = 0;   ///< The value of `now()`, ns since 1970.
  /// Of a tick: how late it was. Of a message that the log does not have: the time since it was
  /// published.
  std::int64_t late_ns = 0;
  std::uint32_t publish_count = 0;
  std::vector<detail::ReplayedReads::Entry> reads = {};
  std::uint64_t reads_lost = 0;  ///< Since the previous activation that reports losses.
};

/// The activations of all components of a recorded run.
///
/// Memory: about 150 bytes for each activation, and 64 for each of its reads.
struct RecordedSchedule {
  struct Component {
    std::string name;
    std::vector<RecordedActivation> activations = {};  ///< By number.
    /// Its process was restarted: these are of the first incarnation only.
    bool is_restarted = false;
  };

  std::vector<Component> components;         ///< By their numbers in the log.
  std::map<std::string, std::string> facts;  ///< The metadata `fastcycle.run`.
  std::string application;                   ///< The attachment `application.json`; or empty.
  std::uint64_t lost = 0;                    ///< Activations that the recorder lost.
  std::vector<std::string> notes;            ///< Remarks on files that were not closed.

  /// Null if there is no component of that name.
  [[nodiscard]] const Component* find(const std::string& name) const;

  /// Reads all files of one recording.
  ///
  /// @errors  `mcap::Error` if a file cannot be read, is not valid, or is of another run.
  static RecordedSchedule read(const std::vector<std::filesystem::path>& files);
};

}  // namespace fastcycle::record
