#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include <boost/make_shared.hpp>
#include <ros/ros.h>

#include "measure/payload.h"
#include "peers/common/run.h"
#include "peers/common/wait.h"
#include "peers/ros1/payload.h"

namespace fastcycle::peers {

/// Size of each queue: a window of a flood is never dropped.
constexpr std::uint32_t kQueue = 2 * static_cast<std::uint32_t>(Run::kWindow);

/// Makes this process a node, without signal handler and log output.
inline void init_node(const char* name) {
  ros::init(ros::M_string(), name,
            ros::init_options::NoSigintHandler | ros::init_options::AnonymousName |
                ros::init_options::NoRosout);
  if (!ros::master::check()) {
    throw std::runtime_error("no rosmaster at ROS_MASTER_URI; run_peer.py starts one");
  }
}

/// For low latency, without Nagle's algorithm (wiki.ros.org/roscpp/Overview/Publishers and
/// Subscribers, Transport Hints).
inline ros::TransportHints fast_transport() {
  return ros::TransportHints().tcpNoDelay();
}

inline void wait_for_subscriber(const ros::Publisher& publisher) {
  wait_until("somebody subscribes to " + publisher.getTopic(),
             [&] { return publisher.getNumSubscribers() > 0; });
}

/// Sends all messages of the run: a new one each time, by shared pointer, which roscpp does not
/// copy within a process (wiki.ros.org/roscpp/Overview/Publishers and Subscribers, Intraprocess).
inline void publish_all(Run& run, const ros::Publisher& publisher) {
  run.publish_all([&](std::int64_t number) {
    const std::int64_t made_ns = now_ns();
    const RosPayload::Ptr payload = boost::make_shared<RosPayload>();
    payload->data.resize(run.size());
    measure::fill(payload->data.data(), run.size(), number);
    payload->stamps = {.number = number, .made_ns = made_ns, .sent_ns = now_ns()};
    publisher.publish(payload);
  });
}

/// A subscriber callback that records messages.
inline void take_down(Run& run, const RosPayload::ConstPtr& payload, std::int64_t arrived_ns) {
  run.arrived(payload->stamps, payload->data.data(), arrived_ns);
}

}  // namespace fastcycle::peers
