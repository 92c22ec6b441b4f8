#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/priority_mutex.h"
#include "base/thread.h"
#include "fastcycle/time.h"
#include "inspect/connection.h"
#include "inspect/inspect.pb.h"
#include "record/recording_reader.h"

namespace fastcycle::playback {

/// Plays a recording to inspection clients, as a running application presents itself: topics with
/// their schemas, and streams of their messages at the recorded times. It can be paused, sped up,
/// and moved to another time; then, and when a stream begins, the last message of each publisher
/// before that time comes first.
///
///     PlayedLog log({"drive.mcap"}, {.speed = 2});
///     log.start(refusals);
///     inspect::Client client(log.connect(), "viewer");
///
/// Time starts with the first stream.
///
/// A client that does not read loses messages, which are counted; time continues. On a machine that
/// cannot keep up, playback slows down and loses nothing.
///
/// @threads  `connect` is Safe from `start` on; all else is Compatible.
class PlayedLog {
 public:
  struct Options {
    double speed = 1.0;              ///< Recorded seconds per second.
    bool is_paused = false;          ///< Until a client resumes it.
    std::optional<Time> start = {};  ///< Start time; none: the beginning.
    /// Called on its thread with a read error; playback is then paused, and its clients are
    /// notified too.
    std::function<void(const std::string&)> on_problem = [](const std::string&) {};
  };

  static constexpr double kMinSpeed = 0.01;
  static constexpr double kMaxSpeed = 1000.0;

  /// @errors  `mcap::Error` if a file cannot be read; `std::runtime_error` if none of the files has
  ///          a message in protobuf, or if one is named twice.
  PlayedLog(const std::vector<std::filesystem::path>& files, Options options);
  PlayedLog(const PlayedLog&) = delete;
  PlayedLog& operator=(const PlayedLog&) = delete;
  ~PlayedLog();

  void start(std::vector<base::Refusal>& refusals);
  void stop();

  /// A descriptor for `inspect::Client`, which the caller closes. -1 if none can be opened.
  [[nodiscard]] int connect();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] Time begin() const { return begin_; }
  [[nodiscard]] Time end() const { return end_; }
  /// Remarks on the files: where one ends that was not closed, topics that are not shown.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

 private:
  struct Topic {
    std::string name;
    std::vector<std::size_t> streams;  ///< Indexes in the recording.
    std::uint64_t messages = 0;
  };
  /// A client's stream of one topic.
  struct Stream {
    std::uint32_t id = 0;
    std::size_t topic = 0;
    bool has_payload = true;
    bool is_new = true;      ///< It has not been sent the last messages yet.
    std::uint64_t lost = 0;  ///< Since the last message sent.
  };
  struct Client {
    std::unique_ptr<inspect::Connection> connection;
    std::vector<Stream> streams;
    bool is_over = false;
  };

  void serve();
  void wait();
  void accept_joining();
  void read(Client& client);
  void answer(Client& client, const inspect::protocol::Request& request);
  void greet(Client& client, const inspect::protocol::Request& request);
  void give_overview(bool with_topics, inspect::protocol::Overview& overview) const;
  void give_topic(const std::string& name, inspect::protocol::Topic& topic) const;
  void fill(const Topic& topic, inspect::protocol::Topic& said) const;
  [[nodiscard]] std::size_t find_topic(const std::string& name) const;
  void begin_stream(Client& client, const inspect::protocol::Request& request);
  void end_stream(Client& client, std::uint32_t id);
  void obey(const inspect::protocol::ControlPlayback& control);
  [[nodiscard]] inspect::protocol::Playback state() const;

  /// The current playback time, or the time due if playback were not late.
  [[nodiscard]] Time now() const;
  /// Continues time from `position`.
  void move_to(Time position);
  void play();
  /// Sends due messages for a bounded time; false if more are due.
  bool send_due();
  void select();
  void give_last();
  /// `is_last`: to streams that get the last messages, else to all others.
  void send(const record::RecordedMessage& message, bool is_last);
  /// Handles a read error: pauses, and continues where a client moves to.
  void take_problem(const std::string& what);

  const std::function<void(const std::string&)> on_problem_;
  std::string name_;
  record::RecordingReader reader_;
  record::RecordingReader backwards_;  ///< Searches for the last messages.
  const Time begin_;
  const Time end_;
  std::vector<Topic> topics_;          ///< By name.
  std::vector<std::size_t> topic_of_;  ///< By stream of the recording.

  // Of the thread.
  std::vector<std::unique_ptr<Client>> clients_;
  std::uint64_t numbers_ = 0;
  bool is_paused_ = false;
  double speed_ = 1.0;
  std::uint64_t seeks_ = 0;
  Time anchor_{};                              ///< Playback time at
  std::int64_t anchor_ns_ = 0;                 ///< this time of CLOCK_MONOTONIC.
  Time sent_{};                                ///< All messages up to here were sent.
  bool has_begun_ = false;                     ///< A stream was opened; time stands still before.
  bool is_selected_ = false;                   ///< `reader_` selects the topics in use,
  bool is_broken_ = false;                     ///< or data after `sent_` is unreadable,
  std::string problem_;                        ///< for this reason; empty: none.
  bool has_new_ = false;                       ///< A stream has not been sent the last messages.
  std::span<record::RecordedMessage> moment_;  ///< The next ones of `reader_`.

  int wake_ = -1;
  base::PriorityMutex mutex_;
  std::vector<int> joining_;
  std::vector<std::string> notes_;
  std::atomic<bool> is_stopping_{false};
  base::Thread thread_;
  bool is_running_ = false;
};

}  // namespace fastcycle::playback
