#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/priority_mutex.h"
#include "base/thread.h"
#include "config/description.h"
#include "host/application.h"
#include "host/observer.h"
#include "host/status.h"
#include "inspect/connection.h"
#include "inspect/inspect.pb.h"
#include "inspect/overview.h"
#include "inspect/playback_control.h"
#include "inspect/socket_file.h"
#include "inspect/stream.h"
#include "inspect/taps.h"
#include "inspect/task_thread.h"
#include "inspect/voice.h"

namespace fastcycle::inspect {

/// The permissions in an application description, as words.
[[nodiscard]] std::vector<std::string> allowed_words(const config::InspectDescription& description);

/// Answers tools of the same user over a socket while an application runs.
///
///     Server server(application, description);
///     application.add(server);
///
/// One low-priority thread does all of it. It reads counters and histograms, which need no lock,
/// and taps topics only while a client reads them. No component ever waits for it.
///
/// @threads  As `Observer`; `offer` is Safe. Must outlive the application.
class Server final : public host::Observer {
 public:
  static constexpr std::size_t kMaxConnections = 32;
  static constexpr std::size_t kMaxStreams = 64;  ///< Per connection.
  static constexpr std::chrono::seconds kPatience{10};
  /// Limit of queued message bytes over all clients. When it is reached, streams lose messages, and
  /// the client that has been behind the longest is dropped.
  static constexpr std::size_t kMaxWaitingOfAll = std::size_t{64} << 20U;
  /// Limit of incomplete requests over all clients: beyond it, the largest sender is dropped.
  static constexpr std::size_t kMaxRequestsOfAll = std::size_t{64} << 20U;

  /// A client that reads nothing for `patience` is dropped. With an empty `folder` there is no
  /// socket file, only `connect`.
  Server(host::Application& application, config::InspectDescription description,
         std::filesystem::path folder = socket_folder(),
         std::chrono::nanoseconds patience = kPatience);
  ~Server() override;

  /// A connection for a client in this process: a descriptor for `inspect::Client`, which the
  /// caller closes. -1 if none can be opened. Safe once the application has started.
  [[nodiscard]] int connect();

  /// `make` returns a JSON document that clients request as `name`. It is called on the server's
  /// thread while the application runs.
  void offer(std::string name, std::function<std::string()> make);

  /// Lets clients control `playback`, which must outlive this. Before the application starts.
  void offer(PlaybackControl& playback) { playback_ = &playback; }

  void tap(detail::Topics& topics) override;
  void open(config::Problems& problems) override;
  void start(const host::ObserverView& view, std::vector<base::Refusal>& refusals) override;
  void changed(const host::ComponentNews& news) noexcept override;
  [[nodiscard]] bool wants_changes() const override { return true; }
  void stop(const host::Application& application) override;

  /// Path of the socket; empty before `open`.
  [[nodiscard]] std::filesystem::path file() const;

 private:
  /// State of one client.
  struct Client {
    explicit Client(std::unique_ptr<Connection> its_connection)
        : connection(std::move(its_connection)) {}
    std::unique_ptr<Connection> connection;
    std::vector<std::unique_ptr<Stream>> streams;
    struct LogStream {
      std::uint32_t id = 0;
      LogLevel level = LogLevel::kDebug;
      std::string component;
      std::uint64_t lost = 0;  ///< Lines since the last answer, while the client did not read.
    };
    std::vector<LogStream> log_streams;
    std::set<std::string> published;  ///< Topics it has published on; at most all existing ones.
    Room room;
    std::int64_t behind_since_ns = 0;  ///< Since when more output waits than should; 0: not behind.
    bool is_over = false;
  };
  struct LogLine {
    std::int64_t time_ns;
    LogLevel level;
    std::string component;
    std::string text;
  };
  /// An answer produced by another thread.
  struct Made {
    std::uint64_t connection;
    protocol::Answer answer;
  };

