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

/// Who asks the application by way of the hub.
class Asker {
 public:
  Asker() = default;
  Asker(const Asker&) = delete;
  Asker& operator=(const Asker&) = delete;
  virtual ~Asker() = default;
};

/// Whom the hub tells what came.
class Listener : public Asker {
 public:
  /// A message of a topic that it has subscribed to.
  virtual void take_message(std::uint32_t subscription,
                            std::shared_ptr<const SharedMessage> message) = 0;
  /// `count` messages of it were lost before they came here.
  virtual void take_loss(std::uint32_t subscription, std::uint64_t count) = 0;
  /// The application's time, in a simulation.
  virtual void take_time(std::int64_t now_ns) = 0;
  /// How a recording is played is not as it was; messages of another time may follow.
  virtual void take_playback(const inspect::protocol::Playback& playback, bool did_seek) = 0;

  [[nodiscard]] virtual bool wants_graph() const = 0;
  virtual void take_graph(const foxglove::Graph& graph, const foxglove::Graph& before) = 0;
  [[nodiscard]] virtual bool wants_params() const = 0;
  virtual void take_params(const inspect::protocol::Params& params) = 0;

  /// About once a second.
  virtual void tell_losses() = 0;
};

/// What the live server knows of an application, and what its clients share: channels, streams of
/// messages, params, services, the graph.
///
/// All of it comes over one connection of `inspect`: a topic is looked at as long as a client has
/// subscribed to it, and once for all of them.
///
/// @threads  Confined to the server's thread.
/// @errors   `inspect::ClientError` when the application has ended.
class Hub {
 public:
  struct Options {
    std::vector<std::string> publish = {};  ///< Patterns of topics that clients may publish on.
    Outbox::Options outbox = {};
  };

  /// Asks the application for its topics and services.
  Hub(std::unique_ptr<inspect::Client> application, Options options);
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  ~Hub();

  /// For poll(2); `read` takes what came, and gives it to the clients that wait for it.
  [[nodiscard]] int descriptor() const { return application_->descriptor(); }
  void read();
  /// What is looked at from time to time: the graph, params, time, losses. At most each 50 ms.
  void look(std::chrono::steady_clock::time_point now);

  // For listeners. Each that was added is removed before it ends.

  void add(Listener& listener) { listeners_.insert(&listener); }
  void remove(Listener& listener);
  /// What `asker` has asked for and not been given is not given to it any more.
  void forget(const Asker& asker);

  using Take = std::function<void(const inspect::protocol::Answer&)>;
  /// Sends `request`; `take` is given its answer, an error too, unless `asker` is forgotten before.
  void ask(const Asker& asker, inspect::protocol::Request request, Take take);
  [[nodiscard]] const foxglove::Channel* find_channel(std::uint32_t id) const;
  [[nodiscard]] const foxglove::Channel* find_channel(std::string_view topic) const;
  [[nodiscard]] const foxglove::Service* find_service(std::uint32_t id) const;
  void subscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel);
  void unsubscribe(Listener& listener, std::uint32_t subscription, std::uint32_t channel);
  /// The message type `name`, which `schema`, a serialized `FileDescriptorSet`, describes.
  ///
  /// @errors  `std::runtime_error` that says what of the schema is wrong.
  [[nodiscard]] const archive::MessageType& type_of(const std::string& name,
                                                    const std::string& schema);
  [[nodiscard]] bool may_publish(const std::string& topic) const;
  [[nodiscard]] bool may(std::string_view word) const;
  [[nodiscard]] const foxglove::Graph& graph() const { return graph_; }
  /// How a recording is played, as it was last heard; none if none is.
  [[nodiscard]] const std::optional<inspect::protocol::Playback>& playback() const {
    return playback_;
  }
  /// Messages that clients were too slow for, all together.
  void count_left_out(std::uint64_t count) { left_out_ += count; }
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
  /// The next `look` asks for params again.
  void params_have_changed() { next_params_ = {}; }

  /// What clients are told that this server can do, and of whom.
  [[nodiscard]] std::vector<std::string_view> capabilities() const;
  [[nodiscard]] const inspect::protocol::Welcome& welcome() const {
    return application_->welcome();
  }
  [[nodiscard]] const std::vector<foxglove::Channel>& channels() const { return channels_; }
  [[nodiscard]] const std::vector<foxglove::Service>& services() const { return services_; }
  [[nodiscard]] const std::string& session_id() const { return session_id_; }
  [[nodiscard]] const Options& options() const { return options_; }

 private:
  /// Messages of one topic on their way to all who subscribed to it.
  struct Feed {
    std::string topic;
    std::uint32_t stream = 0;  ///< The request's id; 0: nobody looks.
    std::size_t latched = 0;   ///< Messages that who comes later is given.
    struct Kept {
      std::uint32_t publisher;
      std::shared_ptr<const SharedMessage> message;
    };
    std::deque<Kept> kept;  ///< These; of a recording the last one of each publisher.
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
  std::vector<foxglove::Channel> channels_;  ///< Id less 1 is the place.
  std::vector<foxglove::Service> services_;  ///< The same.
  std::map<std::uint32_t, Feed> feeds_;      ///< By channel.
  std::map<std::uint32_t, std::uint32_t> channel_of_stream_;
  struct Asked {
    const Asker* asker;
    Take take;
  };
  std::map<std::uint32_t, Asked> asked_;                                ///< By request.
  std::map<std::string, std::unique_ptr<archive::MessageType>> types_;  ///< Asked for so far.
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
