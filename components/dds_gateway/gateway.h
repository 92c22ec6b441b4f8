#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <google/protobuf/wrappers.pb.h>

#include "broker/publisher_core.h"
#include "dds_gateway/clock_exchange.h"
#include "dds_gateway/engine.h"
#include "dds_gateway/param_services.h"
#include "dds_gateway/ros_graph.h"
#include "dds_gateway/services.h"
#include "dds_gateway/settings.h"
#include "dds_gateway/trail_exchange.h"
#include "fastcycle/fastcycle.h"
#include "ros2_types/known_types.h"

namespace fastcycle::dds_gateway {

/// What became of the messages of one topic.
///
/// @threads  Safe.
struct Counters {
  std::atomic<std::uint64_t> came{0};     ///< To the gateway, from either side.
  std::atomic<std::uint64_t> went{0};     ///< On to the other side.
  std::atomic<std::uint64_t> limited{0};  ///< Not, since they came faster than the rate limit.
  std::atomic<std::uint64_t> expired{0};  ///< Not, since they were too old.
  std::atomic<std::uint64_t> own{0};      ///< Not, since the gateway itself had published them.
  std::atomic<std::uint64_t> refused{0};  ///< Not, since they could not be converted.
  std::atomic<std::uint64_t> missing{0};  ///< Sent by another application, and never came.
  /// Came before it was known how far the clock of who sent them is ahead.
  std::atomic<std::uint64_t> undated{0};
  std::atomic<std::uint64_t> unsent{0};  ///< Not, since the network did not take them.
};

/// Lets listed topics cross between this application and DDS, where ROS 2 nodes and other
/// computers are: docs/reference/dds_gateway.md.
///
/// Messages from DDS come on a thread of its own, `dds_gateway`, and are published from there;
/// messages to DDS are sent in the component's activations, so it belongs on an executor of its
/// own.
///
/// In:   the topics with `"direction": "out"`
/// Out:  the topics with `"direction": "in"`
class Gateway final : public Component {
 public:
  explicit Gateway(Context& context);
  ~Gateway() noexcept(false) override;

  void start() override;
  void stop() override;

 private:
  struct Crossing;

  /// What the params say; complete once constructed.
  struct Settings {
    std::string engine;
    std::string node;
    ParticipantOptions participant;
    Duration clock_period{};
    ClockSource clocks{};
    Duration clock_difference_max{};  ///< 0: any is good.
  };

  static Settings settings_of(Context& context);
  void add(TopicSettings settings);
  void add_clock(Duration period);
  void add_services(const std::vector<ServiceSettings>& services);
  void add_params(const std::vector<ParamSettings>& params);
  void add_arrivals();
  [[nodiscard]] std::string full_node_name() const;
  void open_network();
  void open(Crossing& crossing);
  void announce();
  void close();
  void run(const std::stop_token& stop);
  void rethrow_fault();
  void take_discoveries();
  void look_at(const Discovery& discovery);
  void receive(Crossing& crossing, std::span<const std::byte> message, const SampleInfo& info);
  void receive_at_once(Crossing& crossing, std::span<const std::byte> message,
                       const SampleInfo& info) noexcept;
  void receive_as_it_is(Crossing& crossing, std::span<const std::byte> message,
                        const SampleInfo& info);
  [[nodiscard]] detail::Arrival arrival_of(Crossing& crossing, const EnvelopeHead& head,
                                           const SampleInfo& info);
  [[nodiscard]] bool is_expired(const Crossing& crossing, Time taken, Time now) const;
  void send(Crossing& crossing, const MessageInfo& info, const google::protobuf::Message& message,
            const detail::Trail* trails = nullptr);
  void refuse(Crossing& crossing, std::atomic<std::uint64_t>& counter, const std::string& why);
  void set_trouble(const std::string& whose, std::string what);
  void tell_health();
  void tell_clocks();
  [[nodiscard]] static std::uint64_t count_missing(Crossing& crossing, const Guid& writer,
                                                   std::uint64_t number);
  [[nodiscard]] static bool may_pass(Crossing& crossing, Time now);

  const Settings settings_;
  const base::Clock& clock_;
  ros2::KnownTypes types_;
  std::vector<std::unique_ptr<Crossing>> crossings_;
  std::vector<std::unique_ptr<ServiceCrossing>> services_;
  std::unique_ptr<ParamServices> params_;  // Null: no parameter is listed.
  /// What came for services, on its way from the thread to the component's activations.
  std::optional<ExternalPublisher<google::protobuf::BytesValue>> arrivals_;

  // Made by start, and gone after stop. There are none where a recorded run is executed again.
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<Writer> graph_writer_;
  std::unique_ptr<Reader> graph_reader_;
  /// Null where nothing crosses as it is, and in simulated time.
  std::unique_ptr<ClockExchange> clocks_;
  Duration wall_to_ours_{};  // From the clock of the wall to the application's.

  // The thread's own.
  RosGraph graph_;
  struct Seen {
    Endpoint endpoint;
    Guid participant{};
  };
  std::map<Guid, Seen> seen_;

  std::atomic<std::uint64_t> peers_{0};
  std::mutex mutex_;
  std::map<std::string, std::string> troubles_;  // Guarded by it: what its health tells, by whom.
  std::string told_;                             // The component's own, as the next.
  std::map<std::string, bool> told_clocks_;      // Whether a clock may differ as much as it does.
  std::exception_ptr fault_;                     // Guarded by mutex_: of a thread of the engine.
};

}  // namespace fastcycle::dds_gateway
