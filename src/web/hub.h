#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "archive/message_type.h"
#include "inspect/client.h"
#include "mcap/topic_filter.h"
#include "web/foxglove.h"
#include "web/outbox.h"

namespace fastcycle::web {

/// Sender of requests through the hub.
class Asker {
 public:
  Asker() = default;
  Asker(const Asker&) = delete;
  Asker& operator=(const Asker&) = delete;
  virtual ~Asker() = default;
};

/// Receives updates from the hub.
class Listener : public Asker {
 public:
  /// A message of a subscribed topic.
  virtual void take_message(std::uint32_t subscription,
                            std::shared_ptr<const SharedMessage> message) = 0;
  /// `count` messages of it were lost on the way to the hub.
  virtual void take_loss(std::uint32_t subscription, std::uint64_t count) = 0;
  /// The application's time, in simulated time.
  virtual void take_time(std::int64_t now_ns) = 0;
  /// The playback state has changed; messages of another time may follow.
  virtual void take_playback(const inspect::protocol::Playback& playback, bool did_seek) = 0;

  [[nodiscard]] virtual bool wants_graph() const = 0;
  virtual void take_graph(const foxglove::Graph& graph, const foxglove::Graph& before) = 0;
  [[nodiscard]] virtual bool wants_params() const = 0;
  virtual void take_params(const inspect::protocol::Params& params) = 0;

  /// Called about once a second.
  virtual void report_losses() = 0;
};

/// The live server's view of an application, shared by its clients: channels, message streams,
/// params, services, the graph.
///
/// All of it uses one connection of `inspect`: a topic is streamed while any client subscribes to
/// it, and only once for all of them.
///
/// @threads  Confined to the server's thread.
/// @errors   `inspect::ClientError` if the application has ended.
class Hub {
 public:
  struct Options {
    std::vector<std::string> publish = {};  ///< Patterns of topics on which clients may publish.
    Outbox::Options outbox = {};
  };

  /// Requests the application's topics and services.
  Hub(std::unique_ptr<inspect::Client> application, Options options);
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  ~Hub();

  /// For poll(2); `read` receives data, and passes it to the clients that wait for it.
  [[nodiscard]] int descriptor() const { return application_->descriptor(); }
  void read();
  /// Polls the graph, params, time and losses. At most every 50 ms.
  void look(std::chrono::steady_clock::time_point now);

  // For listeners. Each must be removed before it is destroyed.

  void add(Listener& listener) { listeners_.insert(&listener); }
  void remove(Listener& listener);
  /// Drops pending answers to `asker`.
  void forget(const Asker& asker);

  using Take = std::function<void(const inspect::protocol::Answer&)>;
  /// Sends `request`; `take` receives its answer, or an error, unless `forget` is called before.
  void ask(const Asker& asker, inspect::protocol::Request request, Take take);
  [[nodiscard]] const foxglove::Channel* find_channel(std::uint32_t id) const;
  [[nodiscard]] const foxglove::Channel* find_channel(std::string_view topic) const;
  [[nodiscard]] const foxglove::Service* find_service(std::uint32_t id) const;
  void subscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel);
  void unsubscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel);
  /// The message type `name`, described by `schema`, a serialized `FileDescriptorSet`.
  ///
  /// @errors  `std::runtime_error` that describes the error in the schema.
  [[nodiscard]] const archive::MessageType& type_of(const std::string& name,
                                                    const std::string& schema);
  [[nodiscard]] bool may_publish(const std::string& topic) const;
  [[nodiscard]] bool may(std::string_view word) const;
  [[nodiscard]] const foxglove::Graph& graph() const { return graph_; }
  /// The last known playback state; none if nothing is played.
  [[nodiscard]] const std::optional<inspect::protocol::Playback>& playback() const {
    return playback_;
  }
  /// Adds messages dropped because of slow clients.
  void count_left_out(std::uint64_t count) { left_out_ += count; }
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
  /// Makes the next `look` request params again.
  void params_have_changed() { next_params_ = {}; }

  /// The capabilities of this server, as announced to clients.
  [[nodiscard]] std::vector<std::string_view> capabilities() const;
  [[nodiscard]] const inspect::protocol::Welcome& welcome() const {
    return application_->welcome();
  }
  [[nodiscard]] const std::vector<foxglove::Channel>& channels() const { return channels_; }
  [[nodiscard]] const std::vector<foxglove::Service>& services() const { return services_; }
  [[nodiscard]] const std::string& session_id() const { return session_id_; }
  [[nodiscard]] const Options& options() const { return options_; }

 private:
  /// Distributes messages of one topic to its subscribers.
  struct Feed {
    std::string topic;
    std::uint32_t stream = 0;  ///< The request's id; 0: not streamed.
    std::size_t latched = 0;   ///< Number of messages for later subscribers.
    struct Kept {
      std::uint32_t publisher;
      std::shared_ptr<const SharedMessage> message;
    };
    std::deque<Kept> kept;  ///< These; in a playback the last one of each publisher.
    std::vector<std::pair<Listener*, std::uint32_t>> subscribers;
  };

  void find_topics();
  void find_services();
  void take(const inspect::protocol::Answer& answer);
  void take_messages(Feed& feed, const inspect::protocol::Messages& messages);
  void keep(Feed& feed, Feed::Kept message);
  void take_overview(const inspect::protocol::Overview& overview);
  void take_playback(const inspect::protocol::Playback& playback);
  void post(inspect::protocol::Request request, const Asker* asker, Take take);

  const std::unique_ptr<inspect::Client> application_;
  const Options options_;
  const mcap::TopicFilter publishable_;
  const std::string session_id_;
  bool is_simulated_ = false;
  std::vector<foxglove::Channel> channels_;  ///< Index: id less 1.
  std::vector<foxglove::Service> services_;  ///< The same.
  std::map<std::uint32_t, Feed> feeds_;      ///< By channel.
  std::map<std::uint32_t, std::uint32_t> channel_of_stream_;
  struct Asked {
    const Asker* asker;
    Take take;
  };
  std::map<std::uint32_t, Asked> asked_;                                ///< By request.
  std::map<std::string, std::unique_ptr<archive::MessageType>> types_;  ///< Cache.
  std::set<Listener*> listeners_;
  foxglove::Graph graph_;
  std::optional<inspect::protocol::Playback> playback_;
  std::uint64_t left_out_ = 0;
  std::chrono::steady_clock::time_point next_overview_{};
  std::chrono::steady_clock::time_point next_time_{};
  std::chrono::steady_clock::time_point next_params_{};
  std::chrono::steady_clock::time_point next_losses_{};
  bool asks_overview_ = false;
  bool asks_time_ = false;
  bool asks_params_ = false;
};

}  // namespace fastcycle::web
