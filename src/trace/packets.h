#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace fastcycle::trace {

/// Appends fields of a message to `bytes`, in protobuf's wire format:
/// https://protobuf.dev/programming-guides/encoding/
///
/// @threads  Confined.
class Fields {
 public:
  explicit Fields(std::string& bytes) : bytes_(bytes) {}

  void number(unsigned field, std::uint64_t value) {
    put(field << 3U);
    put(value);
  }
  void fixed(unsigned field, std::uint64_t value);
  void text(unsigned field, std::string_view value) {
    put((field << 3U) | 2U);
    put(value.size());
    bytes_.append(value);
  }
  /// A nested message: `fill` adds its fields.
  template <typename Fill>
  void message(unsigned field, const Fill& fill) {
    put((field << 3U) | 2U);
    const std::size_t begin = bytes_.size();
    bytes_.push_back('\0');  // Most lengths fit one byte.
    fill(*this);
    end_message(begin);
  }

 private:
  void put(std::uint64_t value) {
    while (value >= 0x80) {
      bytes_.push_back(static_cast<char>(value | 0x80));
      value >>= 7U;
    }
    bytes_.push_back(static_cast<char>(value));
  }
  void end_message(std::size_t begin);

  std::string& bytes_;
};

/// Type of a track event. The numbers are the format's.
enum class EventType : std::uint8_t { kBegin = 1, kEnd = 2, kInstant = 3, kCounter = 4 };

/// A number that the viewer shows with an event.
struct Annotation {
  std::uint64_t name = 0;  ///< As `Packets::name`.
  std::int64_t value = 0;
};

/// One event of a track.
struct Event {
  EventType type{};
  std::int64_t time_ns = 0;
  std::uint64_t track = 0;
  std::uint64_t name = 0;       ///< As `Packets::name`; 0: none.
  std::uint64_t category = 0;   ///< As `Packets::name`; 0: none.
  std::uint64_t flow_from = 0;  ///< A flow begins here; 0: none.
  std::uint64_t flow_to = 0;    ///< A flow ends here; 0: none.
  std::int64_t value = 0;       ///< Of a counter.
  std::string_view text = {};   ///< Shown as "what", if there is one.
  std::span<const Annotation> annotations = {};
};

/// A row of the viewer.
struct Track {
  std::uint64_t id = 0;
  std::uint64_t parent = 0;  ///< 0: none.
  std::string name = {};
  std::int64_t process = 0;  ///< Its pid, if the row is a process,
  std::int64_t thread = 0;   ///< and its tid, if it is a thread of `process`.
  bool is_counter = false;
};

/// Encodes the packets of a trace in Perfetto's format, as far as needed here. Field numbers are
/// those of its public definitions, package perfetto.protos:
/// https://github.com/google/perfetto/tree/main/protos/perfetto/trace (trace_packet.proto,
/// clock_snapshot.proto, track_event/*.proto, interned_data/interned_data.proto)
///
/// Names are interned: written once, and numbers from then on. After packets were discarded, call
/// `begin_anew`: what follows is self-contained.
///
/// @threads  Confined.
class Packets {
 public:
  /// The permanent number of `text`. Not 0.
  std::uint64_t name(const std::string& text);

  /// Readings of the clocks of the trace at one moment.
  struct Clocks {
    std::int64_t monotonic_ns = 0;
    std::int64_t boot_ns = 0;
    std::int64_t real_ns = 0;
  };
  void add(const Clocks& clocks);
  void add(const Track& track);
  void add(const Event& event);

  /// Encoded bytes not taken yet.
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t event_count() const noexcept { return events_; }
  void clear() noexcept {
    bytes_.clear();
    events_ = 0;
  }
  /// The last packets were lost: names are written again when they are needed.
  void begin_anew() noexcept;

 private:
  template <typename Fill>
  void packet(const Fill& fill);
  void begin_state();
  void add_names(Fields& packet, const Event& event);

  struct Name {
    std::string text;
    bool is_event_known = false;
    bool is_category_known = false;
    bool is_annotation_known = false;
  };

  std::string bytes_;
  std::uint64_t events_ = 0;
  std::vector<Name> names_;
  std::unordered_map<std::string, std::uint64_t> iids_;
  bool has_state_ = false;
  bool has_lost_ = false;
};

}  // namespace fastcycle::trace
