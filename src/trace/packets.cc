#include "trace/packets.h"

#include <utility>

#include "trace/perfetto.pb.h"

namespace fastcycle::trace {
namespace {

constexpr std::uint32_t kSequence = 1;  // All packets are one sequence.
constexpr std::uint32_t kStateCleared = 1;
constexpr std::uint32_t kNeedsState = 2;
constexpr std::uint32_t kRealtimeClock = 1;
constexpr std::uint32_t kMonotonicClock = 3;
constexpr std::uint32_t kBootClock = 6;

}  // namespace

Packets::Packets() : trace_(std::make_unique<perfetto::Trace>()) {}

Packets::~Packets() = default;

std::uint64_t Packets::name(const std::string& text) {
  const auto [place, is_new] = iids_.try_emplace(text, names_.size() + 1);
  if (is_new) {
    names_.push_back({.text = text});
  }
  return place->second;
}

perfetto::Packet& Packets::begin_packet() {
  trace_->Clear();
  perfetto::Packet& packet = *trace_->add_packets();
  packet.set_sequence(kSequence);
  return packet;
}

void Packets::end_packet() {
  trace_->AppendToString(&bytes_);
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
  perfetto::Packet& packet = begin_packet();
  packet.set_sequence_flags(kStateCleared);
  if (std::exchange(has_lost_, false)) {
    packet.set_has_lost_before(true);
  }
  packet.mutable_defaults()->set_clock(kMonotonicClock);
  end_packet();
}

void Packets::add(const Clocks& clocks) {
  begin_state();
  auto& snapshot = *begin_packet().mutable_clock_snapshot();
  for (const auto& [id, time_ns] :
       {std::pair(kMonotonicClock, clocks.monotonic_ns), std::pair(kBootClock, clocks.boot_ns),
        std::pair(kRealtimeClock, clocks.real_ns)}) {
    auto& clock = *snapshot.add_clocks();
    clock.set_id(id);
    clock.set_time_ns(static_cast<std::uint64_t>(time_ns));
  }
  snapshot.set_primary_clock(kMonotonicClock);
  end_packet();
}

void Packets::add(const Track& track) {
  begin_state();
  auto& descriptor = *begin_packet().mutable_track_descriptor();
  descriptor.set_id(track.id);
  if (track.parent != 0) {
    descriptor.set_parent(track.parent);
  }
  if (track.thread != 0) {
    auto& thread = *descriptor.mutable_thread();
    thread.set_pid(static_cast<std::int32_t>(track.process));
    thread.set_tid(track.thread);
    thread.set_name(track.name);
  } else if (track.process != 0) {
    auto& process = *descriptor.mutable_process();
    process.set_pid(static_cast<std::int32_t>(track.process));
    process.set_name(track.name);
  } else {
    descriptor.set_name(track.name);
  }
  if (track.is_counter) {
    descriptor.mutable_counter()->set_unit("messages");
  }
  end_packet();
}

// The names that the event uses for the first time.
void Packets::add_names(perfetto::Packet& packet, const Event& event) {
  const auto add_name = [&](std::uint64_t id, bool Name::* is_known, auto add_to) {
    if (id == 0 || std::exchange(names_[id - 1].*is_known, true)) {
      return;
    }
    perfetto::InternedData::Name& name = *add_to(*packet.mutable_interned_data());
    name.set_id(id);
    name.set_text(names_[id - 1].text);
  };
  add_name(event.category, &Name::is_category_known,
           [](perfetto::InternedData& data) { return data.add_categories(); });
  add_name(event.name, &Name::is_event_known,
           [](perfetto::InternedData& data) { return data.add_events(); });
  for (const Annotation& annotation : event.annotations) {
    add_name(annotation.name, &Name::is_annotation_known,
             [](perfetto::InternedData& data) { return data.add_annotations(); });
  }
}

void Packets::add(const Event& event) {
  begin_state();
  ++events_;
  perfetto::Packet& packet = begin_packet();
  packet.set_timestamp_ns(static_cast<std::uint64_t>(event.time_ns));
  packet.set_sequence_flags(kNeedsState);
  add_names(packet, event);
  auto& track_event = *packet.mutable_track_event();
  track_event.set_type(static_cast<std::int32_t>(event.type));
  track_event.set_track(event.track);
  if (event.category != 0) {
    track_event.add_categories(event.category);
  }
  if (event.name != 0) {
    track_event.set_name(event.name);
  }
  if (event.type == EventType::kCounter) {
    track_event.set_counter_value(event.value);
  }
  if (event.flow_from != 0) {
    track_event.add_flows(event.flow_from);
  }
  if (event.flow_to != 0) {
    track_event.add_ending_flows(event.flow_to);
  }
  for (const Annotation& annotation : event.annotations) {
    auto& number = *track_event.add_annotations();
    number.set_interned_name(annotation.name);
    number.set_integer(annotation.value);
  }
  if (!event.text.empty()) {
    auto& text = *track_event.add_annotations();
    text.set_name("what");
    text.set_text(std::string(event.text));
  }
  end_packet();
}

}  // namespace fastcycle::trace