  void serve();
  void wait();
  void accept_all();
  void accept_one(int descriptor, bool is_within);
  void refuse_without_descriptor();
  [[nodiscard]] bool may_accept() const;
  void refuse(int descriptor, protocol::Error::Kind kind, const std::string& text);
  [[nodiscard]] std::size_t max_frame_of(const Client& client) const;
  /// Whether a received request can be answered now.
  [[nodiscard]] bool is_asking(const Client& client) const;
  void serve(Client& client);
  bool take_frame(Client& client, std::string_view frame);
  void look();
  void make_room(std::int64_t now_ns);
  void bound_requests();
  void give_log();
  void give_made();
  void accept_joining();
  void write(Client& client, std::int64_t now_ns);
  void drop(Client& client, const std::string& why);
  void forget_gone();
  void send_farewell();
  void wake() noexcept;
  void give(std::uint64_t connection, const protocol::Answer& answer);
  /// The same, from any thread.
  void give_later(std::uint64_t connection, protocol::Answer answer);

  // One function per request.
  void answer(Client& client, const protocol::Request& request);
  void greet(Client& client, const protocol::Request& request);
  [[nodiscard]] std::vector<host::ComponentNews> present_news() const;
  void give_overview(const protocol::GetOverview& request, protocol::Answer& answer);
  void give_topic(const protocol::GetTopic& request, protocol::Answer& answer);
  void give_params(const protocol::GetParams& request, protocol::Answer& answer);
  void change_params(Client& client, const protocol::Request& request);
  void switch_mode(Client& client, const protocol::SwitchMode& request, protocol::Answer& answer);
  [[nodiscard]] detail::ComponentCore& component_of(const std::string& name) const;
  void switch_to_standby(Client& client, const protocol::Request& request);
  void change_lifecycle(Client& client, const protocol::Request& request);
  void reload(const Client& client, detail::ComponentCore& core, const protocol::Lifecycle& wanted,
              host::LifeChanges::Done done);
  void publish(Client& client, const protocol::Publish& request, protocol::Answer& answer);
  void call_service(Client& client, const protocol::Request& request);
  void give_document(const protocol::GetDocument& request, protocol::Answer& answer);
  void begin_stream(Client& client, const protocol::Request& request);
  void begin_record(Client& client, const protocol::Request& request);
  void begin_log(Client& client, const protocol::Request& request);
  void end_stream(Client& client, std::uint32_t id);
  void open_stream(Client& client, std::unique_ptr<Stream> stream, protocol::Answer started);
  /// Name of its socket; without one, of the application.
  [[nodiscard]] std::string name() const;
  void need(bool is_allowed, const char* word, const char* what) const;
  [[nodiscard]] detail::Topic& topic_of(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> documents() const;
  /// Its process and user, for the log.
  [[nodiscard]] static std::string name_of(const Client& client);
  void note(const std::string& who, std::string_view what);
  void note(const Client& client, std::string_view what) { note(name_of(client), what); }

  host::Application& application_;
  const config::InspectDescription description_;
  const std::filesystem::path folder_;
  const std::int64_t patience_ns_;
  PlaybackControl* playback_ = nullptr;  ///< Null: no playback.
  std::unique_ptr<SocketFile> socket_;
  int wake_ = -1;
  /// Released briefly to report to a new client that the process has no descriptor left.
  int reserve_ = -1;
  std::int64_t next_accept_ns_ = 0;

  // Constant once the server runs.
  std::vector<KnownService> services_;
  std::string graph_;
  record::Explanation explanation_;

  // Of the server's thread.
  std::unique_ptr<Voice> voice_;  ///< Null unless tools may publish.
  Taps taps_;
  Excerpts excerpts_;
  std::vector<std::unique_ptr<Client>> clients_;
  std::uint64_t numbers_ = 0;
  std::uint64_t dropped_clients_ = 0;
  std::int64_t next_look_ns_ = 0;
  std::int64_t next_complaint_ns_ = 0;

  // Written by other threads.
  mutable base::PriorityMutex mutex_;
  std::vector<host::ComponentNews> news_;
  std::map<std::string, std::function<std::string()>> documents_;
  std::deque<LogLine> log_;
  std::uint64_t lost_log_ = 0;
  std::vector<Made> made_;
  std::vector<int> joining_;  ///< Our ends of connections from `connect`.

  std::atomic<bool> is_log_wanted_{false};
  std::atomic<bool> is_stopping_{false};
  std::vector<base::Refusal> ignored_;
  base::Thread thread_;
  bool is_running_ = false;
  /// Changes params if that takes the answers of other processes, for which nothing else may wait.
  TaskThread waiting_{"fc-params"};
};

}  // namespace fastcycle::inspect
