#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace fastcycle::trace {

namespace perfetto {
class Packet;
class Trace;
}  // namespace perfetto

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

/// Encodes the packets of a trace in Perfetto's format, as far as needed here (perfetto.proto).
///
/// Names are interned: written once, and numbers from then on. After packets were discarded, call
/// `begin_anew`: what follows is self-contained.
///
/// @threads  Confined.
class Packets {
 public:
  Packets();
  Packets(const Packets&) = delete;
  Packets& operator=(const Packets&) = delete;
  ~Packets();

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
  perfetto::Packet& begin_packet();
  void end_packet();
  void begin_state();
  void add_names(perfetto::Packet& packet, const Event& event);

  struct Name {
    std::string text;
    bool is_event_known = false;
    bool is_category_known = false;
    bool is_annotation_known = false;
  };

  std::unique_ptr<perfetto::Trace> trace_;  // One packet, whose memory is used again.
  std::string bytes_;
  std::uint64_t events_ = 0;
  std::vector<Name> names_;
  std::unordered_map<std::string, std::uint64_t> iids_;
  bool has_state_ = false;
  bool has_lost_ = false;
};

}  // namespace fastcycle::trace
