#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/thread.h"
#include "broker/topics.h"
#include "executor/activation_ring.h"
#include "mcap/topic_filter.h"
#include "record/flight_dump.h"
#include "record/flight_ring.h"
#include "record/serializer.h"
#include "record/streams.h"

namespace fastcycle::record {

/// What a flight recorder keeps, and which part of it goes into a dump.
struct FlightOptions {
  std::filesystem::path file;  ///< Of the ring; dumps are written beside it.
  std::uint64_t bytes = 256'000'000;
  Duration before = std::chrono::seconds(20);
  Duration after = std::chrono::seconds(5);
  mcap::TopicFilter filter = {};
};

/// Statistics of a flight recorder.
struct FlightReport {
  std::filesystem::path file;
  std::uint64_t capacity = 0;   ///< Bytes.
  std::uint64_t messages = 0;   ///< Kept, including those overwritten later.
  std::uint64_t bytes = 0;      ///< Of these, serialized.
  std::uint64_t overflow = 0;   ///< Lost: overwritten in the queue before the recorder took them.
  std::uint64_t pool = 0;       ///< Lost: the publisher's pool was exhausted; not published at all.
  std::uint64_t too_large = 0;  ///< Lost: larger than half of the ring.
  std::uint64_t process = 0;    ///< Lost: on the way from the publishing process.
  std::uint64_t activations_lost = 0;
  std::uint64_t reads_lost = 0;        ///< Of components.
  std::string problem = {};            ///< Error of the ring; empty if there is none.
  std::vector<FlightDump> dumps;       ///< In the order of writing.
  std::uint64_t triggers_refused = 0;  ///< After `kDumpsMax` dumps, or the queue was full.
};

/// Keeps the last messages and activations of a running application in a ring on disk, and writes
/// those around a trigger into an MCAP file.
///
/// One thread takes the messages out of a tap every few milliseconds and copies them into the ring,
/// whose contents survive the process, however it ends. So a publisher pays only for one more
/// queue. A trigger is a few words in a slot; that thread finds it, and after the time that the
/// dump has to cover, another one reads the ring and writes the file, while the application
/// continues.
///
/// In simulated time nothing polls: `take` is called after each round, and writes a dump that is
/// due before any of it could be overwritten.
///
/// @threads  Confined to the control thread; `take` to that of the simulation; `trigger` is Safe.
class FlightRecorder {
 public:
  static constexpr std::chrono::milliseconds kPoll{5};
  static constexpr std::size_t kDumpsMax = 16;  ///< Per run.

  FlightRecorder(FlightOptions options, const base::Clock& clock);
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;
  ~FlightRecorder();

  /// Called with a message about a dump or an error; on any thread of the recorder. Set before
  /// `open`.
  std::function<void(bool is_trouble, const std::string&)> on_news = [](bool, const auto&) {};

  /// Taps the selected topics; call before they are connected.
  void tap(detail::Topics& topics);

  /// Dumps what an unfinished run left in the file, and creates the ring again; call once the
  /// topics are connected.
  ///
  /// @errors  `mcap::Error`: the file cannot be created.
  void open(const Explanation& explanation);

  /// Starts, before anything is published.
  void start(Activity activity);

  /// Takes pending messages; in simulated time after each round, with the round's index in its
  /// moment.
  void take(std::uint32_t step = 0);

  /// Requests a dump; joins that of a trigger shortly before. Long texts are truncated.
  ///
  /// @realtime No lock, no allocation, no system call.
  void trigger(std::string_view reason, std::string_view component,
               std::string_view detail) noexcept;

  /// Takes what is left, writes the outstanding dumps, and closes the ring. A second call does
  /// nothing.
  void stop();

  /// Once stopped.
  [[nodiscard]] FlightReport report() const;
  /// Null if it was not opened.
  [[nodiscard]] const FlightRing* ring() const { return ring_.get(); }

 private:
  /// A trigger on its way to the taking thread.
  struct TriggerSlot {
    enum class State : std::uint8_t { kFree, kWriting, kReady };

    std::atomic<State> state{State::kFree};
    std::int64_t time_ns = 0;
    std::array<char, 64> reason{};
    std::array<char, 64> component{};
    std::array<char, 256> detail{};
  };

  /// State of a stream.
  struct StreamState {
    std::uint64_t overflow = 0;  ///< As noted in the ring.
    std::uint64_t pool = 0;
    std::uint64_t process = 0;
    std::uint64_t too_large = 0;
    std::uint64_t too_large_noted = 0;
    std::deque<std::vector<std::byte>> latched;  ///< Its last messages, as stored in the ring.
  };

  /// Position of the ring at some time.
  struct TimedMark {
    std::int64_t time_ns = 0;
    FlightMark mark;
  };

  struct Job {
    FlightWindow window;
    std::unique_ptr<FlightRingReader> reader;
  };

  void poll();
  void keep(const Stream& stream, const detail::Envelope& envelope);
  void remember(const Stream& stream);
  void keep_activations();
  void look_at_ring();
  void note_losses();
  void repeat_latched();
  void note_mark(std::int64_t now_ns);
  [[nodiscard]] FlightMark mark_before(std::int64_t time_ns) const;
  void collect_triggers();
  void add_trigger(FlightTrigger trigger);
  void hand_over_what_is_due(std::int64_t now_ns);
  void hand_over(const FlightWindow& window);
  void write_dumps();
  void finish(FlightDump dump);

  // Constant once started.
  const FlightOptions options_;
  const base::Clock& clock_;
  Streams streams_{"flight recorder"};
  std::unique_ptr<FlightRing> ring_;

  std::array<TriggerSlot, 16> slots_;
  std::atomic<std::uint64_t> triggers_refused_{0};

  // Of the taking thread.
  Serializer serializer_;
  ActivationReader activations_;
  std::vector<StreamState> states_;  ///< By `Stream::index`.
  std::vector<mcap::Bytes> parts_;
  std::string scratch_;
  std::optional<std::uint32_t> round_;  ///< Simulated time: the round being taken, in its moment.
  std::uint64_t repeated_at_ = 0;       ///< Ring position when latched messages were repeated.
  std::deque<TimedMark> marks_;
  std::deque<FlightWindow> windows_;  ///< Not due yet.
  std::size_t dump_count_ = 0;
  bool is_limit_reported_ = false;
  std::int64_t looked_ns_ = 0;  ///< CLOCK_MONOTONIC of the last check of the ring.
  bool is_cut_ = false;
  std::string reported_;
  std::string problem_;
  std::uint64_t messages_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t activations_lost_ = 0;
  std::uint64_t reads_lost_ = 0;

  // Shared by both threads.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::vector<FlightDump> dumps_;
  bool stops_taking_ = false;
  bool stops_dumping_ = false;

  bool is_started_ = false;
  std::vector<base::Refusal> refusals_;
  base::Thread dumping_;
  base::Thread polling_;
};

}  // namespace fastcycle::record
