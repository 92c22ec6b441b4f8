#include <boost/function.hpp>
#include <ros/callback_queue.h>

#include "peers/ros1/node.h"
#include "peers/ros1/variants.h"

namespace fastcycle::peers {
namespace {

using Callback = boost::function<void(const RosPayload::ConstPtr&)>;

Callback taking_down(Run& run) {
  return [&run](const RosPayload::ConstPtr& payload) {
    const std::int64_t arrived_ns = now_ns();
    take_down(run, payload, arrived_ns);
  };
}

/// Echoes or records messages on one thread: that of ros::spin().
void receive_in_second_process(Run& run) {
  init_node("subscriber");
  ros::NodeHandle node;
  ros::Publisher echo;
  Callback callback = taking_down(run);
  if (run.is_rtt()) {
    echo = node.advertise<RosPayload>("echo", kQueue);
    callback = [&echo](const RosPayload::ConstPtr& payload) { echo.publish(payload); };
  }
  const ros::Subscriber subscriber =
      node.subscribe<RosPayload>("payload", kQueue, callback, {}, fast_transport());
  run.set_second_ready();
  while (!run.is_over()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
  }
  ros::shutdown();
}

}  // namespace

void measure_inter(Run& run) {
  run.in_second_process([&] { receive_in_second_process(run); });
  init_node("publisher");
  ros::NodeHandle node;
  const ros::Publisher publisher = node.advertise<RosPayload>("payload", kQueue);
  ros::Subscriber echo;
  ros::AsyncSpinner spinner(1);
  if (run.is_rtt()) {
    echo = node.subscribe<RosPayload>("echo", kQueue, taking_down(run), {}, fast_transport());
    spinner.start();
  }
  run.wait_for_second_ready();
  wait_for_subscriber(publisher);
  if (run.is_rtt()) {
    wait_until("somebody publishes echo", [&] { return echo.getNumPublishers() > 0; });
  }
  publish_all(run, publisher);
  spinner.stop();
  ros::shutdown();
}

}  // namespace fastcycle::peers
