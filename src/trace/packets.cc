#include "trace/packets.h"

#include <utility>

namespace fastcycle::trace {
namespace {

// Field numbers, by message.
namespace trace_field {
constexpr unsigned kPacket = 1;
}
namespace packet_field {
constexpr unsigned kClockSnapshot = 6;
constexpr unsigned kTimestamp = 8;
constexpr unsigned kSequenceId = 10;
constexpr unsigned kTrackEvent = 11;
constexpr unsigned kInternedData = 12;
constexpr unsigned kSequenceFlags = 13;
constexpr unsigned kPreviousDropped = 42;
constexpr unsigned kDefaults = 59;
constexpr unsigned kTrackDescriptor = 60;
}  // namespace packet_field
namespace defaults_field {
constexpr unsigned kTimestampClockId = 58;
}
namespace snapshot_field {
constexpr unsigned kClocks = 1;
constexpr unsigned kPrimaryTraceClock = 2;
constexpr unsigned kClockId = 1;
constexpr unsigned kClockTimestamp = 2;
}  // namespace snapshot_field
namespace event_field {
constexpr unsigned kCategoryIids = 3;
constexpr unsigned kDebugAnnotations = 4;
constexpr unsigned kType = 9;
constexpr unsigned kNameIid = 10;
constexpr unsigned kTrackUuid = 11;
constexpr unsigned kCounterValue = 30;
constexpr unsigned kFlowIds = 47;
constexpr unsigned kTerminatingFlowIds = 48;
}  // namespace event_field
namespace annotation_field {
constexpr unsigned kNameIid = 1;
constexpr unsigned kIntValue = 4;
constexpr unsigned kStringValue = 6;
constexpr unsigned kName = 10;
}  // namespace annotation_field
namespace interned_field {
constexpr unsigned kEventCategories = 1;
constexpr unsigned kEventNames = 2;
constexpr unsigned kDebugAnnotationNames = 3;
constexpr unsigned kIid = 1;
constexpr unsigned kName = 2;
}  // namespace interned_field
namespace track_field {
constexpr unsigned kUuid = 1;
constexpr unsigned kName = 2;
constexpr unsigned kProcess = 3;
constexpr unsigned kThread = 4;
constexpr unsigned kParentUuid = 5;
constexpr unsigned kCounter = 8;
constexpr unsigned kProcessPid = 1;
constexpr unsigned kProcessName = 6;
constexpr unsigned kThreadPid = 1;
constexpr unsigned kThreadTid = 2;
constexpr unsigned kThreadName = 5;
constexpr unsigned kCounterUnitName = 6;
}  // namespace track_field

constexpr std::uint64_t kSequence = 1;  // All packets are one sequence.
constexpr std::uint64_t kStateCleared = 1;
constexpr std::uint64_t kNeedsState = 2;
constexpr std::uint64_t kRealtimeClock = 1;
constexpr std::uint64_t kMonotonicClock = 3;
constexpr std::uint64_t kBootClock = 6;

}  // namespace

void Fields::fixed(unsigned field, std::uint64_t value) {
  put((field << 3U) | 1U);
  for (int i = 0; i < 8; ++i) {
    bytes_.push_back(static_cast<char>(value & 0xff));
    value >>= 8U;
  }
}

void Fields::end_message(std::size_t begin) {
  std::size_t size = bytes_.size() - begin - 1;
  if (size < 0x80) {
    bytes_[begin] = static_cast<char>(size);
    return;
  }
  std::string length;
  for (; size >= 0x80; size >>= 7U) {
    length.push_back(static_cast<char>(size | 0x80));
  }
  length.push_back(static_cast<char>(size));
  bytes_.replace(begin, 1, length);
}

std::uint64_t Packets::name(const std::string& text) {
  const auto [place, is_new] = iids_.try_emplace(text, names_.size() + 1);
  if (is_new) {
    names_.push_back({.text = text});
  }
  return place->second;
}

template <typename Fill>
void Packets::packet(const Fill& fill) {
  Fields(bytes_).message(trace_field::kPacket, [&](Fields& packet) {
    packet.number(packet_field::kSequenceId, kSequence);
    fill(packet);
  });
}

void Packets::begin_anew() noexcept {
  has_state_ = false;
  has_lost_ = true;
  for (Name& name : names_) {
    name.is_event_known = name.is_category_known = name.is_annotation_known = false;
  }
}

void Packets::begin_state() {
  if (std::exchange(has_state_, true)) {
    return;
  }
  packet([&](Fields& packet) {
    packet.number(packet_field::kSequenceFlags, kStateCleared);
    if (std::exchange(has_lost_, false)) {
      packet.number(packet_field::kPreviousDropped, 1);
    }
    packet.message(packet_field::kDefaults, [](Fields& defaults) {
      defaults.number(defaults_field::kTimestampClockId, kMonotonicClock);
    });
  });
}

void Packets::add(const Clocks& clocks) {
  begin_state();
  packet([&](Fields& packet) {
    packet.message(packet_field::kClockSnapshot, [&](Fields& snapshot) {
      const auto add_clock = [&](std::uint64_t id, std::int64_t time_ns) {
        snapshot.message(snapshot_field::kClocks, [&](Fields& clock) {
          clock.number(snapshot_field::kClockId, id);
          clock.number(snapshot_field::kClockTimestamp, static_cast<std::uint64_t>(time_ns));
        });
      };
      add_clock(kMonotonicClock, clocks.monotonic_ns);
      add_clock(kBootClock, clocks.boot_ns);
      add_clock(kRealtimeClock, clocks.real_ns);
      snapshot.number(snapshot_field::kPrimaryTraceClock, kMonotonicClock);
    });
  });
}

void Packets::add(const Track& track) {
  begin_state();
  packet([&](Fields& packet) {
    packet.message(packet_field::kTrackDescriptor, [&](Fields& descriptor) {
      descriptor.number(track_field::kUuid, track.id);
      if (track.parent != 0) {
        descriptor.number(track_field::kParentUuid, track.parent);
      }
      if (track.thread != 0) {
        descriptor.message(track_field::kThread, [&](Fields& thread) {
          thread.number(track_field::kThreadPid, static_cast<std::uint64_t>(track.process));
          thread.number(track_field::kThreadTid, static_cast<std::uint64_t>(track.thread));
          thread.text(track_field::kThreadName, track.name);
        });
      } else if (track.process != 0) {
        descriptor.message(track_field::kProcess, [&](Fields& process) {
          process.number(track_field::kProcessPid, static_cast<std::uint64_t>(track.process));
          process.text(track_field::kProcessName, track.name);
        });
      } else {
        descriptor.text(track_field::kName, track.name);
      }
      if (track.is_counter) {
        descriptor.message(track_field::kCounter, [](Fields& counter) {
          counter.text(track_field::kCounterUnitName, "messages");
        });
      }
    });
  });
}

void Packets::add_names(Fields& packet, const Event& event) {
  const auto is_new_annotation = [&](const Annotation& annotation) {
    return !names_[annotation.name - 1].is_annotation_known;
  };
  bool is_any_new = (event.name != 0 && !names_[event.name - 1].is_event_known) ||
                    (event.category != 0 && !names_[event.category - 1].is_category_known);
  for (const Annotation& annotation : event.annotations) {
    is_any_new = is_any_new || is_new_annotation(annotation);
  }
  if (!is_any_new) {
    return;
  }
  packet.message(packet_field::kInternedData, [&](Fields& interned) {
    const auto add_name = [&](unsigned field, std::uint64_t iid, bool& is_known) {
      if (iid == 0 || std::exchange(is_known, true)) {
        return;
      }
      interned.message(field, [&](Fields& name) {
        name.number(interned_field::kIid, iid);
        name.text(interned_field::kName, names_[iid - 1].text);
      });
    };
    if (event.category != 0) {
      add_name(interned_field::kEventCategories, event.category,
               names_[event.category - 1].is_category_known);
    }
    if (event.name != 0) {
      add_name(interned_field::kEventNames, event.name, names_[event.name - 1].is_event_known);
    }
    for (const Annotation& annotation : event.annotations) {
      add_name(interned_field::kDebugAnnotationNames, annotation.name,
               names_[annotation.name - 1].is_annotation_known);
    }
  });
}

void Packets::add(const Event& event) {
  begin_state();
  ++events_;
  packet([&](Fields& packet) {
    packet.number(packet_field::kTimestamp, static_cast<std::uint64_t>(event.time_ns));
    packet.number(packet_field::kSequenceFlags, kNeedsState);
    add_names(packet, event);
    packet.message(packet_field::kTrackEvent, [&](Fields& track_event) {
      track_event.number(event_field::kType, static_cast<std::uint64_t>(event.type));
      track_event.number(event_field::kTrackUuid, event.track);
      if (event.category != 0) {
        track_event.number(event_field::kCategoryIids, event.category);
      }
      if (event.name != 0) {
        track_event.number(event_field::kNameIid, event.name);
      }
      if (event.type == EventType::kCounter) {
        track_event.number(event_field::kCounterValue, static_cast<std::uint64_t>(event.value));
      }
      if (event.flow_from != 0) {
        track_event.fixed(event_field::kFlowIds, event.flow_from);
      }
      if (event.flow_to != 0) {
        track_event.fixed(event_field::kTerminatingFlowIds, event.flow_to);
      }
      for (const Annotation& annotation : event.annotations) {
        track_event.message(event_field::kDebugAnnotations, [&](Fields& field) {
          field.number(annotation_field::kNameIid, annotation.name);
          field.number(annotation_field::kIntValue, static_cast<std::uint64_t>(annotation.value));
        });
      }
      if (!event.text.empty()) {
        track_event.message(event_field::kDebugAnnotations, [&](Fields& field) {
          field.text(annotation_field::kName, "what");
          field.text(annotation_field::kStringValue, event.text);
        });
      }
    });
  });
}

}  // namespace fastcycle::trace
