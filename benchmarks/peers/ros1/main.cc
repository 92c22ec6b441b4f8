// ROS 1, between processes and between nodelets. http://wiki.ros.org/roscpp

#include <ros/common.h>

#include "peers/common/peer.h"
#include "peers/ros1/variants.h"

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  const std::string version = std::to_string(ROS_VERSION_MAJOR) + "." +
                              std::to_string(ROS_VERSION_MINOR) + "." +
                              std::to_string(ROS_VERSION_PATCH);
  return peer_main(
      argc, argv,
      {.name = "ros1",
       .version = version,
       .variants = {{.name = "nodelet",
                     .about = "Two nodelets of one manager, messages by shared pointer.",
                     .delivery = Delivery::kBetweenThreads,
                     .is_typed = true,
                     .copies = "none",
                     .measure = measure_nodelet,
                     .daemon = "rosmaster"},
                    {.name = "inter",
                     .about = "Two processes over TCPROS on loopback, tcpNoDelay.",
                     .delivery = Delivery::kBetweenProcesses,
                     .is_typed = true,
                     .copies = "4: serialized, into and out of the socket, read",
                     .measure = measure_inter,
                     .busy_us_per_mib = 1800,
                     .daemon = "rosmaster"}}});
}
