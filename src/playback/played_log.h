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

/// Plays a recording to whoever looks at it, as a running application shows itself: topics with
/// their schemas, and streams of their messages at the times of the recording. It can
/// be paused, sped up, and moved to another time; then, and when a stream begins, the last
/// message before that time comes first, of each publisher.
///
///     PlayedLog log({"drive.mcap"}, {.speed = 2});
///     log.start(refusals);
///     inspect::Client client(log.connect(), "viewer");
///
/// Time begins to pass with the first stream.
///
/// A client that does not read loses messages, which are counted; time goes on. A machine that
/// does not get ready plays more slowly, and loses nothing.
///
/// @threads  `connect` is Safe from `start` on; all else is Compatible.
class PlayedLog {
 public:
  struct Options {
    double speed = 1.0;              ///< Seconds of the recording in one.
    bool is_paused = false;          ///< Until somebody plays it.
    std::optional<Time> start = {};  ///< Where it begins; none: at its beginning.
    /// Called on its thread with what cannot be read; then it is paused, and its clients are told
    /// too.
    std::function<void(const std::string&)> on_problem = [](const std::string&) {};
  };

  static constexpr double kMinSpeed = 0.01;
  static constexpr double kMaxSpeed = 1000.0;

  /// @errors  `mcap::Error` if a file cannot be read; `std::runtime_error` if none of the files has
  ///          a message in protobuf.
  PlayedLog(const std::vector<std::filesystem::path>& files, Options options);
  PlayedLog(const PlayedLog&) = delete;
  PlayedLog& operator=(const PlayedLog&) = delete;
  ~PlayedLog();

  void start(std::vector<base::Refusal>& refusals);
  void stop();

  /// A descriptor for `inspect::Client`, which its caller closes. -1 if none can be made.
  [[nodiscard]] int connect();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] Time begin() const { return begin_; }
  [[nodiscard]] Time end() const { return end_; }
  /// What is to be known of the files: where one ends that was not closed, topics that are not
  /// shown.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

 private:
  struct Topic {
    std::string name;
    std::vector<std::size_t> streams;  ///< Places in the recording.
    std::uint64_t messages = 0;
  };
  /// What a client wants to be told of one topic.
  struct Stream {
    std::uint32_t id = 0;
    std::size_t topic = 0;
    bool has_payload = true;
    bool is_new = true;      ///< It was not given the last messages yet.
    std::uint64_t lost = 0;  ///< Since the last that was sent.
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

  /// Where time stands, or would stand if nothing took any time.
  [[nodiscard]] Time now() const;
  /// From here on time goes on from `position`.
  void move_to(Time position);
  void play();
  /// Sends what is due, for a bounded time; false if that was not enough.
  bool send_due();
  void select();
  void give_last();
  /// `is_last`: to those who are given the last messages, else to all others.
  void send(const record::RecordedMessage& message, bool is_last);
  /// Something cannot be read: pauses, and goes on where it is told to.
  void take_problem(const std::string& what);

  const std::function<void(const std::string&)> on_problem_;
  std::string name_;
  record::RecordingReader reader_;
  record::RecordingReader backwards_;  ///< Looks for what came last.
  const Time begin_;
  const Time end_;
  std::vector<Topic> topics_;          ///< By name.
  std::vector<std::size_t> topic_of_;  ///< By stream of the recording.

  // The thread's.
  std::vector<std::unique_ptr<Client>> clients_;
  std::uint64_t numbers_ = 0;
  bool is_paused_ = false;
  double speed_ = 1.0;
  std::uint64_t seeks_ = 0;
  Time anchor_{};                              ///< Where time stood at
  std::int64_t anchor_ns_ = 0;                 ///< this time of CLOCK_MONOTONIC.
  Time sent_{};                                ///< All up to here was sent.
  bool has_begun_ = false;                     ///< Somebody looks, or did: before, time stands.
  bool is_selected_ = false;                   ///< `reader_` gives the topics in use,
  bool is_broken_ = false;                     ///< or something behind `sent_` cannot be read,
  std::string problem_;                        ///< of which this is known; empty: nothing.
  bool has_new_ = false;                       ///< A stream has not been given the last messages.
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
