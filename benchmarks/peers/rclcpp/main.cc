// ROS 2, within a process and between processes. https://docs.ros.org

#include <rclcpp/version.h>

#include "peers/common/peer.h"
#include "peers/rclcpp/variants.h"

int main(int argc, char** argv) {
  using namespace fastcycle::peers;
  return peer_main(
      argc, argv,
      {.name = "rclcpp",
       .version = RCLCPP_VERSION_STR,
       .variants = {{.name = "intra-multithreaded",
                     .about = "Composed nodes, intra-process communication, MultiThreadedExecutor.",
                     .delivery = Delivery::kBetweenThreads,
                     .is_typed = true,
                     .copies = "none",
                     .measure = measure_intra_multithreaded},
                    {.name = "intra-events",
                     .about = "Composed nodes, intra-process communication, EventsExecutor.",
                     .delivery = Delivery::kBetweenThreads,
                     .is_typed = true,
                     .copies = "none",
                     .measure = measure_intra_events},
                    {.name = "inter",
                     .about = "Two processes over the default middleware, EventsExecutor.",
                     .delivery = Delivery::kBetweenProcesses,
                     .is_typed = true,
                     .copies = "at least 2: serialized, read",
                     .measure = measure_inter,
                     .busy_us_per_mib = 2000}}});
}
