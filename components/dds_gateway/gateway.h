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

/// Statistics of one topic.
///
/// @threads  Safe.
struct Counters {
  std::atomic<std::uint64_t> came{0};     ///< Received from either side.
  std::atomic<std::uint64_t> went{0};     ///< Passed on to the other side.
  std::atomic<std::uint64_t> limited{0};  ///< Dropped: exceeded the rate limit.
  std::atomic<std::uint64_t> expired{0};  ///< Dropped: too old.
  std::atomic<std::uint64_t> own{0};      ///< Dropped: published by the gateway itself.
  std::atomic<std::uint64_t> refused{0};  ///< Dropped: conversion failed.
  std::atomic<std::uint64_t> missing{0};  ///< Lost on the way from another application.
  /// Received before the offset of the sender's clock was known.
  std::atomic<std::uint64_t> undated{0};
  std::atomic<std::uint64_t> unsent{0};  ///< Dropped: the network did not accept them.
};

/// Passes listed topics between this application and DDS, and so ROS 2 nodes and other computers:
/// docs/reference/dds_gateway.md.
///
/// Messages from DDS arrive on a thread of its own, `dds_gateway`, and are published from there;
/// messages to DDS are sent in the component's activations, so it should have an executor of its
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

  /// Values of the params; complete once constructed.
  struct Settings {
    std::string engine;
    std::string node;
    ParticipantOptions participant;
    Duration clock_period{};
    ClockSource clocks{};
    Duration clock_difference_max{};  ///< 0: no limit.
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
  void report_health();
  void report_clocks();
  [[nodiscard]] static std::uint64_t count_missing(Crossing& crossing, const Guid& writer,
                                                   std::uint64_t number);
  [[nodiscard]] static bool may_pass(Crossing& crossing, Time now);

  const Settings settings_;
  const base::Clock& clock_;
  ros2::KnownTypes types_;
  std::vector<std::unique_ptr<Crossing>> crossings_;
  std::vector<std::unique_ptr<ServiceCrossing>> services_;
  std::unique_ptr<ParamServices> params_;  // Null: no parameter is listed.
  /// Service messages on their way from the thread to the component's activations.
  std::optional<ExternalPublisher<google::protobuf::BytesValue>> arrivals_;

  // Created by start, destroyed by stop. Absent if a recorded run is executed again.
  std::unique_ptr<Participant> participant_;
  std::unique_ptr<Writer> graph_writer_;
  std::unique_ptr<Reader> graph_reader_;
  /// Null if no topic passes unconverted, and in simulated time.
  std::unique_ptr<ClockExchange> clocks_;
  Duration wall_to_ours_{};  // From the wall clock to the application's.

  // Of the thread.
  RosGraph graph_;
  struct Seen {
    Endpoint endpoint;
    Guid participant{};
  };
  std::map<Guid, Seen> seen_;

  std::atomic<std::uint64_t> peers_{0};
  std::mutex mutex_;
  std::map<std::string, std::string> troubles_;  // By source; guarded by it.
  std::string reported_;                         // Of the component, as the next.
  std::map<std::string, bool> reported_clocks_;  // Whether a clock's present offset is acceptable.
  std::exception_ptr fault_;                     // Guarded by mutex_: of an engine thread.
};

}  // namespace fastcycle::dds_gateway
