#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "web/foxglove.h"
#include "web/hub.h"
#include "web/outbox.h"

namespace fastcycle::web {

/// One client: its subscriptions and requests.
///
/// @threads  Confined to the server's thread.
class Session final : public Listener {
 public:
  /// Sends the client the available topics and services. `wake` is called whenever the outbox gets
  /// data.
  Session(Hub& hub, std::function<void()> wake);
  ~Session() override;

  /// Handles a message of the client. Failures are sent as `status`, and the session continues.
  void take_text(std::string_view text);
  void take_binary(std::string_view frame);

  [[nodiscard]] Outbox& outbox() { return outbox_; }

  void take_message(std::uint32_t subscription,
                    std::shared_ptr<const SharedMessage> message) override;
  void take_loss(std::uint32_t subscription, std::uint64_t count) override;
  void take_time(std::int64_t now_ns) override;
  void take_playback(const inspect::protocol::Playback& playback, bool did_seek) override;
  [[nodiscard]] bool wants_graph() const override { return wants_graph_; }
  void take_graph(const foxglove::Graph& graph, const foxglove::Graph& before) override;
  [[nodiscard]] bool wants_params() const override { return wants_params_; }
  /// Sends changes of the subscribed params.
  void take_params(const inspect::protocol::Params& params) override;
  void report_losses() override;

 private:
  static constexpr std::size_t kMaxSubscriptions = 4096;
  static constexpr std::size_t kMaxChannels = 256;
  static constexpr std::size_t kMaxParams = 4096;

  void greet();
  void send_text(std::string text);
  void send_binary(std::string bytes);
  void send_status(foxglove::StatusLevel level, std::string_view text, std::string_view id = {});
  void subscribe(const foxglove::Json& json);
  void unsubscribe(const foxglove::Json& json);
  void advertise(const foxglove::Json& json);
  void unadvertise(const foxglove::Json& json);
  void get_params(const foxglove::Json& json);
  void set_params(const foxglove::Json& json);
  void subscribe_params(const foxglove::Json& json, bool is_wanted);
  void publish(const foxglove::ClientMessage& message);
  void call(const foxglove::ClientCall& call);
  void control(const foxglove::ClientPlayback& playback);
  void refuse(std::string_view text) { send_status(foxglove::StatusLevel::kError, text); }

  Hub& hub_;
  const std::function<void()> wake_;
  Outbox outbox_;
  std::map<std::uint32_t, std::uint32_t> subscriptions_;  ///< Channels by subscription id.
  std::map<std::uint32_t, std::uint64_t> lost_;           ///< By subscription, not reported yet.
  struct OwnChannel {
    std::string topic;
    bool is_json = false;
  };
  std::map<std::uint32_t, OwnChannel> own_channels_;
  bool wants_graph_ = false;
  bool wants_params_ = false;
  std::set<std::string> params_;                    ///< Empty: all.
  std::map<std::string, std::string> sent_params_;  ///< Values as JSON.
  std::string problem_;                             ///< Last reported problem of the recording.
};

}  // namespace fastcycle::web
